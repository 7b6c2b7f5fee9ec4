// Results as they are read: which scans are scored, their automatic scores, and the sentences that are offered.

import { type Readable, SEGMENTS, type Scored, type ScoredScan } from "../reading";
import type { Compared } from "./compared";
import type { Loaded } from "./loaded";

type Named = { number: number; name: string }[];

function segmentNames(named: Named): string[] {
  return Array.from({ length: SEGMENTS }, (_, at) => named.find(({ number }) => number === at + 1)?.name ?? "");
}

function scored(scan: ScoredScan, scores: [number, number | null | undefined][]): Scored {
  const automatic = Array.from({ length: SEGMENTS }, (_, at) => scores.find(([n]) => n === at + 1)?.[1] ?? null);
  return { scan, automatic: automatic.some(score => score !== null) ? automatic : null };
}

export function readableComparison({ result, report }: Compared): Readable {
  const { segments } = report;
  return {
    result,
    scans: [
      scored(
        "stress",
        segments.map(one => [one.segment, one.stress_score]),
      ),
      scored(
        "rest",
        segments.map(one => [one.segment, one.rest_score]),
      ),
    ],
    segments: segmentNames(segments.map(({ segment, name }) => ({ number: segment, name }))),
    offered: report.impression ?? [],
  };
}

/** A fit or a beat; null of other results, which are not read. */
export function readableScan({ result, report, beat, polar }: Loaded): Readable | null {
  const own = report ?? beat?.report;
  if (!own) return null;
  const segments = own.perfusion?.segments ?? [];
  return {
    result,
    scans: [
      scored(
        "scan",
        segments.map(one => [one.segment, one.score]),
      ),
    ],
    segments: segmentNames(polar?.segments ?? []),
    offered: own.impression ?? [],
  };
}
