// Files chosen or dropped by a person: which of them make up one scan, and how far each has been sent.

import { at } from "./base";
import {
  type Problem,
  ProblemError,
  type Volume,
  authorization,
  key,
  nextKey,
  page,
  problemOf,
  uploadLimit,
} from "./api";
import { pathOf } from "./drop";
import { Watched } from "./state";
import { LEAST_GATES, MOST_GATES, bytes, rememberFileName } from "./words";

export interface Group {
  name: string;
  files: File[];
}

export type UploadState = "waiting" | "sending" | "reading" | "stored" | "refused" | "interrupted" | "cancelled";

export interface Upload {
  id: number;
  /** The number of what was chosen or dropped together. */
  batch: number;
  group: Group;
  /** Whether it is an example of the service: nothing has to be decided about it. */
  isExample: boolean;
  bytes: number;
  sent: number;
  state: UploadState;
  problem?: Problem;
  volume?: Volume;
  existed?: boolean;
}

/**
 * Whether a file's name becomes the label `name` of its volume. Exports name files after patients, so not unless a
 * person asks for it.
 */
export const keepNames = new Watched<boolean>(localStorage.getItem("ventriform.names") === "yes");
keepNames.watch(() => localStorage.setItem("ventriform.names", keepNames.value ? "yes" : "no"));

export const uploads = new Watched<Upload[]>([]);

/** What to do with each scan that has been stored, and with those that were sent together once all of them are. */
type WhenStored = (volume: Volume, upload: Upload) => void;
type WhenAllStored = (volumes: Volume[], areExamples: boolean) => void;
let whenStored: WhenStored = () => undefined;
let whenAllStored: WhenAllStored = () => undefined;
export function onStored(act: WhenStored, together: WhenAllStored): void {
  whenStored = act;
  whenAllStored = together;
}

/** The name of a NIfTI file of one gate: what is before and after its number. */
const GATE_NAME = /^(.*(?:gate|bin|phase|frame|slot)[ _-]*)\d+(.*\.nii(?:\.gz)?)$/i;

/**
 * Files that make up one scan: a header with its image, the files of one DICOM series (a slice or a gate each), and
 * NIfTI files named as the gates of one study.
 */
export async function grouped(files: File[]): Promise<Group[]> {
  const groups = new Map<string, Group>();
  const add = (id: string, name: string, file: File) => {
    const group = groups.get(id);
    if (group) group.files.push(file);
    else groups.set(id, { name, files: [file] });
  };
  const useful = files.filter(file => !file.name.startsWith(".") && file.name !== "DICOMDIR");
  for (const file of useful) {
    const folder = folderOf(file);
    const pair = /^(.*)\.(hdr|img)(\.gz)?$/i.exec(file.name);
    if (pair) {
      add(`pair ${folder}/${pair[1]}`, `${pair[1]}.hdr`, file);
      continue;
    }
    const gate = GATE_NAME.exec(file.name);
    if (gate) {
      add(`gates ${folder}/${gate[1]}\n${gate[2]}`, `${gate[1]}${gate[2]}`, file);
      continue;
    }
    const series = await seriesOf(file);
    if (series)
      add(`${series.frames > 1 ? "gates " : ""}series ${series.uid}`, folder.split("/").pop() || file.name, file);
    else add(`file ${folder}/${file.name}`, file.name, file);
  }
  const apart = ([id, group]: [string, Group]): Group[] => {
    const gates = group.files.length;
    if (!id.startsWith("gates ") || (gates >= LEAST_GATES && gates <= MOST_GATES)) return [group];
    return group.files.map(file => ({ name: file.name, files: [file] }));
  };
  const named = [...groups].flatMap(apart).map(group => {
    const name = group.files.length === 1 ? (group.files[0]?.name ?? group.name) : group.name;
    return { ...group, name };
  });
  // The folders tell files of one name apart: `stress/spect.nii.gz` and `rest/spect.nii.gz`.
  return named.map(group => {
    const twin = named.some(other => other !== group && other.name === group.name);
    const folder = twin && group.files[0] ? folderOf(group.files[0]).split("/").pop() : "";
    return folder ? { ...group, name: `${folder} ${group.name}` } : group;
  });
}

function folderOf(file: File): string {
  return pathOf(file).split("/").slice(0, -1).join("/");
}

/**
 * The series of a DICOM file, and its frames; null for other files. A file of many frames is a scan by itself, unless
 * it has as many others beside it as a beat has gates.
 */
async function seriesOf(file: File): Promise<{ uid: string; frames: number } | null> {
  if (/\.(nii|gz|zip)$/i.test(file.name) || file.size < 200) return null;
  const head = new Uint8Array(await file.slice(0, 16_384).arrayBuffer());
  if (String.fromCharCode(...head.subarray(128, 132)) !== "DICM") return null;
  const text = (group: number, element: number): string | null => {
    const tag = [group & 255, group >> 8, element & 255, element >> 8];
    for (let at = 132; at + 8 < head.length; at++) {
      if (!tag.every((byte, i) => head[at + i] === byte)) continue;
      const explicit = /^[A-Z]{2}$/.test(String.fromCharCode(head[at + 4]!, head[at + 5]!));
      const length = explicit ? head[at + 6]! | (head[at + 7]! << 8) : head[at + 4]! | (head[at + 5]! << 8);
      return String.fromCharCode(...head.subarray(at + 8, at + 8 + length)).replace(/[\0 ]+$/, "");
    }
    return null;
  };
  const frames = Number(text(0x0028, 0x0008) ?? "1");
  const uid = text(0x0020, 0x000e);
  return uid ? { uid, frames } : null;
}

/** What the service says of files that hold no scan. */
const FOREIGN = ["unrecognised-format", "unsupported-format", "single-slice", "empty-body"];

/** Whether the service has found that the files are no scan. */
export function isForeign({ state, problem }: Upload): boolean {
  return state === "refused" && FOREIGN.includes(problem?.type.split(":").pop() ?? "");
}

export function isUnderWay({ state }: Upload): boolean {
  return state === "waiting" || state === "sending" || state === "reading";
}

/** What was chosen or dropped together, as the list of uploads tells of it. */
export interface Batch {
  number: number;
  /** What one sentence tells of. */
  told: Upload[];
  /** What has a line each. */
  lines: Upload[];
  /** What waits behind these. */
  behind: Upload[];
}

/** Most waiting scans of a batch with a line each. */
const MOST_WAITING = 5;

/** The batches, the newest first. Of several with foreign files, one sentence tells what is stored and what is no scan. */
export function batchesOf(all: Upload[]): Batch[] {
  const numbers = [...new Set(all.map(upload => upload.batch))];
  return numbers.map(number => {
    const own = all.filter(upload => upload.batch === number);
    const isTold = (upload: Upload) => isForeign(upload) || upload.state === "stored";
    const told = own.length > 1 && own.some(isForeign) ? own.filter(isTold) : [];
    const behind = own.filter(upload => upload.state === "waiting").slice(MOST_WAITING);
    const apart = new Set([...told, ...behind]);
    return { number, told, lines: own.filter(upload => !apart.has(upload)), behind };
  });
}

const stay = (event: BeforeUnloadEvent) => event.preventDefault();
// Only while something is under way: a page that may ask is not kept for the way back.
uploads.watch(() => {
  const ask = uploads.value.some(isUnderWay) ? addEventListener : removeEventListener;
  ask("beforeunload", stay);
});

let count = 0;
let batches = 0;

export async function add(files: File[], isExample = false): Promise<void> {
  const groups = await grouped(files);
  const batch = ++batches;
  const made = groups.map(group => ({
    id: ++count,
    batch,
    group,
    isExample,
    bytes: group.files.reduce((sum, file) => sum + file.size, 0),
    sent: 0,
    state: "waiting" as const,
  }));
  uploads.value = [...made, ...uploads.value];
  void work();
}

function change(id: number, part: Partial<Upload>): void {
  uploads.value = uploads.value.map(upload => (upload.id === id ? { ...upload, ...part } : upload));
}

let busy = false;
const requests = new Map<number, XMLHttpRequest>();

/** Sends what waits, one after the other. */
async function work(): Promise<void> {
  if (busy) return;
  busy = true;
  try {
    for (;;) {
      const [next] = uploads.value.filter(upload => upload.state === "waiting").sort((a, b) => a.id - b.id);
      if (!next) return;
      await send(next);
    }
  } finally {
    busy = false;
  }
}

/** A form is a little larger than its files. */
const FORM = 4096;

/** Why a scan is too large to be sent at all; null if it is not, as far as the page knows. */
function tooLarge(upload: Upload): Problem | null {
  const limit = uploadLimit.value;
  if (limit === null || upload.bytes + FORM <= limit) return null;
  return {
    type: "about:blank",
    title: "",
    status: 413,
    detail: `It was not sent: ${bytes(upload.bytes)} are more than ${bytes(limit)}, the limit of this service.`,
    fix: "Send less (a volume may be gzipped: .nii.gz), or ask the operator to raise the limit.",
  };
}

async function send(upload: Upload): Promise<void> {
  change(upload.id, { state: "sending", sent: 0 });
  // A small question first: an answer to it is read, while a service that refuses a large body may hang up unheard.
  try {
    await page("volumes", { limit: 1 });
  } catch (error) {
    if (error instanceof ProblemError) return change(upload.id, { state: "refused", problem: error.problem });
    return change(upload.id, { state: "interrupted" });
  }
  if (uploads.value.find(other => other.id === upload.id)?.state !== "sending") return;
  const problem = tooLarge(upload);
  if (problem) return change(upload.id, { state: "refused", problem });
  for (;;) {
    const used = key.value;
    const answer = await attempt(upload);
    if (answer === null) return;
    if (answer.status === 401) {
      if (key.value === used)
        await nextKey(
          used
            ? "The service no longer accepts the key. Give another one; the upload goes on then."
            : "This service asks for a key.",
        );
      continue;
    }
    if (answer.status === 200 || answer.status === 201) {
      const volume = JSON.parse(answer.text) as Volume;
      rememberFileName(volume, upload.group.name);
      change(upload.id, { state: "stored", volume, existed: answer.status === 200, sent: upload.bytes });
      whenStored(volume, upload);
    } else {
      change(upload.id, { state: "refused", problem: problemOf(answer.status, answer.text) });
    }
    tellTogether(upload.batch);
    return;
  }
}

/** Tells of the scans that were sent together, once no other is to come. */
function tellTogether(batch: number): void {
  const together = uploads.value.filter(other => other.batch === batch);
  const scans = together.filter(other => !isForeign(other));
  if (scans.every(other => other.state === "stored"))
    whenAllStored(
      scans.flatMap(other => other.volume ?? []),
      scans.some(other => other.isExample),
    );
}

/** One request; null if it was cancelled or interrupted. Only XMLHttpRequest reports how much was sent. */
function attempt(upload: Upload): Promise<{ status: number; text: string } | null> {
  const form = new FormData();
  for (const file of upload.group.files) form.append("volume", file, file.name);
  const name = upload.group.name.replace(/[\u0000-\u001f\u007f]/g, " ").slice(0, 200);
  const request = new XMLHttpRequest();
  requests.set(upload.id, request);
  change(upload.id, { state: "sending", sent: 0 });
  return new Promise(resolve => {
    request.upload.onprogress = event => change(upload.id, { sent: Math.min(upload.bytes, event.loaded) });
    request.upload.onload = () => change(upload.id, { state: "reading", sent: upload.bytes });
    request.onload = () => resolve({ status: request.status, text: request.responseText });
    request.onerror = () => {
      change(upload.id, { state: "interrupted" });
      resolve(null);
    };
    request.onabort = () => {
      change(upload.id, { state: "cancelled" });
      resolve(null);
    };
    request.onloadend = () => requests.delete(upload.id);
    request.open(
      "POST",
      at(`/v1/volumes${keepNames.value ? `?${new URLSearchParams({ labels: `name:${name}` })}` : ""}`),
    );
    for (const [header, value] of Object.entries(authorization())) request.setRequestHeader(header, value);
    request.send(form);
  });
}

export function stop(upload: Upload): void {
  const request = requests.get(upload.id);
  if (request) request.abort();
  else change(upload.id, { state: "cancelled" });
}

export function again(upload: Upload): void {
  change(upload.id, { state: "waiting", sent: 0 });
  void work();
}

export function dismiss(...some: Upload[]): void {
  uploads.value = uploads.value.filter(other => !some.includes(other));
}
