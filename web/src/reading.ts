// What a reader states of a result. What is not signed yet is kept in this tab, whatever view is shown meanwhile.

import type { Job, Result } from "./api";
import { get } from "./api";
import type { ReadingReport, ReadingRequest } from "./generated/openapi";
import { find, jobs, readings } from "./library";
import { Watched } from "./state";
import { moment } from "./words";
import { fileReading } from "./work";

export const SEGMENTS = 17;
/** Most letters of the texts. */
export const MOST_LETTERS = { impression: 4000, limits: 1000 };

/** Where scores stand: `scan` where there is one scan. */
export type ScoredScan = "stress" | "rest" | "scan";

/** A scan whose segments are scored, with the automatic scores; no such scores without normal limits. */
export interface Scored {
  scan: ScoredScan;
  automatic: (number | null)[] | null;
}

/** A result as it is read. */
export interface Readable {
  result: Result;
  scans: Scored[];
  /** Names of the segments. */
  segments: string[];
  /** Sentences for the impression. */
  offered: string[];
}

export type Quality = "" | "good" | "fair" | "poor";

/** A reading that is not signed yet. */
export interface ReadingDraft {
  /** The reading that it replaces. */
  amends: string | null;
  scores: Partial<Record<ScoredScan, number[]>>;
  /** Whether the scores are signed, too. */
  isScored: boolean;
  quality: Quality;
  limits: string;
  impression: string;
  /** Whether the structured report is sent to an archive. */
  isSent: boolean;
  isChanged: boolean;
  /** The job that signs it. */
  job: string | null;
}

/** What is not signed yet, by the ids of the results. */
export const drafts = new Watched<ReadonlyMap<string, ReadingDraft>>(new Map());

const stay = (event: BeforeUnloadEvent) => event.preventDefault();
// Only while something would be lost: a page that may ask is not kept for the way back.
drafts.watch(() => {
  const ask = [...drafts.value.values()].some(draft => draft.isChanged) ? addEventListener : removeEventListener;
  ask("beforeunload", stay);
});

export function keepDraft(result: string, draft: ReadingDraft | null): void {
  const next = new Map(drafts.value);
  if (draft) next.set(result, draft);
  else next.delete(result);
  drafts.value = next;
}

// What is signed is no draft any more once its reading is there, also if its panel is not shown.
function dropSigned(): void {
  for (const [result, { job: id }] of drafts.value) {
    const job = id && jobs.value.find(one => one.id === id);
    if (job && job.state === "succeeded" && job.reading && find(job.reading)) keepDraft(result, null);
  }
}
for (const list of [jobs, readings, drafts]) list.watch(dropSigned);

const zeros = (): number[] => new Array<number>(SEGMENTS).fill(0);

/** A reading to begin with. Where nothing was scored, no scores are signed until somebody scores. */
export function firstDraft({ scans }: Readable): ReadingDraft {
  return {
    amends: null,
    scores: Object.fromEntries(
      scans.map(({ scan, automatic }) => [scan, automatic?.map(score => score ?? 0) ?? zeros()]),
    ),
    isScored: scans.some(({ automatic }) => automatic !== null),
    quality: "",
    limits: "",
    impression: "",
    isSent: false,
    isChanged: false,
    job: null,
  };
}

/** What amends a reading: all that it says. */
export async function draftFrom(readable: Readable, reading: Result): Promise<ReadingDraft> {
  const report = await get<ReadingReport>(reading.links.report ?? "");
  const first = firstDraft(readable);
  const read = Object.fromEntries(report.scores.map(({ scan, segments }) => [scan, segments]));
  return {
    ...first,
    amends: reading.id,
    scores: { ...first.scores, ...read },
    isScored: report.scores.length > 0,
    quality: (report.quality ?? "") as Quality,
    limits: report.limits ?? "",
    impression: report.impression ?? "",
  };
}

/** Signs it: the job that writes the reading. `to`: the archive that the structured report is sent to. */
export function sign(readable: Readable, draft: ReadingDraft, reader: string, to: string): Promise<Job> {
  const order: Partial<ReadingRequest> = { result: readable.result.id, reader };
  if (draft.isScored) {
    const { stress, rest, scan } = draft.scores;
    if (stress) order.stress_scores = stress;
    if (rest) order.rest_scores = rest;
    if (scan) order.scores = scan;
  }
  if (draft.quality) order.quality = draft.quality;
  if (draft.limits.trim()) order.limits = draft.limits.trim();
  if (draft.impression.trim()) order.impression = draft.impression.trim();
  if (draft.amends) order.amends = draft.amends;
  if (draft.isSent) Object.assign(order, { send: ["measurements.dcm"], to: to.trim() });
  return fileReading(order);
}

/** The sum of scores; null unless there are some. */
export function sumOf(scores: (number | null)[] | null | undefined): number | null {
  return scores ? scores.reduce<number>((sum, score) => sum + (score ?? 0), 0) : null;
}

/** What the score of a segment at stress exceeds that at rest by. */
export const exceeds = (stress: number, rest: number): number => Math.max(0, stress - rest);

/** A name of DICOM as it is read: family name first. */
export function personName(name: string): string {
  const [family = "", given = "", middle = "", prefix = "", suffix = ""] = name.split("^");
  return [family, [given, middle, prefix, suffix].filter(Boolean).join(" ")].filter(Boolean).join(", ");
}

/** Who read, and when. */
export function readBy({ summary }: Result): string {
  return `Read by ${personName(summary.reader ?? "")} on ${moment(summary.read_at ?? "")}`;
}

/** The sentence that is a line of the text, or the text with it. */
export const holds = (text: string, sentence: string): boolean => text.split("\n").includes(sentence);

export function withSentence(text: string, sentence: string): string {
  return text.trim() ? `${text.trimEnd()}\n${sentence}` : sentence;
}

export function withoutSentence(text: string, sentence: string): string {
  return text
    .split("\n")
    .filter(line => line !== sentence)
    .join("\n");
}

/** A text that this tab remembers until it is closed. */
export function remembered(name: string): [string, (text: string) => void] {
  const place = `ventriform.${name}`;
  return [sessionStorage.getItem(place) ?? "", text => sessionStorage.setItem(place, text)];
}
