// A comparison that is not there yet: how far it is, or why it failed and what can be changed.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { type Job, get, sentences, words } from "../api";
import { JobLine, Trouble } from "../jobline";
import { isActive, jobs, madeBy, put, watchActive } from "../library";
import type { Spec } from "../parameters";
import { type Route, home } from "../route";
import { useWatched } from "../state";

/** What went wrong instead of a view. */
export function NotShown({ title, problem }: { title: string; problem: string }) {
  return (
    <div class="pad">
      <h1 class="hidden">{title}</h1>
      <p class="error" role="alert">
        {problem}
      </p>
      <button type="button" onClick={home}>
        Back to the list
      </button>
    </div>
  );
}

/** Whether a job failed because the headers name two patients: a form can state that they are one. */
export const isOfOtherPatient = ({ error }: Job): boolean => error?.type.endsWith("other-patient") ?? false;

/** What the job says is wrong with a field of a form; what is wrong with none of them is said once, above the form. */
export function problemIn({ error }: Job, specs: Spec[]): { field: string; text: string } | null {
  const field = error?.field?.split(/[./]/).pop();
  const text = error ? sentences(error).join(" ").trim() : "";
  return text && field && specs.some(spec => spec.name === field) ? { field, text } : null;
}

interface Props {
  /** The job. */
  id: string;
  title: string;
  /** The view of what it makes. */
  view: Route["view"];
  /** The form that asks for it again. */
  again: (ended: Job) => ComponentChildren;
}

export function Working({ id, title, view, again }: Props) {
  const known = useWatched(jobs).find(job => job.id === id);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    if (known) return;
    get<Job>(`/v1/jobs/${id}`).then(
      job => {
        put(job);
        watchActive();
      },
      error => setProblem(words(error)),
    );
  }, [id]);
  const made = known?.state === "succeeded" ? madeBy(known) : null;
  useEffect(() => {
    // The job's address is not one to come back to.
    if (made) location.replace(`#/${view}/${made}`);
  }, [made]);
  if (problem) return <NotShown title={title} problem={problem} />;
  if (!known) return <p class="quiet pad">Looking for the comparison …</p>;
  const ended = isActive(known) || known.state === "succeeded" ? null : known;
  return (
    <div class="list working">
      <h1>{title}</h1>
      {!ended && <JobLine job={known} />}
      {ended && (
        <section class="picked" aria-label="What can be changed">
          {ended.state === "cancelled" ? (
            <p>The comparison was cancelled.</p>
          ) : (
            <p role="alert">
              <Trouble problem={isOfOtherPatient(ended) && ended.error ? { ...ended.error, fix: null } : ended.error} />
            </p>
          )}
          {again(ended)}
        </section>
      )}
      <button type="button" onClick={home}>
        Back to the list
      </button>
    </div>
  );
}
