// Two scans of one patient, and what is asked before they are compared.

import { useEffect, useMemo, useState } from "preact/hooks";
import { type Result, type Volume, fieldOf, words } from "./api";
import { correctedFits, correctionsOf } from "./corrections";
import { beats, fits, loadResultsOf, volumes } from "./library";
import { areOfTwoPatients, picked, statedRole, stressOf } from "./pairing";
import { type Draft, ParameterForm, parameterSpecs, valuesOf } from "./parameters";
import { resultName, timeOf } from "./resultnames";
import { openComparison } from "./route";
import { useWatched } from "./state";
import { acquisition, cut, moment, nameOf, study } from "./words";
import { fileComparison } from "./work";

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
  useEffect(() => pair.forEach(volume => loadResultsOf(volume.id)), [a.id, b.id]);
  const known = useWatched(fits).length + useWatched(beats).length;
  const corrected = useMemo(() => pair.map(volume => correctedFits(volume.id)), [a.id, b.id, known]);
  // What was chosen of each scan: the id of a fit, or "" for a new one; nothing means the newest correction.
  const [fitOf, setFitOf] = useState<Record<string, string>>({});
  const chosenFit = (at: number): string | null => {
    const volume = pair[at];
    return (volume && fitOf[volume.id]) ?? corrected[at]?.[0]?.id ?? null;
  };
  const send = async (event: Event) => {
    event.preventDefault();
    if (!stress) return;
    setProblem(null);
    setSending(true);
    try {
      const { normals, ...parameters } = valuesOf(draft, (await parameterSpecs()).comparison);
      const [atStress, atRest] = stress === a.id ? [a, b] : [b, a];
      const ofScan = { stress: chosenFit(stress === a.id ? 0 : 1), rest: chosenFit(stress === a.id ? 1 : 0) };
      // Corrections that an earlier comparison had would go before those of the fit.
      for (const role of ["stress", "rest"] as const)
        if (ofScan[role]) for (const name of correctionsOf(role)) delete parameters[name];
      const job = await fileComparison({
        stress: atStress,
        rest: atRest,
        fits: { stress: ofScan.stress || null, rest: ofScan.rest || null },
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
        {pair.map((volume, at) => (
          <div key={volume.id}>
            <label class="pair-choice">
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
            <FitChoice
              name={nameOf(volume)}
              fits={corrected[at] ?? []}
              chosen={chosenFit(at) ?? ""}
              onChoice={id => setFitOf({ ...fitOf, [volume.id]: id })}
            />
          </div>
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

interface FitChoiceProps {
  name: string;
  fits: Result[];
  chosen: string;
  onChoice: (id: string) => void;
}

/** Which correction of a scan is kept; nothing where there is none. */
function FitChoice({ name, fits, chosen, onChoice }: FitChoiceProps) {
  if (fits.length === 0) return null;
  return (
    <label class="field">
      Placed as in
      <select
        aria-label={`${name}: placed as in`}
        value={chosen}
        onChange={event => onChoice(event.currentTarget.value)}>
        {fits.map(fit => (
          <option key={fit.id} value={fit.id}>
            {resultName(fit)}, {timeOf(fit, fits)}
          </option>
        ))}
        <option value="">no earlier fit</option>
      </select>
    </label>
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
