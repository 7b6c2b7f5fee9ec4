// Scans of one patient, and what is asked before they are compared over the years.

import { useState } from "preact/hooks";
import { type Volume, fieldOf, words } from "./api";
import { type Draft, ParameterForm, parameterSpecs, valuesOf } from "./parameters";
import { openSerial } from "./route";
import { acquisition, cut, isoDay, nameOf } from "./words";
import { fileSerial } from "./work";

interface Props {
  scans: Volume[];
  /** What was written before, and what was wrong with it. */
  draft: Draft;
  problem?: { field: string | null; text: string } | null;
  /** Whether the service has said that the scans are of two patients. */
  otherPatient?: boolean;
  onClose?: () => void;
}

export function SerialForm({ scans, draft: before, problem: first = null, otherPatient = false, onClose }: Props) {
  const [draft, setDraft] = useState<Draft>(before);
  const [problem, setProblem] = useState(first);
  const [left, setLeft] = useState<string[]>([]);
  const [sending, setSending] = useState(false);
  const taken = scans.filter(scan => !left.includes(scan.id));
  const [one] = taken;
  const send = async (event: Event) => {
    event.preventDefault();
    setProblem(null);
    setSending(true);
    try {
      const { normals, ...parameters } = valuesOf(draft, (await parameterSpecs()).serial);
      const given = typeof normals === "string" ? normals : null;
      openSerial((await fileSerial({ scans: taken, normals: given, parameters })).id);
    } catch (error) {
      setProblem({ field: fieldOf(error), text: words(error) });
    }
    setSending(false);
  };
  return (
    <form class="pair-form" aria-label="Compare over the years" onSubmit={event => void send(event)}>
      <fieldset>
        <legend>Which scans?</legend>
        {scans.map(scan => (
          <label key={scan.id} class="pair-choice">
            <input
              type="checkbox"
              checked={taken.includes(scan)}
              onChange={() =>
                setLeft(taken.includes(scan) ? [...left, scan.id] : left.filter(other => other !== scan.id))
              }
            />
            <span>
              <b title={nameOf(scan)}>{cut(nameOf(scan))}</b>
              <span class="quiet">
                {[isoDay(scan.dicom?.study_date ?? ""), ...acquisition(scan)].filter(Boolean).join(" · ")}
              </span>
            </span>
          </label>
        ))}
      </fieldset>
      {taken.length < 2 && <p class="quiet">Two scans or more are compared.</p>}
      {otherPatient && (
        <label class="inline">
          <input
            type="checkbox"
            checked={draft["same_patient"] === "true"}
            onChange={event => setDraft({ ...draft, same_patient: event.currentTarget.checked ? "true" : "" })}
          />
          These are scans of one patient
        </label>
      )}
      {one && <ParameterForm kind="serial" volume={one} draft={draft} onChange={setDraft} problem={problem} />}
      <span class="buttons">
        <button class="main" disabled={sending || taken.length < 2}>
          Compare over the years
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
