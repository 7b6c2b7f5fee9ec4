// One figure of all scans by date.

import { type Figure, figureOf, written } from "../figures";
import type { SerialReport } from "../generated/openapi";
import { number } from "../words";
import { changeOf, ofChange, scanName, verdictWords } from "./serial";

const [WIDTH, HEIGHT] = [440, 226];
const AREA = { left: 44, right: 428, top: 30, bottom: 178 };
/** Pixels between the marks of two scans at least, and between two dates below them. */
const [LEAST_GAP, DATE_GAP] = [18, 72];
/** Pixels beside the first and the last mark. */
const ASIDE = 32;
/** Share of the range that stays free above and below. */
const ROOM = 0.12;
const DAY = 86_400_000;

interface Point {
  scan: number;
  x: number;
  value: number;
  /** The 95 % interval of the change against the first scan, about its figure. */
  ends: [number, number] | null;
  words: string;
}

/** The places of scans across: by their dates where all have one, apart enough to be told from each other. */
function placesOf({ scans }: SerialReport): number[] {
  const days = scans.map(({ date }, n) => (scans.every(scan => scan.date) ? Date.parse(date ?? "") / DAY : n));
  const [first = 0, last = 1] = [days[0], days.at(-1)];
  const width = AREA.right - AREA.left - 2 * ASIDE;
  const gap = Math.min(LEAST_GAP, width / Math.max(1, scans.length - 1));
  const places = days.map(day => (last > first ? ((day - first) / (last - first)) * width : 0));
  for (let n = 1; n < places.length; n++) places[n] = Math.max(places[n]!, places[n - 1]! + gap);
  const scale = width / Math.max(width, places.at(-1) ?? 0);
  return places.map(place => AREA.left + ASIDE + place * scale);
}

function pointsOf(report: SerialReport, figure: Figure): Point[] {
  const places = placesOf(report);
  const first = report.scans.map(scan => figureOf(figure, scan)).find(value => value !== undefined) ?? 0;
  return report.scans.flatMap((scan, n): Point[] => {
    const value = figureOf(figure, scan);
    if (value === undefined) return [];
    const change = changeOf(report, figure, { earlier: 1, later: scan.number });
    const [low, high] = change?.interval ?? [];
    const changed = change
      ? `, change against scan 1 ${written(ofChange(figure), change.change)}, 95 %: ${number(low, figure.digits)} to ${number(high, figure.digits)}; changed: ${verdictWords(change.verdict)}`
      : "";
    return [
      {
        scan: scan.number,
        x: places[n]!,
        value,
        ends: low !== undefined && high !== undefined ? [first + low, first + high] : null,
        words: `${scanName(scan)}: ${written(figure, value)}${changed}`,
      },
    ];
  });
}

export function Trend({ report, figure }: { report: SerialReport; figure: Figure }) {
  const points = pointsOf(report, figure);
  const all = points.flatMap(({ value, ends }) => [value, ...(ends ?? [])]);
  const [least, most] = [Math.min(...all), Math.max(...all)];
  const room = ROOM * Math.max(1, most - least);
  const up = (value: number) =>
    AREA.bottom - ((AREA.bottom - AREA.top) * (value - least + room)) / (most - least + 2 * room);
  const first = points[0];
  let dated = -Infinity;
  return (
    <svg
      class="chart trend"
      viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
      role="img"
      aria-label={`${figure.label} by date. ${points.map(point => point.words).join(". ")}`}>
      <text x={8} y={16} text-anchor="start">
        {figure.label}
        {figure.unit && `, ${figure.unit}`}
      </text>
      {[least, most].map(value => (
        <g key={value}>
          <line class="grid-line" x1={AREA.left} x2={AREA.right} y1={up(value)} y2={up(value)} />
          <text x={AREA.left - 6} y={up(value) + 4} text-anchor="end">
            {number(value, figure.digits)}
          </text>
        </g>
      ))}
      {first && <line class="first" x1={AREA.left} x2={AREA.right} y1={up(first.value)} y2={up(first.value)} />}
      {points.map(
        ({ scan, x, ends }) =>
          ends && (
            <g key={scan} class="whisker">
              <line x1={x} x2={x} y1={up(ends[0])} y2={up(ends[1])} />
              {ends.map(end => (
                <line key={end} x1={x - 5} x2={x + 5} y1={up(end)} y2={up(end)} />
              ))}
            </g>
          ),
      )}
      <polyline points={points.map(({ x, value }) => `${x.toFixed(1)},${up(value).toFixed(1)}`).join(" ")} />
      {points.map(({ scan, x, value, words }) => (
        <circle key={scan} cx={x} cy={up(value)} r={4.5}>
          <title>{words}</title>
        </circle>
      ))}
      {points.map(({ scan, x }) => {
        const { date } = report.scans.find(one => one.number === scan) ?? {};
        const shown = date && x - dated >= DATE_GAP;
        if (shown) dated = x;
        return (
          <g key={scan}>
            <text x={x} y={AREA.bottom + 20} text-anchor="middle">
              {scan}
            </text>
            {shown && (
              <text x={x} y={AREA.bottom + 38} text-anchor="middle">
                {date}
              </text>
            )}
          </g>
        );
      })}
    </svg>
  );
}
