// Filing work: what a person asks for becomes a job, whose state the library follows.

import { type Job, type Kind, type ParameterValue, type Volume, post } from "./api";
import { put, watchActive } from "./library";
import { nameOf } from "./words";

export async function file(kind: Kind, volume: Volume, parameters: Record<string, ParameterValue>, labels: Record<string, string> = {}): Promise<Job> {
  const name = nameOf(volume).slice(0, 200);
  const job = await post<Job>("/v1/jobs", { kind, volume: volume.id, parameters, labels: { name, ...labels } });
  put(job);
  watchActive();
  return job;
}
