// Two scans of one patient, and what is asked before they are compared.

import { useMemo, useState } from "preact/hooks";
import { type Volume, fieldOf, words } from "./api";
import { areOfTwoPatients, picked, statedRole, stressOf } from "./pairing";
import { type Draft, ParameterForm, parameterSpecs, valuesOf } from "./parameters";
import { openComparison } from "./route";
import { useWatched } from "./state";
import { acquisition, cut, moment, nameOf, study } from "./words";
import { fileComparison } from "./work";
import { volumes } from "./library";

const TOLD = {
  headers: "Filled in from the headers.",
  names: "Guessed from the file names: please check.",
};

interface Props {
  pair: [Volume, Volume];
  /** The id of the scan at stress, if it was chosen before. */
  stress?: string | null;
  /** What was written before, and what was wrong with it. */
  draft?: Draft;
  problem?: { field: string | null; text: string } | null;
  /** Whether the service has said that the scans are of two patients. */
  otherPatient?: boolean;
  onClose?: () => void;
}

export function PairForm({
  pair,
  stress: chosenBefore = null,
  draft: before = {},
  problem: first = null,
  otherPatient = false,
  onClose,
}: Props) {
  const [a, b] = pair;
  const guess = useMemo(() => stressOf(a, b), [a, b]);
  const [stress, setStress] = useState<string | null>(chosenBefore ?? guess.stress?.id ?? null);
  const [draft, setDraft] = useState<Draft>(before);
  const [problem, setProblem] = useState(first);
  const [sending, setSending] = useState(false);
  const twoPatients = otherPatient || areOfTwoPatients(a, b);
  const asOnePatient = draft["same_patient"] === "true";
  const alike = statedRole(a) !== null && statedRole(a) === statedRole(b);
  const send = async (event: Event) => {
    event.preventDefault();
    if (!stress) return;
    setProblem(null);
    setSending(true);
    try {
      const { normals, ...parameters } = valuesOf(draft, (await parameterSpecs()).comparison);
      const [atStress, atRest] = stress === a.id ? [a, b] : [b, a];
      const job = await fileComparison({
        stress: atStress,
        rest: atRest,
        normals: typeof normals === "string" ? normals : null,
        parameters,
      });
      picked.value = [];
      openComparison(job.id);
    } catch (error) {
      setProblem({ field: fieldOf(error), text: words(error) });
    }
    setSending(false);
  };
  return (
    <form class="pair-form" aria-label="Compare rest and stress" onSubmit={event => void send(event)}>
      <fieldset>
        <legend>Which scan is stress?</legend>
        {pair.map(volume => (
          <label key={volume.id} class="pair-choice">
            <input
              type="radio"
              name="stress"
              value={volume.id}
              checked={stress === volume.id}
              onChange={() => setStress(volume.id)}
            />
            <span>
              <b title={nameOf(volume)}>{cut(nameOf(volume))}</b>
              {stress && (
                <span class={`role ${stress === volume.id ? "stress" : "rest"}`}>
                  {stress === volume.id ? "stress" : "rest"}
                </span>
              )}
              <span class="quiet">
                {[study(volume, cut), ...acquisition(volume), moment(volume.created_at)].filter(Boolean).join(" · ")}
              </span>
            </span>
          </label>
        ))}
      </fieldset>
      <p class="quiet">{guess.told ? TOLD[guess.told] : "Not stated in headers or names: please choose."}</p>
      {alike && <p class="warning">Both headers say {statedRole(a)}.</p>}
      {twoPatients && !asOnePatient && (
        <p class="warning">
          The headers name two patients: their scans are only compared if you say that they are one.
        </p>
      )}
      {(twoPatients || asOnePatient) && (
        <label class="inline">
          <input
            type="checkbox"
            checked={asOnePatient}
            onChange={event => setDraft({ ...draft, same_patient: event.currentTarget.checked ? "true" : "" })}
          />
          These are scans of one patient
        </label>
      )}
      <ParameterForm
        kind="comparison"
        volume={stress === b.id ? b : a}
        draft={draft}
        onChange={setDraft}
        problem={problem}
      />
      <span class="buttons">
        <button class="main" disabled={sending || !stress}>
          Compare rest and stress
        </button>
        {onClose && (
          <button type="button" class="plain" onClick={onClose}>
            Not now
          </button>
        )}
      </span>
    </form>
  );
}

/** The scans that were picked, or sent together, for a comparison. */
export function PickedPair() {
  const ids = useWatched(picked);
  const known = useWatched(volumes);
  const chosen = ids.flatMap(id => known.find(volume => volume.id === id) ?? []);
  const [a, b] = chosen;
  if (!a) return null;
  const close = () => (picked.value = []);
  return (
    <section class="picked" aria-label="Picked for a comparison">
      {b ? (
        <PairForm key={`${a.id} ${b.id}`} pair={[a, b]} onClose={close} />
      ) : (
        <p>
          <b>{cut(nameOf(a))}</b> is picked: pick the patient’s other scan below to compare rest and stress.{" "}
          <button type="button" class="plain" onClick={close}>
            Not now
          </button>
        </p>
      )}
    </section>
  );
}
