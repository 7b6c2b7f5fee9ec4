// Which scans of a patient's studies are compared over the years: of each study one, all at stress or all at rest, of
// one kind and one tracer.

import type { Volume } from "./api";
import { type Alike, type Role, isOfUptake, isSame, mayBeSame, statedRole } from "./pairing";
import { GATED, KINDS, kindOf, mayAgree } from "./scankind";
import { isoDay } from "./words";

/** Most scans that the service compares at once. */
const MOST_SCANS = 20;

/** Scans that can be compared, the earliest first. */
export interface Years {
  scans: Volume[];
  role: Role | null;
  /** Which scans these are, and which studies are left out and why, in sentences. */
  said: string[];
}

/** What can be compared of a study and those before it, and in sentences why the rest cannot. */
export interface Offer {
  years: Years[];
  why: string[];
}

/** Scans of which only some are gated are compared by their images of all gates. */
const mayBeSameButGates: Alike = (a, b) => KINDS.every(kind => kind === GATED || mayAgree(kind, a, b));

const plain = (text: string | null | undefined) => text?.trim().toUpperCase() ?? "";

/** Whether no header names another tracer. */
const mayBeOfOneTracer: Alike = (a, b) =>
  (["radiopharmaceutical", "radionuclide"] as const).every(name => {
    const [one, other] = [plain(a.dicom?.[name]), plain(b.dicom?.[name])];
    return one === "" || other === "" || one === other;
  });

const dayOf = (volume: Volume | undefined) => isoDay(volume?.dicom?.study_date ?? "");

/** `a, b and c`. */
function listed(texts: string[]): string {
  return texts.length > 1 ? `${texts.slice(0, -1).join(", ")} and ${texts.at(-1)}` : texts.join("");
}

const at = (role: Role | null) => (role ? `at ${role}` : "that say neither rest nor stress");

/** The scans of `study` that may be compared with all that were taken: those of exactly the kind first. */
function alikeIn(study: Volume[], taken: Volume[]): Volume[] {
  const [first] = taken;
  if (!first) return [];
  const fitting = study.filter(scan => taken.every(one => mayBeOfOneTracer(one, scan) && mayBeSameButGates(one, scan)));
  for (const alike of [isSame, mayBeSame, mayBeSameButGates]) {
    const found = fitting.filter(scan => alike(first, scan));
    if (found.length > 0) return found;
  }
  return [];
}

/** The scans that are compared with one scan, and in sentences which studies are left out. */
function withScan(scan: Volume, before: Volume[][]): { scans: Volume[]; left: string[] } {
  const [scans, left]: [Volume[], string[]] = [[scan], []];
  for (const study of before) {
    if (scans.length === MOST_SCANS) {
      left.push(`Earlier ones are left out: at most ${MOST_SCANS} scans are compared at once.`);
      break;
    }
    const [found, ...more] = alikeIn(study, scans);
    if (found && more.length === 0) scans.unshift(found);
    else
      left.push(
        `The study of ${dayOf(study[0])} is left out: it has ${found ? "more than one" : "no"} scan like these.`,
      );
  }
  return { scans, left };
}

/** The kinds of a scan as a text that sorts: what goes first is smaller. */
const rank = (scan: Volume) => KINDS.map(kind => (kind.of(scan) === kind.first ? 0 : 1)).join("");

/** What is compared of one role, or why nothing is. */
function ofRole(role: Role | null, study: Volume[], before: Volume[][]): Years | string {
  const isOf = (scan: Volume) => statedRole(scan) === role;
  const [own, earlier] = [study.filter(isOf), before.map(scans => scans.filter(isOf))];
  const all = [...own, ...earlier.flat()];
  if (all.length === own.length) return `No earlier study has a scan ${at(role)}.`;
  const alone = own.filter(scan => own.filter(one => isSame(scan, one) && mayBeOfOneTracer(scan, one)).length === 1);
  const [best] = alone
    .sort((a, b) => rank(a).localeCompare(rank(b)))
    .map(scan => withScan(scan, earlier))
    .sort((a, b) => b.scans.length - a.scans.length);
  if (!best)
    return `This study has more than one scan ${at(role)} of each kind: none is taken to compare over the years.`;
  const kind = kindOf(best.scans, all);
  const tells = `${at(role)}${kind && `, ${kind}`}`;
  if (best.scans.length < 2)
    return `No earlier study has one scan ${at(role)} of the same kind${kind && ` (${kind})`} and tracer.`;
  const mixed = new Set(best.scans.map(scan => scan.gates != null)).size > 1;
  return {
    scans: best.scans,
    role,
    said: [
      `Takes the scans ${tells}: ${listed(best.scans.map(dayOf))}.`,
      ...(mixed ? ["Not all are gated, so there is no ejection fraction."] : []),
      ...best.left,
    ],
  };
}

/** What of a study is compared with the studies before it, the latest of which comes first. */
export function yearsOf(study: Volume[], before: Volume[][]): Offer {
  const [now, earlier] = [study.filter(isOfUptake), before.map(scans => scans.filter(isOfUptake))];
  const roles = (["stress", "rest", null] as const).filter(role => now.some(scan => statedRole(scan) === role));
  const found = earlier.length > 0 ? roles.map(role => ofRole(role, now, earlier)) : [];
  return {
    years: found.filter(one => typeof one !== "string"),
    why: found.filter(one => typeof one === "string"),
  };
}
