// What of a study is compared with the patient's earlier studies: results, jobs, and the button that compares.

import { useMemo, useState } from "preact/hooks";
import { type Volume, words } from "./api";
import { JobLine } from "./jobline";
import { jobs, scansOf, serials, serialsOf } from "./library";
import { type Years, yearsOf } from "./overyears";
import { SerialLink } from "./resultlink";
import { openSerial } from "./route";
import { useWatched } from "./state";
import { fileSerial } from "./work";

interface Props {
  /** The scans of the study. */
  scans: Volume[];
  /** The patient's studies before it, the latest first. */
  before: Volume[][];
  /** Whether all scans of the patient are known. */
  isComplete: boolean;
}

export function OverTheYears({ scans, before, isComplete }: Props) {
  const made = useWatched(serials);
  const ids = scans.map(scan => scan.id);
  const under = useWatched(jobs).filter(
    job => job.kind === "serial" && job.state !== "succeeded" && scansOf(job).some(id => ids.includes(id)),
  );
  const { years, why } = yearsOf(scans, before);
  const results = useMemo(() => serialsOf(...ids), [made, ids.join()]);
  const isMade = ({ scans: own }: Years) =>
    results.some(result => {
      const of = scansOf(result);
      return of.length === own.length && own.every(scan => of.includes(scan.id));
    });
  const open = isComplete ? years.filter(one => !isMade(one)) : [];
  if (results.length + under.length + open.length === 0 && !(isComplete && why.length > 0)) return null;
  return (
    <div class="years">
      {results.map(result => (
        <SerialLink key={result.id} made={result} />
      ))}
      {under.map(job => (
        <JobLine key={job.id} job={job} />
      ))}
      {open.map(one => (
        <Offered key={one.role ?? ""} years={one} isAlone={years.length === 1} />
      ))}
      {isComplete && why.length > 0 && <p class="quiet">{why.join(" ")}</p>}
    </div>
  );
}

/** The button that compares, and which scans it takes. */
function Offered({ years: { scans, role, said }, isAlone }: { years: Years; isAlone: boolean }) {
  const [problem, setProblem] = useState("");
  const [sending, setSending] = useState(false);
  const compare = () => {
    setProblem("");
    setSending(true);
    fileSerial({ scans, normals: null, parameters: {} })
      .then(
        job => openSerial(job.id),
        error => setProblem(words(error)),
      )
      .finally(() => setSending(false));
  };
  return (
    <div class="offered">
      <button type="button" disabled={sending} onClick={compare}>
        Compare over the years{isAlone ? "" : `: ${role ?? "neither rest nor stress"}`}
      </button>
      <span class="quiet">{said.join(" ")}</span>
      {problem && (
        <span class="error" role="alert">
          {problem}
        </span>
      )}
    </div>
  );
}
