// The list of scans: searched, filtered and ordered by the service over all that it stores, read page by page, and
// looked at again while it is open, so that it shows what arrives and what goes.

import { type Page, Unreachable, type Volume, changedPage, fieldOf, get, page, reachable, words } from "./api";
import type { Role } from "./pairing";
import { Watched } from "./state";
import { onTold, tellTabs } from "./tabs";
import { isoDay } from "./words";

export type Show = "all" | "segmentation" | "beat" | "model" | "comparison" | "nothing" | "unfinished" | "failed";
export type Order = "newest" | "study_date" | "patient" | "name" | "largest";

/** What of the list is asked for. */
export interface Asked {
  search: string;
  show: Show;
  role: Role | "";
  modality: string;
  /** Days of studies, YYYY-MM-DD; empty for any. */
  from: string;
  to: string;
  order: Order;
}

export const WHOLE: Asked = { search: "", show: "all", role: "", modality: "", from: "", to: "", order: "newest" };

/** What is being received from other systems. */
export interface Receiving {
  series: number;
  objects: number;
  bytes: number;
}

/** The scans that were read, not in the order of the list. */
export const volumes = new Watched<Volume[]>([]);
/** What went wrong last, in words; empty if nothing did. */
export const trouble = new Watched<string>("");
export const asked = new Watched<Asked>(WHOLE);
/** The rows that were read, in the order of the list. */
export const listed = new Watched<Volume[]>([]);
/** Where the list goes on; null at its end. */
export const more = new Watched<string | null>(null);
/** What has arrived since and is not among the rows yet. */
export const arrived = new Watched<Volume[]>([]);
export const receiving = new Watched<Receiving | null>(null);

const PAGE = 30;
/** Most rows that the service gives at once. */
const MOST_ROWS = 100;
/** Pauses between two looks at the list, ms; a search reads all scans. */
const PAUSE = 5000;
const PAUSE_OF_SEARCH = 15_000;
/** Looks between two at the results, which jobs tell of unless they were erased. */
const LOOKS_PER_RESULTS = 6;

/** Whether the list is all there is, the newest first. */
export function isWhole(of: Asked): boolean {
  return (Object.keys(WHOLE) as (keyof Asked)[]).every(name => of[name] === WHOLE[name]);
}

function query(of: Asked, limit: number): Record<string, string | number> {
  // The name of a scan that has none is made of its id.
  const search = of.search.trim().replace(/^scan (?=[0-9a-f]{8}$)/i, "");
  const ofJobs = of.show === "failed" || of.show === "unfinished";
  const given = {
    search,
    made: of.show === "all" || ofJobs ? "" : of.show,
    job: ofJobs ? of.show : "",
    rest_or_stress: of.role,
    modality: of.modality,
    study_date_from: of.from,
    study_date_to: of.to,
    order: of.order === "newest" ? "" : of.order,
  };
  return { limit, ...Object.fromEntries(Object.entries(given).filter(([, value]) => value)) };
}

/** Scans that this tab has stored: they are shown as soon as the service lists them. */
const stored = new Set<string>();
let turn = 0;
let validator = "";

/** Reads the list from its beginning. Scans that this tab stored or erased meanwhile are so. */
export async function readList(): Promise<void> {
  const [own, before] = [++turn, listed.value];
  const answer = await page<Volume>("volumes", query(asked.value, PAGE));
  if (own !== turn) return;
  const ids = (list: Volume[]) => new Set(list.map(volume => volume.id));
  const [old, now, read] = [ids(before), ids(listed.value), ids(answer.items)];
  const added = listed.value.filter(volume => !old.has(volume.id) && !read.has(volume.id));
  listed.value = [...added, ...answer.items.filter(volume => now.has(volume.id) || !old.has(volume.id))];
  more.value = answer.next;
  arrived.value = [];
  validator = "";
  know(listed.value);
}

/** Reads the next rows. */
export async function loadMore(): Promise<void> {
  if (!more.value) return;
  const own = turn;
  const rows = { ...query(asked.value, PAGE), cursor: more.value };
  const next = await page<Volume>("volumes", rows).catch(async error => {
    // The row was erased from which the list went on.
    if (fieldOf(error) !== "cursor") throw error;
    await readList();
    return null;
  });
  // Another list was asked for meanwhile.
  if (!next || own !== turn) return;
  const known = new Set(listed.value.map(volume => volume.id));
  listed.value = [...listed.value, ...next.items.filter(volume => !known.has(volume.id))];
  more.value = next.next;
  know(next.items);
}

/** Looks at the list again: what is gone goes, what has changed is shown, what has arrived is counted. */
async function look(): Promise<boolean> {
  const [own, before, ended] = [turn, listed.value, more.value === null];
  const limit = Math.max(PAGE, Math.min(MOST_ROWS, before.length + (ended ? PAGE : 0)));
  const answer = await changedPage<Volume>("volumes", query(asked.value, limit), validator);
  if (!answer || own !== turn) return false;
  validator = answer.etag;
  merge(before, ended, answer);
  return true;
}

function merge(before: Volume[], ended: boolean, answer: Page<Volume>): void {
  const read = new Map(answer.items.map(volume => [volume.id, volume]));
  const old = new Set(before.map(volume => volume.id));
  const whole = answer.next === null;
  // Rows behind the last one that was read again are of later pages.
  const end = whole ? before.length : before.findLastIndex(volume => read.has(volume.id)) + 1;
  const gone = new Set(before.slice(0, end).flatMap(volume => (read.has(volume.id) ? [] : [volume.id])));
  const kept = listed.value.filter(volume => !gone.has(volume.id)).map(volume => read.get(volume.id) ?? volume);
  const here = new Set(kept.map(volume => volume.id));
  // Rows behind the last known one are of the next page, unless none is known any more.
  const last = answer.items.findLastIndex(volume => old.has(volume.id));
  const rows = ended || whole || last < 0 ? answer.items : answer.items.slice(0, last + 1);
  const fresh = rows.filter(volume => !here.has(volume.id) && !old.has(volume.id));
  if (fresh.length > 0 && (kept.length === 0 || fresh.every(volume => stored.has(volume.id)))) {
    const [first, own] = [rows.filter(volume => !gone.has(volume.id)), new Set(rows.map(volume => volume.id))];
    listed.value = [...first, ...kept.filter(volume => !own.has(volume.id))];
    if (kept.length === 0) more.value = answer.next;
    arrived.value = [];
  } else {
    listed.value = kept;
    arrived.value = fresh;
  }
  if (whole) more.value = null;
  know(answer.items, gone);
}

/** Adds what was read to the scans that the page knows, and takes away what is gone. */
function know(read: Volume[], gone: Set<string> = new Set()): void {
  const ids = new Set(read.map(volume => volume.id));
  volumes.value = [...read, ...volumes.value.filter(volume => !ids.has(volume.id) && !gone.has(volume.id))];
}

/** Of which patients and studies all scans were asked for since the list was opened. */
const askedOf = new Map<string, Promise<void>>();
let lastAsked: Promise<unknown> = Promise.resolve();

/** Reads all scans of a scan's patient, or of its study: a page or a part of the list may hold only some of them. */
export function loadCompany({ dicom }: Volume): Promise<void> {
  const { patient_id: patient, study_uid: study, study_date } = dicom ?? {};
  const day = isoDay(study_date ?? "");
  const ofDay = { study_date_from: day, study_date_to: day };
  const wanted = patient ? { patient, order: "study_date" } : study ? { study } : ofDay;
  const key = JSON.stringify(wanted);
  const known = askedOf.get(key);
  if (known) return known;
  // One after the other: a browser opens few connections, which previews and jobs need too.
  const reading = lastAsked.then(() => readCompany(wanted));
  lastAsked = reading.catch(() => askedOf.delete(key));
  askedOf.set(key, reading);
  return reading;
}

async function readCompany(wanted: Record<string, string>): Promise<void> {
  const before = new Set(volumes.value.map(volume => volume.id));
  const { items } = await page<Volume>("volumes", { ...wanted, limit: MOST_ROWS });
  const now = new Set(volumes.value.map(volume => volume.id));
  // What was known before and is not now was erased meanwhile.
  const fresh = items.filter(volume => !now.has(volume.id) && !before.has(volume.id));
  if (fresh.length > 0) volumes.value = [...volumes.value, ...fresh];
}

/** A scan that this tab has stored. */
export function addStored(volume: Volume): void {
  stored.add(volume.id);
  volumes.value = [volume, ...volumes.value.filter(other => other.id !== volume.id)];
  if (isWhole(asked.value)) listed.value = [volume, ...listed.value.filter(other => other.id !== volume.id)];
  else void look().catch(tell);
  tellTabs();
}

const tell = (error: unknown) => {
  trouble.value = words(error);
};

/** Asks for another part of the list, or another order of it. */
export function ask(change: Partial<Asked>): void {
  asked.value = { ...asked.value, ...change };
  trouble.value = "";
  void readList().catch(tell);
}

/**
 * Follows the list while it is open, and has jobs, and now and then results, read again by `readMade`; returns what
 * ends that.
 */
export function watchList(readMade: (results: boolean) => Promise<void>): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let [looks, ended, told] = [0, false, ""];
  askedOf.clear();
  const round = async (results: boolean) => {
    clearTimeout(timer);
    try {
      if (!document.hidden && reachable.value) {
        const changed = await look();
        if (!ended) receiving.value = await get<Receiving>("/v1/receiving");
        if (!ended && (changed || results)) await readMade(results);
        if (told && trouble.value === told) trouble.value = "";
      }
    } catch (error) {
      // The page says by itself that the service does not answer.
      if (!(error instanceof Unreachable)) trouble.value = told = words(error);
    }
    if (ended) return;
    clearTimeout(timer);
    const pause = asked.value.search ? PAUSE_OF_SEARCH : PAUSE;
    timer = setTimeout(() => void round(++looks % LOOKS_PER_RESULTS === 0), pause);
  };
  const now = () => void round(true);
  const seen = () => !document.hidden && now();
  document.addEventListener("visibilitychange", seen);
  const untell = onTold(now);
  timer = setTimeout(() => void round(false), 1000);
  return () => {
    ended = true;
    clearTimeout(timer);
    document.removeEventListener("visibilitychange", seen);
    untell();
  };
}
