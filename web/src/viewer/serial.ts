// A serial comparison with all that its view shows, and how its scans, pairs and figures are called.

import { type FileOfResult, type Result, type Volume, get } from "../api";
import { type Figure, figureOf, rowsOf } from "../figures";
import type {
  FigureChange,
  PolarFigure,
  PolarMap,
  SerialPair,
  SerialReport,
  SerialScan,
  Verdict,
} from "../generated/openapi";
import { isoDay } from "../words";
import type { TitledMap } from "./mapsrow";
import { figureMap, uptakeMap } from "./polar";

/** Two scans that are compared, by their numbers. */
export interface Pair {
  earlier: number;
  later: number;
}

export interface Series {
  result: Result;
  report: SerialReport;
  /** The scans in the order of the report; null where a scan was erased. */
  volumes: (Volume | null)[];
  /** The uptake of every scan that has a map. */
  uptake: TitledMap[];
  /** What every pair of scans differs by, all in one scale. */
  changes: (Pair & { named: TitledMap })[];
}

const two = (number: number) => String(number).padStart(2, "0");

/** Both ends of all ranges, so that one scale is that of all. */
function inOneScale(maps: (Pair & { named: TitledMap })[]): (Pair & { named: TitledMap })[] {
  const ends = maps.flatMap(({ named }) => named.map.range);
  const range: [number, number] = [Math.min(...ends), Math.max(...ends)];
  return maps.map(one => ({ ...one, named: { ...one.named, map: { ...one.named.map, range } } }));
}

/** What the header of a scan states; the service keeps it beside the scan, and not in reports. */
function statedOf(volume: Volume | null | undefined): Partial<SerialScan> {
  const { acquisition_date, study_date, series_description } = volume?.dicom ?? {};
  const date = acquisition_date ?? study_date;
  return { ...(date ? { date: isoDay(date) } : {}), ...(series_description ? { series_description } : {}) };
}

export async function loadSeries(result: Result): Promise<Series> {
  const file = (name: string): FileOfResult | undefined => result.files.find(one => one.name === name);
  const json = async <T>(name: string): Promise<T | null> => {
    const found = file(name);
    return found ? get<T>(found.href) : null;
  };
  const stored = await json<SerialReport>("serial.json");
  if (!stored) throw new Error("This comparison has no report.");
  const given = result.links.volumes ?? [];
  const volumes = await Promise.all(
    stored.scans.map(scan => {
      const path = given[scan.given - 1];
      return path ? get<Volume>(path).catch(() => null) : null;
    }),
  );
  const report = { ...stored, scans: stored.scans.map((scan, n) => ({ ...scan, ...statedOf(volumes[n]) })) };
  const [uptake, changes] = await Promise.all([
    Promise.all(report.scans.map(({ number }) => json<PolarMap>(`polar_scan${two(number)}.json`))),
    Promise.all(
      report.pairs.map(({ earlier, later }) => json<PolarFigure>(`polar_change_${two(earlier)}_${two(later)}.json`)),
    ),
  ]);
  return {
    result,
    report,
    volumes,
    uptake: report.scans.flatMap((scan, n): TitledMap[] => {
      const map = uptake[n];
      const name = scanName(scan);
      return map ? [{ name: `Uptake, ${name}`, short: name, map: uptakeMap(map), figure: "uptake" }] : [];
    }),
    changes: inOneScale(
      report.pairs.flatMap(({ earlier, later }, n) => {
        const map = changes[n];
        const name = `Scan ${earlier} less scan ${later}`;
        return map
          ? [{ earlier, later, named: { name, short: name, map: figureMap(map), figure: "difference" as const } }]
          : [];
      }),
    ),
  };
}

/** A scan by its number, and its date where it has one. */
export function scanName({ number, date }: Pick<SerialScan, "number" | "date">): string {
  return date ? `Scan ${number}, ${date}` : `Scan ${number}`;
}

const dateOf = ({ scans }: SerialReport, number: number): string => {
  const date = scans.find(scan => scan.number === number)?.date;
  return date ? ` (${date})` : "";
};

/** `from scan 1 (2022-03-10) to scan 3 (2025-01-15)`. */
export function pairName(report: SerialReport, { earlier, later }: Pair): string {
  return `from scan ${earlier}${dateOf(report, earlier)} to scan ${later}${dateOf(report, later)}`;
}

/** The pair of the first and the last scan. */
export function firstAndLast({ scans }: SerialReport): Pair {
  return { earlier: 1, later: scans.length };
}

/** The figures that two scans have. */
export function figuresIn({ scans }: SerialReport): Figure[] {
  return rowsOf("SerialScan").filter(row => scans.filter(scan => figureOf(row, scan) !== undefined).length > 1);
}

export function changeOf({ changes }: SerialReport, figure: Figure, pair: Pair): FigureChange | undefined {
  return changes.find(one => one.figure === figure.place && one.earlier === pair.earlier && one.later === pair.later);
}

export function uptakeOf({ pairs }: SerialReport, pair: Pair): SerialPair | undefined {
  return pairs.find(one => one.earlier === pair.earlier && one.later === pair.later);
}

/** The row of a figure's change: shares change by points. */
export function ofChange(row: Figure): Figure {
  return { ...row, unit: row.unit === "%" ? "points" : row.unit, signed: true };
}

export function verdictWords(verdict: Verdict | null | undefined): string {
  return verdict ? verdict.replaceAll("_", " ") : "–";
}

/** The numbers of scans that differ from their neighbours, which agree. */
export function oddScans({ flags }: SerialReport): number[] {
  return flags.flatMap(({ code, reason }) => {
    const [, number] = /^scan (\d+) /.exec(code === "odd_scan" ? reason : "") ?? [];
    return number ? [Number(number)] : [];
  });
}

/** A reason with figures by the names that people read. */
export function spoken(reason: string): string {
  return rowsOf("SerialScan").reduce((text, row) => text.replace(row.place, `“${row.label}”`), reason);
}
