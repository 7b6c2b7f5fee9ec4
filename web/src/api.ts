// Requests to the service, with the key of the caller and with problems as the service words them.

import { at } from "./base";
import type {
  Beat,
  BeatSummary,
  Comparison,
  ComparisonSummary,
  Download,
  Job as AnyJob,
  Model,
  ModelSummary,
  Problem,
  Reading,
  ReadingSummary,
  Segmentation,
  SegmentationSummary,
  Serial,
  SerialSummary,
} from "./generated/openapi";
import { saveBlob } from "./save";
import { Watched } from "./state";

export type { JobState, Normals, Problem, Volume } from "./generated/openapi";
export type FileOfResult = Download;
/** Kinds of work on scans. */
export type Kind = "model" | "segmentation" | "beat" | "comparison" | "serial";
export type Job = AnyJob & { kind: Kind | "normals" | "reading" };

export type ParameterValue = string | number | boolean | (number | string)[];
export type Parameters = Record<string, ParameterValue | null>;

/** A model, a segmentation, a beat, a comparison, a serial comparison, a reading or a template; which, its id says. */
export type Result = Pick<
  Model | Segmentation | Beat | Comparison | Serial | Reading,
  "id" | "created_at" | "volume" | "files"
> & {
  parameters: Parameters;
  summary: Partial<
    ModelSummary & SegmentationSummary & BeatSummary & ComparisonSummary & SerialSummary & ReadingSummary
  >;
  links: Pick<Model["links"], "self" | "mesh"> & Partial<Model["links"] & Serial["links"] & Reading["links"]>;
};

export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

/** The service did not answer at all. */
export class Unreachable extends Error {}

const KEY = "ventriform.key";

/** The key of the caller, kept in this tab only. */
export const key = new Watched<string>(sessionStorage.getItem(KEY) ?? "");
/** Why a key is asked for; empty if none is. */
export const wanted = new Watched<string>("");
/** Whether the service answers. */
export const reachable = new Watched<boolean>(true);

/** Bytes that the service takes in one upload; null while that is not known. */
export const uploadLimit = new Watched<number | null>(null);

let waiting: (() => void)[] = [];

export function signIn(text: string): void {
  key.value = text.trim();
  if (key.value) sessionStorage.setItem(KEY, key.value);
  else sessionStorage.removeItem(KEY);
  wanted.value = "";
  const resume = waiting;
  waiting = [];
  for (const go of resume) go();
}

/** Resolves when the person has given another key. Requests that met a 401 wait here, so nothing is lost. */
export function nextKey(reason: string): Promise<void> {
  wanted.value = reason;
  return new Promise(resolve => waiting.push(resolve));
}

export function authorization(): Record<string, string> {
  return key.value ? { authorization: `Bearer ${key.value}` } : {};
}

/** What a body says is wrong; a body that is no problem document is described by its status. */
export function problemOf(status: number, text: string): Problem {
  try {
    const body = JSON.parse(text) as Partial<Problem>;
    if (typeof body.detail === "string") {
      return { type: "about:blank", title: "", status, detail: "", ...body };
    }
  } catch {
    // Not JSON: a proxy answered.
  }
  return { type: "about:blank", title: "", status, detail: `The service answered with status ${status}.` };
}

export interface CallOptions extends RequestInit {
  headers?: Record<string, string>;
}

/** Sends a request. Throws `ProblemError` on a refusal and `Unreachable` if nothing answers. */
export async function call(path: string, options: CallOptions = {}): Promise<Response> {
  for (;;) {
    const used = key.value;
    let answer: Response;
    try {
      answer = await fetch(at(path), { ...options, headers: { ...options.headers, ...authorization() } });
    } catch (error) {
      if (options.signal?.aborted) throw error;
      reachable.value = false;
      throw new Unreachable("The service does not answer. Nothing is lost: try again when it is back.");
    }
    reachable.value = true;
    // 304 answers a validator that the request has given.
    if (answer.ok || answer.status === 304) return answer;
    const problem = problemOf(answer.status, await answer.text());
    if (answer.status !== 401) throw new ProblemError(problem);
    if (key.value === used) {
      await nextKey(
        used
          ? "The service no longer accepts the key. Give another one; what you did is kept."
          : "This service asks for a key.",
      );
    }
  }
}

export async function get<T>(path: string, signal?: AbortSignal): Promise<T> {
  const answer = await call(path, signal ? { signal } : {});
  return (await answer.json()) as T;
}

export async function post<T>(path: string, body: unknown): Promise<T> {
  const answer = await call(path, {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
  });
  return (await answer.json()) as T;
}

/** One page of a list: its entries, where the list goes on, and what tells whether the page has changed. */
export interface Page<T> {
  items: T[];
  next: string | null;
  etag: string;
}

type ListQuery = Record<string, string | number>;

/** One page of a list. */
export async function page<T>(kind: string, query: ListQuery = {}): Promise<Page<T>> {
  return pageOf(kind, await call(pathOf(kind, query)));
}

/** One page of a list, or null if it is as it was when the service gave it that validator. */
export async function changedPage<T>(kind: string, query: ListQuery, etag: string): Promise<Page<T> | null> {
  const headers: Record<string, string> = etag ? { "if-none-match": etag } : {};
  const answer = await call(pathOf(kind, query), { headers });
  return answer.status === 304 ? null : pageOf(kind, answer);
}

function pathOf(kind: string, query: ListQuery): string {
  return `/v1/${kind}?${new URLSearchParams(Object.entries(query).map(([name, value]) => [name, String(value)]))}`;
}

async function pageOf<T>(kind: string, answer: Response): Promise<Page<T>> {
  const limit = /max-size=(\d+)/.exec(answer.headers.get("upload-limit") ?? "");
  if (limit) uploadLimit.value = Number(limit[1]);
  const body = (await answer.json()) as Record<string, unknown>;
  const next = (body["next_cursor"] as string | undefined) ?? null;
  return { items: body[kind] as T[], next, etag: answer.headers.get("etag") ?? "" };
}

/** Whether no heart was found: a person can show it in the picture. */
export function isNoHeart({ type }: Pick<Problem, "type">): boolean {
  return type.endsWith(":no-heart");
}

/**
 * What is wrong and what to do; the names that the service puts between backticks stand for themselves. Programs are told
 * where a heart was looked for, and are asked where it is, in millimetres; people see it.
 */
export function sentences({ type, detail, fix }: Pick<Problem, "type" | "detail" | "fix">): [string, string] {
  const plain = (text: string) => text.replaceAll("`", "");
  if (!isNoHeart({ type })) return [plain(detail), plain(fix ?? "")];
  const check = plain(fix ?? "").replace(/; if it is, .*$/, ".");
  return [
    plain(detail).replace(/, at \[[^\]]*\] mm \(LPS\),/, ""),
    `${check} If it is, put its centre and apex in the picture.`.trim(),
  ];
}

export function words(error: unknown): string {
  if (error instanceof ProblemError) return sentences(error.problem).join(" ").trim();
  return error instanceof Error ? error.message : String(error);
}

/** The parameter that a problem names, without the object it lies in. */
export function fieldOf(error: unknown): string | null {
  if (!(error instanceof ProblemError)) return null;
  return error.problem.field?.split(/[./]/).pop() ?? null;
}

/** Saves a file of the service under `name`. A link cannot carry a key, so the page fetches the file. */
export async function save(path: string, name: string): Promise<void> {
  const answer = await call(path);
  saveBlob(await answer.blob(), name);
}
