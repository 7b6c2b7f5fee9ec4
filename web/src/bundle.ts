// Everything of a scan, or of one result, as one zip.

import { ProblemError, type Result, type Volume, call } from "./api";
import { comparisonsOf, loadScan, resultsOf, serialsOf } from "./library";
import { saveBlob } from "./save";
import { isBeat, isComparison, isFit, isSerial, nameOf } from "./words";
import { zip } from "./zip";

/** The name of a scan as files may have it, without the endings of its own files. */
export function fileNameOf(volume: Volume): string {
  return (
    nameOf(volume)
      .replace(/\.(nii|gz|hdr|img|dcm|zip)\b/gi, "")
      .replace(/[^\w.-]+/g, "_") || "scan"
  );
}

interface Wanted {
  name: string;
  path: string;
  /** Whether the service may refuse it: a DICOM object names the patient. */
  object?: boolean;
}

/**
 * Paths of the DICOM objects of a result, made when they are asked for. Of a scan that is not DICOM nobody knows whose
 * they would be.
 */
export function objectsOf(volume: Volume, result: Result): string[] {
  return volume.dicom ? (result.links.dicom ?? []) : [];
}

function filesOf(volume: Volume, result: Result, folder: string): Wanted[] {
  const page = result.links.page;
  const files = result.files.map(file => ({ name: `${folder}/${file.name}`, path: file.href }));
  const made = objectsOf(volume, result).map(path => ({
    name: `${folder}/${path.slice(path.lastIndexOf("/") + 1)}`,
    path,
    object: true,
  }));
  return [...files, ...(page ? [{ name: `${folder}/report.html`, path: page }] : []), ...made];
}

async function saved(name: string, wanted: Wanted[], told: (text: string) => void): Promise<void> {
  const files = [];
  const leftOut: string[] = [];
  for (const [n, { name: inside, path, object }] of wanted.entries()) {
    told(`File ${n + 1} of ${wanted.length} …`);
    const place = inside.replace(/^\.\//, "");
    let answer: Response;
    try {
      answer = await call(path);
    } catch (error) {
      // 403: the key may not read whose scan it is. 404 and 409: nobody stated it, or it was erased.
      if (!object || !(error instanceof ProblemError) || ![403, 404, 409].includes(error.problem.status)) throw error;
      leftOut.push(`${place}: ${error.problem.detail}`);
      continue;
    }
    files.push({ name: `${name}/${place}`, bytes: new Uint8Array(await answer.arrayBuffer()) });
  }
  if (leftOut.length > 0) {
    const text = ["These DICOM objects are not in this zip:", "", ...leftOut, ""].join("\n");
    files.push({ name: `${name}/left_out.txt`, bytes: new TextEncoder().encode(text) });
  }
  saveBlob(zip(files), `${name}.zip`);
  told(leftOut.length > 0 ? `Saved without ${leftOut.length} DICOM objects: left_out.txt in the zip says why.` : "");
}

/** Saves every file of a result, with its report. */
export function saveResult(volume: Volume, result: Result, told: (text: string) => void): Promise<void> {
  const name = `${fileNameOf(volume)}_${result.id.slice(0, 12)}`;
  return saved(name, filesOf(volume, result, "."), told);
}

/** Saves the scan as it was sent, and every file of every result. */
export async function saveScan(volume: Volume, told: (text: string) => void): Promise<void> {
  told("Reading what there is …");
  await loadScan(volume.id);
  const results = [
    ...resultsOf(volume.id),
    ...[...comparisonsOf(volume.id), ...serialsOf(volume.id)].filter(made => made.volume === volume.id),
  ];
  const scan = volume.originals.map(file => ({ name: `scan/${file.name}`, path: file.href }));
  const made = results.flatMap(result =>
    filesOf(
      volume,
      result,
      `${isFit(result.id) ? "fit" : isBeat(result.id) ? "beat" : isComparison(result.id) ? "comparison" : isSerial(result.id) ? "serial" : "model"}_${result.id.slice(0, 12)}`,
    ),
  );
  await saved(fileNameOf(volume), [...scan, ...made], told);
}
