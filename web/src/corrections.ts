// Which fits of a scan were corrected by hand, and whether a comparison of rest and stress is older than one of them.

import type { Result } from "./api";
import { resultsOf } from "./library";
import type { Role } from "./pairing";
import { isBeat, isFit } from "./words";

/** The corrections that beats have as well: their gates follow the image, not a contour that was pulled. */
export const BEAT_CORRECTIONS = ["center", "axis", "base", "segments_from"];

/** The parameters of a fit that a comparison keeps of a corrected one, under the name of the scan's role. */
export const CORRECTIONS = [...BEAT_CORRECTIONS, "inner_through", "outer_through"];

export const correctionName = (role: Role, name: string): string => `${role}_${name}`;

/** The names that corrections of that scan have among the parameters of a comparison. */
export const correctionsOf = (role: Role): string[] => CORRECTIONS.map(name => correctionName(role, name));

/** The fits of a scan that somebody corrected, the newest first. */
export function correctedFits(volume: string): Result[] {
  return resultsOf(volume).filter(
    result => (isFit(result.id) || isBeat(result.id)) && CORRECTIONS.some(name => result.parameters[name] != null),
  );
}

/** The newest corrected fit of each scan of a comparison that was made after it and says something else. */
export function newerCorrections(made: Result): [Role, Result][] {
  const scans: [Role, string][] = [
    ["stress", made.volume],
    ["rest", String(made.parameters["rest"])],
  ];
  return scans.flatMap(([role, volume]): [Role, Result][] => {
    const fit = correctedFits(volume)[0];
    if (!fit || Date.parse(fit.created_at) <= Date.parse(made.created_at)) return [];
    const same = CORRECTIONS.every(
      name =>
        JSON.stringify(fit.parameters[name] ?? null) ===
        JSON.stringify(made.parameters[correctionName(role, name)] ?? null),
    );
    return same ? [] : [[role, fit]];
  });
}
