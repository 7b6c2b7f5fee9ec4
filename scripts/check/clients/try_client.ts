// Upload, make a model and a beat, wait, download, and meet an error, by the types generated from the document.
//
//   SERVICE_URL=... node try_client.js scan.nii.gz gated.nii.gz
import { readFile } from "node:fs/promises";
import createClient from "openapi-fetch";
import type { components, paths } from "./schema";

// Other checks run beside this one, and CI may be slow.
const JOB_MILLISECONDS = 600_000;

type Job = components["schemas"]["Job"];

function check(condition: unknown, what: unknown): asserts condition {
  if (!condition) throw new Error(JSON.stringify(what));
}

const client = createClient<paths>({ baseUrl: process.env["SERVICE_URL"] ?? "" });

async function stored(path = "") {
  const scan = await readFile(path);
  const uploaded = await client.POST("/v1/volumes", {
    // A `format: binary` is a string to the generator; the bytes are sent as they are.
    body: scan as unknown as string,
    bodySerializer: (body) => body as unknown as BodyInit,
    headers: { "content-type": "application/octet-stream" },
  });
  check(uploaded.data, uploaded.error);
  return uploaded.data;
}

/** The job, when it has succeeded. */
async function made(order: components["schemas"]["JobRequest"]): Promise<Job> {
  const filed = await client.POST("/v1/jobs", { body: order });
  check(filed.data, filed.error);
  let job: Job = filed.data;
  const end = Date.now() + JOB_MILLISECONDS;
  while (job.state === "queued" || job.state === "running") {
    check(Date.now() < end, job);
    await new Promise((resolve) => setTimeout(resolve, 50));
    const now = await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } });
    check(now.data, now.error);
    job = now.data;
  }
  check(job.state === "succeeded", job);
  return job;
}

const volume = await stored(process.argv[2]);
check(!volume.gates, volume);
const job = await made({ kind: "model", volume: volume.id, parameters: { points: 110, seed: 4 } });
check(job.model, job);
const path = { id: job.model };
const mesh = await client.GET("/v1/models/{id}/{file}", { params: { path: { ...path, file: "mesh.glb" } }, parseAs: "arrayBuffer" });
check(mesh.data && new TextDecoder().decode(mesh.data.slice(0, 4)) === "glTF", mesh.error);
const report = await client.GET("/v1/models/{id}/report", { params: { path } });
check(report.data && typeof report.data === "object" && report.data.mesh.vertices === 110, report.error);
check(report.data.shape.radius_ratio.mean > 0.5, report.data.shape);

const gated = await stored(process.argv[3]);
check(gated.gates?.number === 8, gated);
const fitted = await made({ kind: "beat", volume: gated.id, parameters: { rr_ms: 900 } });
check(fitted.beat, fitted);
const beat = await client.GET("/v1/beats/{id}", { params: { path: { id: fitted.beat } } });
check(beat.data && beat.data.summary.gates === 8 && beat.data.links.page, beat.error);
const figures = await client.GET("/v1/beats/{id}/report", { params: { path: { id: fitted.beat } } });
check(figures.data && typeof figures.data === "object" && figures.data.segments.length === 17, figures.error);
check(figures.data.edv_ml > figures.data.esv_ml, figures.data);

const missing = await client.GET("/v1/volumes/{id}", { params: { path: { id: "vol_" + "0".repeat(32) } } });
check(missing.error && missing.error.status === 404 && missing.error.title, missing);
console.log("ok: uploaded, waited, downloaded, and read a problem");
