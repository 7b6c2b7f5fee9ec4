// Which scans belong to one patient and study, which two of them are rest and stress of one kind, and which a person has
// picked for a comparison.

import type { Volume } from "./api";
import { KINDS, kindOf, mayAgree } from "./scankind";
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
  // Callers who do not see patients see the UID of the study, which is of one patient.
  if (dicom?.study_uid) return `${patient}\n${dicom.study_uid}`;
  return patient && dicom?.study_date ? `${patient}\n${dicom.study_date}` : null;
}

/** What belongs to the scans of each study, by its key; a scan of no study is alone under its id. */
export function byStudy<T>(items: T[], volumeOf: (item: T) => Volume): Map<string, T[]> {
  const groups = new Map<string, T[]>();
  for (const item of items) {
    const volume = volumeOf(item);
    const key = studyKey(volume) ?? volume.id;
    groups.set(key, [...(groups.get(key) ?? []), item]);
  }
  return groups;
}

/** When a study was, as texts that sort; empty if the header does not say the day. */
const timeOfStudy = ({ dicom }: Volume): string =>
  dicom?.study_date ? `${dicom.study_date} ${dicom.study_time ?? ""}` : "";

/** The studies of the same Patient ID before that of a scan, the latest first. */
export function earlierStudies(volume: Volume, known: Volume[]): Volume[][] {
  const [patient, time] = [plain(volume.dicom?.patient_id), timeOfStudy(volume)];
  if (!patient || !time) return [];
  const before = known.filter(
    other =>
      plain(other.dicom?.patient_id) === patient &&
      studyKey(other) !== studyKey(volume) &&
      timeOfStudy(other) !== "" &&
      timeOfStudy(other) < time,
  );
  const latest = (a: Volume, b: Volume) => timeOfStudy(b).localeCompare(timeOfStudy(a));
  return [...byStudy(before.sort(latest), other => other).values()];
}

/** Whether the headers name two patients by number. */
export function areOfTwoPatients(a: Volume, b: Volume): boolean {
  const [one, other] = [plain(a.dicom?.patient_id), plain(b.dicom?.patient_id)];
  return one !== "" && other !== "" && one !== other;
}

/** Scans of one study that are alike but for stress and rest. */
export interface StudyPair {
  stress: Volume;
  rest: Volume;
  /** What tells the pair from the others of its study; empty if it is alone. */
  kind: string;
}

/** The pairs of a study, and in sentences why other scans of it are in none. */
export interface Pairing {
  pairs: StudyPair[];
  unpaired: string[];
}

export type Alike = (a: Volume, b: Volume) => boolean;

export const isSame: Alike = (a, b) => KINDS.every(kind => kind.of(a) === kind.of(b));
/** Whether no header contradicts that both are of one kind. */
export const mayBeSame: Alike = (a, b) => KINDS.every(kind => mayAgree(kind, a, b));

/** The scans with the one scan that is alike, where each is the other's only one. */
function matched(stress: Volume[], rest: Volume[], alike: Alike): [Volume, Volume][] {
  return stress.flatMap((scan): [Volume, Volume][] => {
    const [other, ...more] = rest.filter(one => alike(scan, one));
    if (!other || more.length > 0) return [];
    return stress.filter(one => alike(one, other)).length === 1 ? [[scan, other]] : [];
  });
}

/** Modalities that show uptake. */
const OF_UPTAKE = ["NM", "PT"];

/** Whether a scan shows uptake. */
export function isOfUptake(volume: Volume): boolean {
  return !isLabelMap(volume) && OF_UPTAKE.includes(volume.dicom?.modality?.trim() || "NM");
}

/** Pairs the scans of one study by kind, the gated pair first, where headers tell stress and rest. */
export function pairsOf(volumes: Volume[]): Pairing {
  const images = volumes.filter(isOfUptake);
  const of = (role: Role) => images.filter(volume => statedRole(volume) === role);
  let found: [Volume, Volume][] = [];
  let left = { stress: of("stress"), rest: of("rest") };
  for (const alike of [isSame, mayBeSame]) {
    found = [...found, ...matched(left.stress, left.rest, alike)];
    const paired = new Set(found.flat());
    const without = (scans: Volume[]) => scans.filter(scan => !paired.has(scan));
    left = { stress: without(left.stress), rest: without(left.rest) };
  }
  const order = ([scan]: [Volume, Volume]) => KINDS.map(kind => (kind.of(scan) === kind.first ? 0 : 1)).join("");
  found.sort((a, b) => order(a).localeCompare(order(b)));
  const pairs = found.map(([stress, rest]) => ({ stress, rest, kind: kindOf([stress, rest], found.flat()) }));
  return { pairs, unpaired: whyUnpaired(images, left) };
}

const PICK = "pick the two to compare";

function whyUnpaired(images: Volume[], left: Record<Role, Volume[]>): string[] {
  const why = (role: Role, other: Role): string[] => {
    if (left[role].length === 0) return [];
    if (!images.some(image => statedRole(image) === other)) return [`This study has no scan at ${other}.`];
    return left[role].map(scan => {
      const kind = kindOf([scan], images);
      if (left[other].some(one => mayBeSame(scan, one)))
        return `More than one pair is possible${kind && ` (${kind})`}: ${PICK}.`;
      return `The scan at ${role}${kind && ` (${kind})`} has no such scan at ${other}.`;
    });
  };
  const unsaid = images.filter(image => statedRole(image) === null).length;
  const say = unsaid === 1 ? "1 scan says" : `${unsaid} scans say`;
  const ofRoles = [...why("stress", "rest"), ...why("rest", "stress")];
  const ofOthers = unsaid > 0 && images.length > 1 ? [`${say} neither rest nor stress: ${PICK}.`] : [];
  return [...new Set([...ofRoles, ...ofOthers])];
}

/** The two of the scans sent together that a comparison is offered of: both, or the first pair of their one study. */
export function offeredPair(volumes: Volume[]): [Volume, Volume] | null {
  const images = volumes.filter(volume => !isLabelMap(volume));
  const [a, b, ...more] = images;
  if (a && b && more.length === 0 && a.id !== b.id) return [a, b];
  const studies = [...byStudy(images, volume => volume).values()];
  const [first, ...others] = studies.flatMap(study => pairsOf(study).pairs.slice(0, 1));
  return first && others.length === 0 ? [first.stress, first.rest] : null;
}
