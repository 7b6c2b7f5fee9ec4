// One job: its state while it lasts, and why it failed.

import { useState } from "preact/hooks";
import { type Job, type Parameters, type Problem, isNoHeart, sentences, words } from "./api";
import { cancel, forget, isActive } from "./library";
import { open, openComparison, openResult, openSerial } from "./route";
import { ordinal, stage } from "./words";

const KINDS: Record<Job["kind"], string> = {
  model: "Model",
  segmentation: "Fit",
  beat: "Beat",
  comparison: "Rest and stress",
  serial: "Over the years",
  normals: "Normal limits",
  reading: "Reading",
};

/** Whether a fit failed that is fitted again from where a person shows the heart. */
export function asksForHeart({ kind, error }: Pick<Job, "kind" | "error">): boolean {
  return (kind === "segmentation" || kind === "beat") && error != null && isNoHeart(error);
}

/** What is wrong, and what to do. */
export function Trouble({ problem }: { problem: Problem | null | undefined }) {
  if (!problem) return null;
  const [detail, fix] = sentences(problem);
  return (
    <span class="error">
      {detail} {fix && <strong>{fix}</strong>}
    </span>
  );
}

export function JobLine({ job, onChange }: { job: Job; onChange?: ((job: Job) => void) | undefined }) {
  const [problem, setProblem] = useState("");
  const what = KINDS[job.kind];
  const read = job.parameters as unknown as Parameters;
  const act = (go: () => Promise<void>) => () => void go().catch((error: unknown) => setProblem(words(error)));
  const change = () => {
    if (job.kind === "comparison") openComparison(job.id);
    else if (job.kind === "serial") openSerial(job.id);
    else if (job.kind === "reading") openResult(job.volume ?? "", String(read["result"]));
    else if (onChange) onChange(job);
    else if (job.volume) open(job.volume, job.id);
  };
  return (
    <div class={`job ${job.state}`}>
      <span class="what">{what}</span>
      {job.state === "queued" && (
        <span>{job.queue_position ? `${ordinal(job.queue_position)} in the queue` : "queued"}</span>
      )}
      {job.state === "running" && (
        <>
          <progress value={job.progress} max={1} aria-label={`${what}: ${stage(job)}`} />
          <span>{stage(job)}</span>
        </>
      )}
      {job.state === "failed" && <Trouble problem={job.error} />}
      {job.state === "cancelled" && <span>cancelled</span>}
      {problem && <span class="error">{problem}</span>}
      {isActive(job) ? (
        <button
          type="button"
          class="plain"
          disabled={job.state === "running" && problem === "" && job.stage === "cancelling"}
          onClick={act(() => cancel(job))}>
          Cancel
        </button>
      ) : (
        job.state !== "succeeded" && (
          <>
            {job.kind !== "normals" && (
              <button type="button" onClick={change}>
                {asksForHeart(job) ? "Put centre and apex" : "Change and retry"}
              </button>
            )}
            <button type="button" class="plain" onClick={act(() => forget(job))}>
              Remove
            </button>
          </>
        )
      )}
    </div>
  );
}
