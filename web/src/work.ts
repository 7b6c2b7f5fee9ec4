// Filing work: what a person asks for becomes a job, whose state the library follows.

import { type Job, type Kind, type ParameterValue, type Volume, post } from "./api";
import { put, watchActive } from "./library";
import { storedNameOf } from "./words";

/** What is compared, and with what. */
export interface Pair {
  stress: Volume;
  rest: Volume;
  normals: string | null;
  parameters: Record<string, ParameterValue>;
}

export async function fileComparison({ stress, rest, normals, parameters }: Pair): Promise<Job> {
  const labels = { name: storedNameOf(stress).slice(0, 200) };
  const order = { stress: stress.id, rest: rest.id, parameters, labels, ...(normals ? { normals } : {}) };
  const job = await post<Job>("/v1/comparisons", order);
  put(job);
  watchActive();
  return job;
}

export async function file(
  kind: Kind,
  volume: Volume,
  parameters: Record<string, ParameterValue>,
  labels: Record<string, string> = {},
): Promise<Job> {
  const name = storedNameOf(volume).slice(0, 200);
  const job = await post<Job>("/v1/jobs", { kind, volume: volume.id, parameters, labels: { name, ...labels } });
  put(job);
  watchActive();
  return job;
}
