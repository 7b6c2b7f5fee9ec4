// Which scans belong to one study, which two of them are rest and stress, and which a person has picked for a
// comparison.

import type { Volume } from "./api";
import { Watched } from "./state";
import { isLabelMap, nameOf } from "./words";

export type Role = "stress" | "rest";

/** Ids of the scans that are picked for a comparison, at most two. */
export const picked = new Watched<string[]>([]);

/** Picks a scan, or lets it go; of more than two the last two stay. */
export function pick(id: string): void {
  const before = picked.value;
  picked.value = before.includes(id) ? before.filter(other => other !== id) : [...before, id].slice(-2);
}

/** What the header says a scan was made at. */
export function statedRole({ dicom }: Volume): Role | null {
  const stated = dicom?.rest_or_stress;
  return stated === "stress" || stated === "rest" ? stated : null;
}

/** What the name or the description of a scan hints at; only a guess. */
function hintedRole(volume: Volume): Role | null {
  const text = `${nameOf(volume)} ${volume.dicom?.series_description ?? ""}`.toLowerCase();
  const says = (word: string) => new RegExp(`(^|[^a-z])${word}([^a-z]|$)`).test(text);
  if (says("stress") === says("rest")) return null;
  return says("stress") ? "stress" : "rest";
}

/** The scan at stress of two, and what tells it. */
export function stressOf(a: Volume, b: Volume): { stress: Volume | null; told: "headers" | "names" | null } {
  for (const [told, read] of [
    ["headers", statedRole],
    ["names", hintedRole],
  ] as const) {
    const [one, other] = [read(a), read(b)];
    // Two scans of one role are for the service to name; a role of one scan tells that of the other.
    if (one && one === other) continue;
    if (one) return { stress: one === "stress" ? a : b, told };
    if (other) return { stress: other === "stress" ? b : a, told };
  }
  return { stress: null, told: null };
}

const plain = (text: string | null | undefined) =>
  text
    ?.trim()
    .replace(/[\^ ]+$/, "")
    .toUpperCase() ?? "";

/** What scans of one patient's study have in common; null where no header tells. */
export function studyKey({ dicom }: Volume): string | null {
  const patient = plain(dicom?.patient_id) || plain(dicom?.patient_name);
  const study = dicom?.study_uid ?? dicom?.study_date;
  return study ? `${patient}\n${study}` : null;
}

/** Whether the headers name two patients by number. */
export function areOfTwoPatients(a: Volume, b: Volume): boolean {
  const [one, other] = [plain(a.dicom?.patient_id), plain(b.dicom?.patient_id)];
  return one !== "" && other !== "" && one !== other;
}

/** The scans at stress and at rest of one study, where headers tell both and nothing else could be meant. */
export function statedPair(volumes: Volume[]): [Volume, Volume] | null {
  const of = (role: Role) => volumes.filter(volume => statedRole(volume) === role);
  const [[stress, ...moreStress], [rest, ...moreRest]] = [of("stress"), of("rest")];
  if (!stress || !rest || moreStress.length > 0 || moreRest.length > 0) return null;
  return studyKey(stress) !== null && studyKey(stress) === studyKey(rest) ? [stress, rest] : null;
}

/** The two of the scans sent together that a comparison is offered of: both, or those that headers name. */
export function offeredPair(volumes: Volume[]): [Volume, Volume] | null {
  const images = volumes.filter(volume => !isLabelMap(volume));
  const [a, b, ...more] = images;
  if (a && b && more.length === 0 && a.id !== b.id) return [a, b];
  return statedPair(images);
}
