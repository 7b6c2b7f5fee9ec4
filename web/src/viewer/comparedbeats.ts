// Which stored beats belong to a comparison of gated scans. The comparison keeps figures of both beats only: curves, the
// walls of single gates and their maps are those of a beat of each scan, fitted in the same way.

import type { ParameterValue, Result, Volume } from "../api";
import { BEAT_CORRECTIONS, correctionName } from "../corrections";
import type { BeatChange, ComparisonReport } from "../generated/openapi";
import { resultsOf } from "../library";
import { draftOf, parameterSpecs, valuesOf } from "../parameters";
import { isBeat } from "../words";
import { file } from "../work";
import type { WhichScan } from "./compared";
import type { OfBoth } from "./comparedgates";
import type { Loaded } from "./loaded";

/** Volumes that differ by less are of one fit. */
const SAME_ML = 0.01;

function figuresAt(beat: BeatChange, scan: WhichScan): { edv_ml: number; esv_ml: number } {
  return scan === "stress"
    ? { edv_ml: beat.stress_edv_ml, esv_ml: beat.stress_esv_ml }
    : { edv_ml: beat.rest_edv_ml, esv_ml: beat.rest_esv_ml };
}

/** Whether a beat has the volumes that the comparison states of a scan. */
export function isSameBeat(
  found: { edv_ml?: number | null | undefined; esv_ml?: number | null | undefined },
  beat: BeatChange,
  scan: WhichScan,
): boolean {
  const own = figuresAt(beat, scan);
  const near = (name: "edv_ml" | "esv_ml") => Math.abs((found[name] ?? NaN) - own[name]) < SAME_ML;
  return near("edv_ml") && near("esv_ml");
}

/** The stored beat of a scan: the one that the comparison's figures are of, else the newest with the same corrections. */
export function beatOf(made: Result, beat: BeatChange, scan: WhichScan, volume: string): Result | null {
  const all = resultsOf(volume).filter(result => isBeat(result.id));
  const corrected = (result: Result) =>
    BEAT_CORRECTIONS.every(
      name =>
        JSON.stringify(made.parameters[correctionName(scan, name)] ?? null) ===
        JSON.stringify(result.parameters[name] ?? null),
    );
  return all.find(({ summary }) => isSameBeat(summary, beat, scan)) ?? all.find(corrected) ?? null;
}

/** Fits the beats of the scans that have none, as the comparison has fitted them. */
export async function fitBeats(
  made: Result,
  report: ComparisonReport,
  scans: OfBoth<Volume>,
  beats: OfBoth<Loaded | null>,
): Promise<void> {
  const specs = (await parameterSpecs()).beat;
  for (const scan of ["stress", "rest"] as const) {
    if (beats[scan]) continue;
    const { normals: _, ...own } = valuesOf(draftOf(made.parameters, specs), specs);
    const parameters: Record<string, ParameterValue> = { ...own, kept_model: report[scan].template };
    for (const name of BEAT_CORRECTIONS) {
      const value = made.parameters[correctionName(scan, name)];
      if (value != null) parameters[name] = value;
    }
    await file("beat", scans[scan], parameters);
  }
}
