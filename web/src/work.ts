// Filing work: what a person asks for becomes a job, whose state the library follows.

import { type Job, type Kind, type ParameterValue, type Volume, post } from "./api";
import type { ReadingRequest } from "./generated/openapi";
import { put, watchActive } from "./library";
import { tellTabs } from "./tabs";
import { storedNameOf } from "./words";

const filed = new Set<string>();

/** Whether this tab filed the job. */
export const isFiledHere = (job: Job): boolean => filed.has(job.id);

function follow(job: Job): Job {
  filed.add(job.id);
  put(job);
  watchActive();
  tellTabs();
  return job;
}

/** What is compared, and with what. */
export interface Pair {
  stress: Volume;
  rest: Volume;
  /** Fits of the scans whose corrections are kept. */
  fits: { stress: string | null; rest: string | null };
  normals: string | null;
  parameters: Record<string, ParameterValue>;
}

export async function fileComparison({ stress, rest, fits, normals, parameters }: Pair): Promise<Job> {
  const labels = { name: storedNameOf(stress).slice(0, 200) };
  const scans = { stress: fits.stress ?? stress.id, rest: fits.rest ?? rest.id };
  const order = { ...scans, parameters, labels, ...(normals ? { normals } : {}) };
  return follow(await post<Job>("/v1/comparisons", order));
}

/** What is compared over the years: scans in the order of their dates. */
export interface Series {
  scans: Volume[];
  normals: string | null;
  parameters: Record<string, ParameterValue>;
}

export async function fileSerial({ scans, normals, parameters }: Series): Promise<Job> {
  const last = scans.at(-1);
  const labels = last ? { name: storedNameOf(last).slice(0, 200) } : {};
  const order = { scans: scans.map(scan => scan.id), parameters, labels, ...(normals ? { normals } : {}) };
  return follow(await post<Job>("/v1/serials", order));
}

export async function fileReading(order: Partial<ReadingRequest>): Promise<Job> {
  return follow(await post<Job>("/v1/readings", order));
}

export async function file(
  kind: Kind,
  volume: Volume,
  parameters: Record<string, ParameterValue>,
  labels: Record<string, string> = {},
): Promise<Job> {
  const name = storedNameOf(volume).slice(0, 200);
  return follow(await post<Job>("/v1/jobs", { kind, volume: volume.id, parameters, labels: { name, ...labels } }));
}
