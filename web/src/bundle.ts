// Everything of a scan, or of one result, as one zip.

import { type Result, type Volume, call } from "./api";
import { loadScan, resultsOf } from "./library";
import { saveBlob } from "./save";
import { isFit, nameOf } from "./words";
import { zip } from "./zip";

/** The name of a scan as files may have it, without the endings of its own files. */
export function fileNameOf(volume: Volume): string {
  return nameOf(volume).replace(/\.(nii|gz|hdr|img|dcm|zip)\b/gi, "").replace(/[^\w.-]+/g, "_") || "scan";
}

interface Wanted {
  name: string;
  path: string;
}

function filesOf(result: Result, folder: string): Wanted[] {
  const page = result.links["page"];
  const files = result.files.map(file => ({ name: `${folder}/${file.name}`, path: file.href }));
  return page ? [...files, { name: `${folder}/report.html`, path: page }] : files;
}

async function saved(name: string, wanted: Wanted[], told: (text: string) => void): Promise<void> {
  const files = [];
  for (const [n, { name: inside, path }] of wanted.entries()) {
    told(`File ${n + 1} of ${wanted.length} …`);
    const answer = await call(path);
    files.push({ name: `${name}/${inside.replace(/^\.\//, "")}`, bytes: new Uint8Array(await answer.arrayBuffer()) });
  }
  saveBlob(zip(files), `${name}.zip`);
  told("");
}

/** Saves every file of a result, with its report. */
export function saveResult(volume: Volume, result: Result, told: (text: string) => void): Promise<void> {
  const name = `${fileNameOf(volume)}_${result.id.slice(0, 12)}`;
  return saved(name, filesOf(result, "."), told);
}

/** Saves the scan as it was sent, and every file of every result. */
export async function saveScan(volume: Volume, told: (text: string) => void): Promise<void> {
  told("Reading what there is …");
  await loadScan(volume.id);
  const results = resultsOf(volume.id);
  const scan = volume.originals.map(file => ({ name: `scan/${file.name}`, path: file.href }));
  const made = results.flatMap(result => filesOf(result, `${isFit(result.id) ? "fit" : "model"}_${result.id.slice(0, 12)}`));
  await saved(fileNameOf(volume), [...scan, ...made], told);
}
