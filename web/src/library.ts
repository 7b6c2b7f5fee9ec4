// What is stored, as far as this page has read it, and the states of jobs as they change.

import { at } from "./base";
import {
  type Job,
  type Normals,
  type Page,
  type Result,
  type Volume,
  authorization,
  call,
  changedPage,
  get,
  page,
  reachable,
  words,
} from "./api";
import { listed, readList, trouble, volumes } from "./scanlist";
import { Watched } from "./state";
import { tellTabs } from "./tabs";
import { isBeat, isComparison, isFit, isReading, isSerial, newest } from "./words";

export { trouble, volumes };
export const models = new Watched<Result[]>([]);
export const fits = new Watched<Result[]>([]);
export const beats = new Watched<Result[]>([]);
export const comparisons = new Watched<Result[]>([]);
export const serials = new Watched<Result[]>([]);
export const readings = new Watched<Result[]>([]);
export const normals = new Watched<Normals[]>([]);
export const templates = new Watched<Result[]>([]);
export const jobs = new Watched<Job[]>([]);
export const loaded = new Watched<boolean>(false);
/** Whether there are more jobs or results than were read. */
const partial = new Watched<boolean>(false);

/** Reads the newest of everything. */
export async function refresh(): Promise<void> {
  const known = {
    jobs: jobs.value,
    models: models.value,
    fits: fits.value,
    beats: beats.value,
    comparisons: comparisons.value,
    serials: serials.value,
    readings: readings.value,
  };
  try {
    // The jobs first: the results of those that had ended are then in the lists, which are read after them.
    const j = await page<Job>("jobs", { limit: 100 });
    const [, m, s, b, c, y, r, t, n] = await Promise.all([
      readList(),
      page<Result>("models", { limit: 100 }),
      page<Result>("segmentations", { limit: 100 }),
      page<Result>("beats", { limit: 100 }),
      page<Result>("comparisons", { limit: 100 }),
      page<Result>("serials", { limit: 100 }),
      page<Result>("readings", { limit: 100 }),
      page<Result>("templates", { limit: 100 }),
      page<Normals>("normals", { limit: 100 }),
    ]);
    jobs.value = renewed(known.jobs, jobs.value, j).map(latest(jobs.value));
    models.value = renewed(known.models, models.value, m);
    fits.value = renewed(known.fits, fits.value, s);
    beats.value = renewed(known.beats, beats.value, b);
    comparisons.value = renewed(known.comparisons, comparisons.value, c);
    serials.value = renewed(known.serials, serials.value, y);
    readings.value = renewed(known.readings, readings.value, r);
    templates.value = t.items;
    normals.value = n.items;
    partial.value = Boolean(j.next || m.next || s.next || b.next || c.next || y.next || r.next);
    trouble.value = "";
    loaded.value = true;
  } catch (error) {
    trouble.value = words(error);
  }
  watchActive();
}

/**
 * The list `now` with the newest as they were read: with what this page added and without what it erased while the
 * answer was on its way, and with what is older than the page that was read.
 */
function renewed<T extends { id: string; created_at: string }>(before: T[], now: T[], { items, next }: Page<T>): T[] {
  const ids = (list: T[]) => new Set(list.map(item => item.id));
  const [old, kept, answered] = [ids(before), ids(now), ids(items)];
  const last = items.at(-1);
  const isOlder = (item: T) => next !== null && last !== undefined && newest(last, item) <= 0;
  const others = now.filter(item => !answered.has(item.id) && (!old.has(item.id) || isOlder(item)));
  return [...others, ...items.filter(item => kept.has(item.id) || !old.has(item.id))].sort(newest);
}

/** The newer state of a job: its events may have overtaken the list. */
function latest(now: Job[]): (job: Job) => Job {
  return job => now.find(other => other.id === job.id && other.revision > job.revision) ?? job;
}

/** Reads one scan with everything made of it, also what is too old for the first pages. */
export async function loadScan(id: string): Promise<Volume> {
  const volume = await get<Volume>(`/v1/volumes/${id}`);
  if (!volumes.value.some(other => other.id === id)) volumes.value = [...volumes.value, volume];
  await loadMade(id);
  return volume;
}

/** Reads the jobs on a scan, and what they made. */
async function loadMade(id: string): Promise<void> {
  const own = await page<Job>("jobs", { volume: id, limit: 100 });
  for (const job of own.items.reverse()) put(job);
  const missing = own.items.flatMap(job => (job.state === "succeeded" ? [madeBy(job)] : []));
  await Promise.all([...new Set(missing)].map(result => (result && !find(result) ? loadResult(result) : null)));
}

const complete = new Set<string>();

/** Reads the results of a scan that are too old for the first pages, once. */
export function loadResultsOf(id: string): void {
  if (!partial.value || complete.has(id)) return;
  complete.add(id);
  void loadMade(id).catch(() => complete.delete(id));
}

/** The results of scans: their collection, and what of it was read. */
const KINDS = [
  ["segmentations", fits],
  ["models", models],
  ["beats", beats],
  ["comparisons", comparisons],
  ["serials", serials],
  ["readings", readings],
] as const;

function kindOf(id: string): (typeof KINDS)[number] {
  return KINDS[isFit(id) ? 0 : isBeat(id) ? 2 : isComparison(id) ? 3 : isSerial(id) ? 4 : isReading(id) ? 5 : 1];
}

/** What a job made, once it has succeeded. */
export function madeBy(job: Job): string | null {
  return job.segmentation ?? job.model ?? job.beat ?? job.comparison ?? job.serial ?? job.reading ?? null;
}

export function find(id: string): Result | undefined {
  return kindOf(id)[1].value.find(result => result.id === id);
}

export async function loadResult(id: string): Promise<Result | undefined> {
  const [kind, list] = kindOf(id);
  try {
    const result = await get<Result>(`/v1/${kind}/${id}`);
    list.value = [result, ...list.value.filter(other => other.id !== id)];
    return result;
  } catch {
    return undefined; // It was erased.
  }
}

/** What was made of a scan by itself. */
export function resultsOf(volume: string): Result[] {
  const own = [...beats.value, ...fits.value, ...models.value].filter(result => result.volume === volume);
  return own.sort(newest);
}

export function isActive(job: Job): boolean {
  return job.state === "queued" || job.state === "running";
}

/** Puts a newer state of a job in the list. */
export function put(job: Job): void {
  const at = jobs.value.findIndex(other => other.id === job.id);
  const known = jobs.value[at];
  if (known && known.revision > job.revision) return;
  jobs.value = known ? jobs.value.with(at, job) : [job, ...jobs.value];
  if (known?.state !== job.state && job.state === "succeeded") {
    const made = madeBy(job);
    if (made && !find(made)) void loadResult(made);
    if (job.kind === "normals") void loadNormals();
  }
}

/** Reads the list of normal limits again. */
export async function loadNormals(): Promise<void> {
  try {
    normals.value = (await page<Normals>("normals", { limit: 100 })).items;
  } catch (error) {
    trouble.value = words(error);
  }
}

export async function eraseNormals(id: string): Promise<void> {
  await call(`/v1/normals/${id}`, { method: "DELETE" });
  normals.value = normals.value.filter(limits => limits.id !== id);
}

/** The comparisons in which a scan takes part, at stress or at rest. */
export function comparisonsOf(volume: string): Result[] {
  return comparisons.value.filter(made => made.volume === volume || made.parameters["rest"] === volume).sort(newest);
}

/** The ids of the scans that a serial comparison, or its job, is of. */
export function scansOf({ volume, parameters }: { volume?: string | null; parameters: object }): string[] {
  const { others } = parameters as { others?: unknown };
  return [volume ?? "", ...(typeof others === "string" ? others.split(",") : [])].filter(Boolean);
}

/** The serial comparisons in which one of these scans takes part. */
export function serialsOf(...volumes: string[]): Result[] {
  return serials.value.filter(made => scansOf(made).some(id => volumes.includes(id))).sort(newest);
}

/** The readings of a result, the newest first. */
export function readingsOf(result: string): Result[] {
  return readings.value.filter(reading => reading.summary.result === result).sort(newest);
}

/** Reads the newest readings again: somebody else may have signed. */
export async function loadReadings(): Promise<void> {
  const before = readings.value;
  readings.value = renewed(before, readings.value, await page<Result>("readings", { limit: 100 }));
}

// Browsers open at most six connections to a host, so few jobs are followed by events; the list tells of the others.
const STREAMS = 2;
const followed = new Set<string>();
let timer: ReturnType<typeof setTimeout> | undefined;

/** Follows what has not ended yet. */
export function watchActive(): void {
  const active = jobs.value.filter(isActive).sort((a, b) => rank(a) - rank(b));
  for (const job of active) {
    if (followed.size >= STREAMS) break;
    if (!followed.has(job.id)) void follow(job);
  }
  clearTimeout(timer);
  const wait = active.length > followed.size ? 2000 : reachable.value ? 15_000 : 3000;
  timer = setTimeout(() => void refreshJobs(), wait);
}

function rank(job: Job): number {
  return job.state === "running" ? 0 : (job.queue_position ?? 1);
}

async function refreshJobs(): Promise<void> {
  if (document.hidden) {
    timer = setTimeout(() => void refreshJobs(), 5000);
    return;
  }
  if (!reachable.value || !loaded.value) return refresh();
  try {
    await readJobs();
  } catch (error) {
    trouble.value = words(error);
  }
  watchActive();
}

async function readJobs(): Promise<void> {
  const before = jobs.value;
  const read = await page<Job>("jobs", { limit: 100 });
  for (const job of [...read.items].reverse()) put(job);
  jobs.value = renewed(before, jobs.value, { ...read, items: read.items.map(latest(jobs.value)) });
}

const validators = new Map<string, string>();

/** Reads the newest jobs again, and with `results` what was made, where it has changed. */
export async function refreshMade(results: boolean): Promise<void> {
  if (!loaded.value) return;
  await readJobs();
  watchActive();
  if (!results) return;
  for (const [kind, list] of KINDS) {
    const before = list.value;
    const read = await changedPage<Result>(kind, { limit: 100 }, validators.get(kind) ?? "");
    if (!read) continue;
    validators.set(kind, read.etag);
    list.value = renewed(before, list.value, read);
  }
}

/** Reads the events of a job until it ends. `EventSource` cannot send a key, so the stream is read by fetch. */
async function follow(job: Job): Promise<void> {
  followed.add(job.id);
  try {
    const answer = await fetch(at(job.links.events), { headers: { ...authorization(), accept: "text/event-stream" } });
    if (!answer.ok || !answer.body) throw new Error("no events");
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let text = "";
    for (;;) {
      const { value, done } = await reader.read();
      if (done) break;
      text += value;
      const events = text.split("\n\n");
      text = events.pop() ?? "";
      for (const event of events) {
        const data = event
          .split("\n")
          .filter(line => line.startsWith("data:"))
          .map(line => line.slice(5))
          .join("\n");
        if (data) put(JSON.parse(data) as Job);
      }
    }
  } catch {
    // The list of jobs tells the state; the next round follows the job again.
    await new Promise(resolve => setTimeout(resolve, 1500));
  }
  followed.delete(job.id);
  watchActive();
}

export async function cancel(job: Job): Promise<void> {
  await call(job.links.self, { method: "DELETE" });
  const now = await get<Job>(job.links.self).catch(() => null);
  if (now) put(now);
  watchActive();
  tellTabs();
}

export async function forget(job: Job): Promise<void> {
  await call(`${job.links.self}${job.state === "cancelled" ? "?erase=true" : ""}`, { method: "DELETE" });
  jobs.value = jobs.value.filter(other => other.id !== job.id);
  tellTabs();
}

export async function eraseResult(id: string): Promise<void> {
  const [kind, list] = kindOf(id);
  await call(`/v1/${kind}/${id}`, { method: "DELETE" });
  list.value = list.value.filter(result => result.id !== id);
  tellTabs();
}

export async function eraseVolume(id: string): Promise<void> {
  await call(`/v1/volumes/${id}?cascade=true`, { method: "DELETE" });
  volumes.value = volumes.value.filter(volume => volume.id !== id);
  listed.value = listed.value.filter(volume => volume.id !== id);
  tellTabs();
  await refreshMade(true);
}
