// Upload, make a model, wait, download, and meet an error, by the types generated from the document.
//
//   SERVICE_URL=... node try_client.js scan.nii.gz
import { readFile } from "node:fs/promises";
import createClient from "openapi-fetch";
import type { components, paths } from "./schema";

type Job = components["schemas"]["Job"];

function check(condition: unknown, what: unknown): asserts condition {
  if (!condition) throw new Error(JSON.stringify(what));
}

const client = createClient<paths>({ baseUrl: process.env["SERVICE_URL"] ?? "" });
const scan = await readFile(process.argv[2] ?? "");

const uploaded = await client.POST("/v1/volumes", {
  // A `format: binary` is a string to the generator; the bytes are sent as they are.
  body: scan as unknown as string,
  bodySerializer: (body) => body as unknown as BodyInit,
  headers: { "content-type": "application/octet-stream" },
});
check(uploaded.data, uploaded.error);
const filed = await client.POST("/v1/jobs", {
  body: { kind: "model", volume: uploaded.data.id, parameters: { points: 110, seed: 4 } },
});
check(filed.data, filed.error);
let job: Job = filed.data;
for (let tries = 0; job.state === "queued" || job.state === "running"; tries++) {
  check(tries < 1200, job);
  await new Promise((resolve) => setTimeout(resolve, 50));
  const now = await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } });
  check(now.data, now.error);
  job = now.data;
}
check(job.state === "succeeded" && job.model, job);
const path = { id: job.model };
const mesh = await client.GET("/v1/models/{id}/mesh.glb", { params: { path }, parseAs: "arrayBuffer" });
check(mesh.data && new TextDecoder().decode(mesh.data.slice(0, 4)) === "glTF", mesh.error);
const report = await client.GET("/v1/models/{id}/report.json", { params: { path } });
check(report.data && report.data.mesh.vertices === 110, report.error);
check(report.data.shape.radius_ratio.mean > 0.5, report.data.shape);
const missing = await client.GET("/v1/volumes/{id}", { params: { path: { id: "vol_" + "0".repeat(32) } } });
check(missing.error && missing.error.status === 404 && missing.error.title, missing);
console.log("ok: uploaded, waited, downloaded, and read a problem");
