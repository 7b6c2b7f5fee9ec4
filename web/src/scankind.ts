// Of which kind a scan is: what tells the series of one study from each other beside stress and rest.

import type { Volume } from "./api";

interface Kind {
  /** The words for a scan that is so, and for one that is not. */
  words: [string, string];
  /** Which of both goes first. */
  first: boolean;
  /** Which of both the row of a scan says; it has the number of gates elsewhere. */
  inRow: (is: boolean) => boolean;
  /** Whether a scan is so; null where neither header nor description tells. */
  of: (volume: Volume) => boolean | null;
}

/** Whether a description has one of these words, by itself or after a word for the scan, as in `RestAC`. */
function says({ dicom }: Volume, words: string[]): boolean {
  const text = dicom?.series_description?.toLowerCase() ?? "";
  return words.some(word => new RegExp(`(^|[^a-z]|stress|rest|gated)${word}([^a-z]|$)`).test(text));
}

const UNCORRECTED = ["nac", "nc", "irnc", "noac", "(no|non|without)[ _-]ac", "uncorrected"];
const CORRECTED = ["ac", "irac", "ctac", "attenuation[ _-]corrected"];

function isCorrected(volume: Volume): boolean | null {
  const stated = volume.dicom?.corrected_image;
  if (stated?.split("\\").some(one => one.trim() === "ATTN")) return true;
  if (says(volume, UNCORRECTED)) return false;
  if (says(volume, CORRECTED)) return true;
  return stated ? false : null;
}

function isProne(volume: Volume): boolean | null {
  const stated = volume.dicom?.patient_position?.trim() ?? "";
  const [, side] = /^(?:HF|FF)([PS])$/.exec(stated) ?? [];
  if (side) return side === "P";
  const is = (word: string) => stated.toLowerCase().includes(word) || says(volume, [word]);
  if (is("prone") === is("supine")) return null;
  return is("prone");
}

/** Whether the slices are reconstructed by the service, of projections. */
function areProjections({ dicom }: Volume): boolean | null {
  const type = dicom?.image_type?.split("\\")[2]?.trim();
  return type ? type === "TOMO" || type === "GATED TOMO" : null;
}

/** Whether a scan is of PET; null where it may be of PET or SPECT. */
function isPet({ dicom }: Volume): boolean | null {
  const modality = dicom?.modality?.trim();
  return modality ? modality === "PT" : null;
}

export const GATED: Kind = {
  words: ["gated", "not gated"],
  first: true,
  inRow: () => false,
  of: volume => volume.gates != null,
};

/** What is told of a scan, the most telling first. */
export const KINDS: Kind[] = [
  GATED,
  { words: ["attenuation corrected", "not corrected"], first: true, inRow: () => true, of: isCorrected },
  { words: ["prone", "supine"], first: false, inRow: is => is, of: isProne },
  { words: ["projections", "slices"], first: false, inRow: is => is, of: areProjections },
  { words: ["PET", "SPECT"], first: false, inRow: () => false, of: isPet },
];

/** Whether no header contradicts that two scans agree in this. */
export function mayAgree(kind: Kind, a: Volume, b: Volume): boolean {
  const [one, other] = [kind.of(a), kind.of(b)];
  return one === null || other === null || one === other;
}

const word = (kind: Kind, volume: Volume): string[] => {
  const is = kind.of(volume);
  return is === null ? [] : [kind.words[is ? 0 : 1]];
};

/** In words, what tells scans of one kind from the others of `all`, where they agree in it; empty if nothing does. */
export function kindOf(scans: Volume[], all: Volume[]): string {
  const telling = KINDS.filter(
    kind => new Set(all.map(kind.of)).size > 1 && scans.every(a => scans.every(b => mayAgree(kind, a, b))),
  );
  const words = telling.flatMap(kind => scans.flatMap(scan => word(kind, scan)).slice(0, 1));
  return words.join(", ");
}

/** In words, what the row of a scan says of its kind. */
export function toldOf(volume: Volume): string {
  return KINDS.filter(kind => kind.inRow(kind.of(volume) ?? false))
    .flatMap(kind => word(kind, volume))
    .join(", ");
}
