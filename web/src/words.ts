// How things are called and numbers are written.

import type { Job, Kind, Volume } from "./api";

/**
 * Names of the files that this tab has sent, by the ids of their volumes. They are often patients' names, and are
 * stored nowhere.
 */
const sentAs = new Map<string, string>();
export function rememberFileName(volume: Volume, name: string): void {
  sentAs.set(volume.id, name);
}

/** Whether each word of `search` is part of the name of the file that this tab has sent as the scan. */
export function wasSentAs(volume: Volume, search: string): boolean {
  const name = sentAs.get(volume.id)?.toLowerCase();
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  return name !== undefined && words.length > 0 && words.every(word => name.includes(word));
}

/** What the service calls a scan: what may be stored with what is made of it. */
export function storedNameOf(volume: Volume): string {
  return volume.external_id || volume.labels["name"] || shortId(volume);
}

/** What a scan is called on the screen. */
export function nameOf(volume: Volume): string {
  return volume.external_id || volume.labels["name"] || sentAs.get(volume.id) || shortId(volume);
}

function shortId(volume: Volume): string {
  return `Scan ${volume.id.slice(4, 12)}`;
}

/** Most letters of an identifier in lists. */
const LIST_LETTERS = 32;

/** A name or identifier with its middle left out, where it is too long for a list. */
export function cut(text: string): string {
  if (text.length <= LIST_LETTERS) return text;
  return `${text.slice(0, LIST_LETTERS - 12)}…${text.slice(-11)}`;
}

/** What a scan is called on its own view: an identifier of DICOM is said to be one. */
export function titleOf(volume: Volume): string {
  const name = nameOf(volume);
  return /^[\d.]{20,}$/.test(name) ? `UID ${name}` : name;
}

/** A day of DICOM as YYYY-MM-DD. */
export function isoDay(day: string): string {
  return day.replace(/^(\d{4})(\d\d)(\d\d)$/, "$1-$2-$3");
}

/**
 * Patient and study of a scan, as DICOM or the caller states them, identifiers with what they identify; `written`
 * shortens them.
 */
export function study({ dicom }: Volume, written: (text: string) => string = text => text): string {
  if (!dicom) return "";
  const patient = dicom["patient_name"]?.replaceAll("^", " ").trim();
  const date = isoDay(dicom["study_date"] ?? "");
  const [id, accession] = [dicom["patient_id"], dicom["accession_number"]];
  const parts = [
    patient && written(patient),
    id && `patient ID ${written(id)}`,
    date && `study of ${date}`,
    accession && `accession ${written(accession)}`,
  ];
  return parts.filter(Boolean).join(" · ");
}

/** Whether a scan says that its patient is simulated: by the name, or by its description where it has no name. */
export function isOfSimulated({ dicom }: Volume): boolean {
  const name = dicom?.["patient_name"];
  return name ? name.startsWith("Simulated^") : /\bsimulated\b/i.test(dicom?.series_description ?? "");
}

/** What a header says of the acquisition: stress or rest, its description, the tracer. */
export function acquisition({ dicom }: Volume): string[] {
  if (!dicom) return [];
  const { series_description: description, radiopharmaceutical, radionuclide } = dicom;
  return [description, radiopharmaceutical ?? radionuclide].flatMap(text => (text?.trim() ? [text.trim()] : []));
}

export function bytes(count: number): string {
  if (count < 1e3) return `${count} B`;
  if (count < 1e6) return `${(count / 1e3).toFixed(0)} kB`;
  if (count < 1e9) return `${(count / 1e6).toFixed(1)} MB`;
  return `${(count / 1e9).toFixed(2)} GB`;
}

const MINUTE = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });
const SECOND = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "medium" });

/** The order of two things, the newest first. */
export function newest(a: { created_at: string }, b: { created_at: string }): number {
  return Date.parse(b.created_at) - Date.parse(a.created_at);
}

export function moment(text: string): string {
  return MINUTE.format(new Date(text));
}

/** As `moment`, to the second. */
export function exactMoment(text: string): string {
  return SECOND.format(new Date(text));
}

export function number(value: unknown, digits = 1, unit = ""): string {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  // Not the sign of a zero.
  return value.toFixed(digits).replace(/^-(0(?:\.0+)?)$/, "$1") + (unit ? `\u2009${unit}` : "");
}

/** A value of the image: counts are whole; images of a scale below ten keep two digits. */
export function counts(value: number): string {
  return Math.abs(value) < 10 && !Number.isInteger(value) ? value.toPrecision(2) : value.toFixed(0);
}

export function shape(volume: Volume): string {
  const voxel = volume.spacing_mm.slice(0, 3).map(mm => mm.toFixed(1));
  const edge = new Set(voxel).size === 1 ? voxel[0] : voxel.join(" × ");
  const frames = volume.gates ? `, ${volume.gates.number} gates` : volume.frames > 1 ? `, ${volume.frames} frames` : "";
  return `${volume.shape.join(" × ")} voxels of ${edge} mm${frames}`;
}

/** Fewest gates that show a beat. */
export const LEAST_GATES = 6;
/** Most gates of a study. */
export const MOST_GATES = 32;

/** Whether a scan has gates enough for a beat. */
export function isGated(volume: Volume): boolean {
  const gates = volume.gates?.number ?? 0;
  return gates >= LEAST_GATES && gates <= MOST_GATES;
}

export function isLabelMap(volume: Volume): boolean {
  return volume.label_values != null;
}

const STAGES: Record<string, string> = {
  read: "reading the scan",
  localise: "looking for the heart",
  align: "placing the model",
  surface: "extracting the surface",
  retile: "placing the points",
  optimise: "improving the triangles",
  deform: "fitting the wall",
  beat: "fitting all gates",
  polar: "measuring the uptake",
  report: "measuring",
  export: "writing files",
};

export function stage(job: Job): string {
  return job.stage ? (STAGES[job.stage] ?? job.stage.replaceAll("_", " ")) : "starting";
}

export function isFit(id: string): boolean {
  return id.startsWith("seg_");
}

export function isBeat(id: string): boolean {
  return id.startsWith("bea_");
}

export function isComparison(id: string): boolean {
  return id.startsWith("cmp_");
}

export function isSerial(id: string): boolean {
  return id.startsWith("ser_");
}

export function isReading(id: string): boolean {
  return id.startsWith("rdg_");
}

/** The kind of work that makes such a result. */
export function kindOf(id: string): Kind {
  if (isSerial(id)) return "serial";
  return isFit(id) ? "segmentation" : isBeat(id) ? "beat" : isComparison(id) ? "comparison" : "model";
}

export function ordinal(n: number): string {
  const last = n % 100 > 10 && n % 100 < 14 ? 0 : n % 10;
  return `${n}${["th", "st", "nd", "rd"][last] ?? "th"}`;
}
