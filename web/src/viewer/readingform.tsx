// What a reader states: scores, quality, limits, impression and name; and signing it.

import { useState } from "preact/hooks";
import { type Job, type Result, fieldOf, sentences, words } from "../api";
import { Confirm } from "../confirm";
import { isActive, jobs, loadReadings, loadResult } from "../library";
import {
  MOST_LETTERS,
  type Quality,
  type Readable,
  type ReadingDraft,
  holds,
  keepDraft,
  readBy,
  remembered,
  sign,
  withSentence,
  withoutSentence,
} from "../reading";
import { useWatched } from "../state";
import { ScoreTable } from "./scoretable";

interface Told {
  field: string | null;
  text: string;
}

interface Props {
  readable: Readable;
  draft: ReadingDraft;
  /** The newest reading of the result. */
  newest: Result | undefined;
  /** The job that signs it, once it is signed. */
  job: Job | undefined;
  onClose: () => void;
}

export function ReadingForm({ readable, draft, newest, job, onClose }: Props) {
  const { result } = readable;
  const [[family, given], setReader] = useState(() => readerParts(remembered("reader")[0]));
  const [archive, setArchive] = useState(() => remembered("archive")[0]);
  const [problem, setProblem] = useState<Told | null>(null);
  const [isSending, setSending] = useState(false);
  const change = (part: Partial<ReadingDraft>) =>
    keepDraft(result.id, { ...draft, job: null, isChanged: true, ...part });
  const isReadMeanwhile = newest !== undefined && newest.id !== draft.amends;
  const isUnderWay = isSending || (job !== undefined && (isActive(job) || job.state === "succeeded"));
  const failure = job?.error ? { field: fieldIn(job.error.field), text: sentences(job.error).join(" ").trim() } : null;
  const told = problem ?? failure;
  const error = (field: string) =>
    told?.field === field && (
      <p class="error" role="alert" id={`reading-${field}`}>
        {told.text}
      </p>
    );
  const wrong = (field: string) =>
    told?.field === field ? ({ "aria-invalid": "true", "aria-describedby": `reading-${field}` } as const) : {};

  const go = async () => {
    if (!family.trim()) return setProblem({ field: "reader", text: "Give the family name of who reads." });
    if (draft.isSent && !archive.trim()) return setProblem({ field: "to", text: "Give the name of the archive." });
    setProblem(null);
    setSending(true);
    const reader = [family, given]
      .map(part => part.trim())
      .join("^")
      .replace(/\^$/, "");
    remembered("reader")[1](reader);
    if (draft.isSent) remembered("archive")[1](archive.trim());
    try {
      const filed = await sign(readable, draft, reader, archive);
      keepDraft(result.id, { ...draft, isChanged: true, job: filed.id });
    } catch (error) {
      setProblem({ field: fieldOf(error), text: words(error) });
      if (fieldOf(error) === "amends") await showNewest(error).catch(() => undefined);
    }
    setSending(false);
  };
  return (
    <div class="reading-form">
      <details open>
        <summary>Scores</summary>
        <p class="quiet">
          0 normal to 4 no uptake. A digit sets a score and goes on to the next segment; arrow keys move.
          {readable.scans.every(({ automatic }) => !automatic) &&
            " Without normal limits there are no automatic scores."}
        </p>
        <ScoreTable
          scans={readable.scans}
          segments={readable.segments}
          scores={draft.scores}
          onScore={(scan, segment, score) =>
            change({ isScored: true, scores: { ...draft.scores, [scan]: draft.scores[scan]?.with(segment, score) } })
          }
        />
        <label class="inline">
          <input
            type="checkbox"
            checked={draft.isScored}
            onChange={event => change({ isScored: event.currentTarget.checked })}
          />
          Sign these scores
        </label>
        {["scores", "stress_scores", "rest_scores"].map(error)}
      </details>
      <label class="field">
        <span>Quality of the study</span>
        <select
          value={draft.quality}
          {...wrong("quality")}
          onChange={event => change({ quality: event.currentTarget.value as Quality })}>
          <option value="">not stated</option>
          <option value="good">good</option>
          <option value="fair">fair</option>
          <option value="poor">poor</option>
        </select>
      </label>
      {error("quality")}
      <label class="field">
        <span>Limits</span>
        <input
          value={draft.limits}
          maxLength={MOST_LETTERS.limits}
          autocomplete="off"
          {...wrong("limits")}
          onInput={event => change({ limits: event.currentTarget.value })}
        />
      </label>
      {error("limits")}
      <Sentences
        offered={readable.offered}
        impression={draft.impression}
        onImpression={impression => change({ impression })}
      />
      <label class="field">
        <span>Impression</span>
        <textarea
          rows={Math.min(12, Math.max(5, 2 * draft.impression.split("\n").length))}
          maxLength={MOST_LETTERS.impression}
          value={draft.impression}
          {...wrong("impression")}
          onInput={event => change({ impression: event.currentTarget.value })}
        />
      </label>
      {error("impression")}
      <div class="reader">
        <label class="field">
          <span>Reader, family name</span>
          <input
            value={family}
            autocomplete="off"
            {...wrong("reader")}
            onInput={event => setReader([event.currentTarget.value.replaceAll("^", " "), given])}
          />
        </label>
        <label class="field">
          <span>Given name</span>
          <input
            value={given}
            autocomplete="off"
            onInput={event => setReader([family, event.currentTarget.value.replace(/\^/, " ")])}
          />
        </label>
      </div>
      {error("reader")}
      <SendTo
        isSent={draft.isSent}
        archive={archive}
        wrong={wrong("to")}
        onSent={isSent => change({ isSent })}
        onArchive={setArchive}
      />
      {error("to") || error("send")}
      {isReadMeanwhile && (
        <p class="warning" role="alert">
          This result was read meanwhile. {readBy(newest)}.{" "}
          <button type="button" onClick={() => change({ amends: newest.id })}>
            Amend that reading
          </button>
        </p>
      )}
      {told && !FIELDS.includes(told.field ?? "") && !(told.field === "amends" && isReadMeanwhile) && (
        <p class="error" role="alert">
          {told.text}
        </p>
      )}
      <div class="buttons">
        <button type="button" class="main" disabled={isUnderWay || isReadMeanwhile} onClick={() => void go()}>
          {draft.amends ? "Sign the amendment" : "Sign"}
        </button>
        <button type="button" class="plain" onClick={onClose}>
          Close
        </button>
        {draft.isChanged && !isUnderWay && (
          <Confirm
            question="Discard what is not signed?"
            act={async () => {
              keepDraft(result.id, null);
              onClose();
            }}>
            Discard
          </Confirm>
        )}
      </div>
      <p class="quiet" role="status">
        {isUnderWay ? "Being signed …" : draft.isChanged ? "Not signed yet." : ""}
      </p>
    </div>
  );
}

/** Fields with a place of their own for what is wrong with them. */
const FIELDS = ["scores", "stress_scores", "rest_scores", "quality", "limits", "impression", "reader", "to", "send"];

const fieldIn = (field: string | null | undefined): string | null => field?.split(/[./]/).pop() ?? null;

function readerParts(name: string): [string, string] {
  const [family = "", ...others] = name.split("^");
  return [family, others.join("^")];
}

/** The reading that was signed meanwhile, which the service names, also where it is too old for the list. */
async function showNewest(error: unknown): Promise<void> {
  await loadReadings();
  const [id] = /rdg_[0-9a-f]+/.exec(words(error)) ?? [];
  if (id) await loadResult(id);
}

interface SentencesProps {
  offered: string[];
  impression: string;
  onImpression: (text: string) => void;
}

/** Sentences made of the figures: a press puts one into the impression, another takes it out. */
function Sentences({ offered, impression, onImpression }: SentencesProps) {
  if (offered.length === 0) return <p class="quiet">The figures offer no sentences for the impression.</p>;
  const missing = offered.filter(sentence => !holds(impression, sentence));
  return (
    <fieldset class="sentences">
      <legend>Sentences from the figures</legend>
      {offered.map(sentence => {
        const isTaken = holds(impression, sentence);
        return (
          <button
            key={sentence}
            type="button"
            aria-pressed={isTaken}
            onClick={() =>
              onImpression(isTaken ? withoutSentence(impression, sentence) : withSentence(impression, sentence))
            }>
            {sentence}
          </button>
        );
      })}
      {offered.length > 1 && (
        <button
          type="button"
          class="plain"
          disabled={missing.length === 0}
          onClick={() => onImpression(missing.reduce(withSentence, impression))}>
          Take all
        </button>
      )}
    </fieldset>
  );
}

interface SendProps {
  isSent: boolean;
  archive: string;
  wrong: object;
  onSent: (isSent: boolean) => void;
  onArchive: (archive: string) => void;
}

/** The service does not list its archives: a name is given, and those that jobs name are offered. */
function SendTo({ isSent, archive, wrong, onSent, onArchive }: SendProps) {
  const all = useWatched(jobs);
  const known = all.flatMap(({ deliveries, source }) => [
    ...(deliveries ?? []).map(({ to }) => to),
    ...(source?.archive ? [source.archive] : []),
  ]);
  return (
    <>
      <label class="inline">
        <input type="checkbox" checked={isSent} onChange={event => onSent(event.currentTarget.checked)} />
        Send to the PACS
      </label>
      {isSent && (
        <label class="field">
          <span>Name of the archive</span>
          <input
            value={archive}
            list="reading-archives"
            autocomplete="off"
            spellcheck={false}
            {...wrong}
            onInput={event => onArchive(event.currentTarget.value)}
          />
          <datalist id="reading-archives">
            {[...new Set(known)].map(name => (
              <option key={name} value={name} />
            ))}
          </datalist>
        </label>
      )}
    </>
  );
}
