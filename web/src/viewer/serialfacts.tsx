// What a serial comparison says in figures and words.

import { type Figure, PartTable, figureOf, intervalOf, rowsOf, verdictOf, written } from "../figures";
import type { FigureChange, SerialReport, SerialScan, SerialSegment } from "../generated/openapi";
import { normals } from "../library";
import { Simulated } from "../limits";
import { statedRole } from "../pairing";
import { useWatched } from "../state";
import { cut, nameOf, number } from "../words";
import {
  type Pair,
  type Series,
  changeOf,
  figuresIn,
  firstAndLast,
  oddScans,
  ofChange,
  pairName,
  uptakeOf,
  verdictWords,
} from "./serial";

/** Most changes of figures among the headlines. */
const HEADLINES = 4;

/** What is said of the wall's uptake between two scans. */
const ANSWERED = rowsOf("SerialPair").filter(row => row.verdict);

function endsOf(row: Figure, [low, high]: number[]): string {
  return `${written(row, low, false)} to ${written(row, high, false)}`;
}

/** What changed from the first to the last scan. */
export function SerialHeadlines({ report }: { report: SerialReport }) {
  const pair = firstAndLast(report);
  const uptake = uptakeOf(report, pair);
  const changes = figuresIn(report).flatMap((row): [Figure, FigureChange][] => {
    const change = changeOf(report, row, pair);
    return change ? [[row, change]] : [];
  });
  return (
    <section aria-label="What changed">
      <p class="quiet">What changed {pairName(report, pair)}</p>
      <dl class="headlines compared-headlines">
        {changes.slice(0, HEADLINES).map(([row, { change, interval, verdict }]) => (
          <div key={row.place}>
            <dt title={row.about}>{row.label}</dt>
            <dd>
              {written(ofChange(row), change)}
              <span class="interval">
                95 %: {endsOf(ofChange(row), interval)}; changed: {verdictWords(verdict)}
              </span>
            </dd>
          </div>
        ))}
        {uptake &&
          ANSWERED.map(row => (
            <div key={row.place}>
              <dt title={row.about}>{row.label} wall</dt>
              <dd>
                {written(row, figureOf(row, uptake))}
                <span class="interval">
                  90 %: {intervalOf(row, uptake)}; changed: {verdictOf(row, uptake)}
                </span>
              </dd>
            </div>
          ))}
      </dl>
    </section>
  );
}

/** Every figure by date, and how it changed between two scans. */
export function FiguresByDate({ report, pair }: { report: SerialReport; pair: Pair }) {
  const { scans } = report;
  const uptake = uptakeOf(report, pair);
  return (
    <table class="segments by-date">
      <caption class="hidden">Figures by date, and their changes {pairName(report, pair)}</caption>
      <thead>
        <tr>
          <th scope="col">Figure</th>
          {scans.map(scan => (
            <th key={scan.number} scope="col">
              Scan {scan.number}
              {scan.date && <span class="interval">{scan.date}</span>}
            </th>
          ))}
          <th scope="col">Change</th>
          <th scope="col">95 % interval</th>
          <th scope="col">Changed</th>
          <th scope="col">Least change that would show</th>
        </tr>
      </thead>
      <tbody>
        {figuresIn(report).map(row => (
          <tr key={row.place}>
            <th scope="row" title={row.about}>
              {row.label}
              {row.unit && `, ${row.unit}`}
            </th>
            {scans.map(scan => (
              <td key={scan.number}>{written(row, figureOf(row, scan), false)}</td>
            ))}
            <Change row={row} change={changeOf(report, row, pair)} />
          </tr>
        ))}
        {uptake &&
          ANSWERED.map(row => (
            <tr key={row.place}>
              <th scope="row" title={row.about}>
                {row.label} wall, {row.unit}
              </th>
              <td colSpan={scans.length} class="quiet">
                –
              </td>
              <td>{written(row, figureOf(row, uptake))}</td>
              <td>{intervalOf(row, uptake)} (90 %)</td>
              <td class={`told ${verdictOf(row, uptake) === "yes" ? "yes" : ""}`}>{verdictOf(row, uptake)}</td>
              <td>{number(uptake.detectable_percent, 0, "%")}</td>
            </tr>
          ))}
      </tbody>
    </table>
  );
}

function Change({ row, change }: { row: Figure; change: FigureChange | undefined }) {
  if (!change) return <td colSpan={4}>–</td>;
  const changed = ofChange(row);
  return (
    <>
      <td>{written(changed, change.change)}</td>
      <td>{endsOf(changed, change.interval)}</td>
      <td class={`told ${change.verdict}`}>{verdictWords(change.verdict)}</td>
      <td>{number(change.least_change, row.digits, changed.unit)}</td>
    </>
  );
}

/** How the changes are to be read. */
export function ChangesHint() {
  return (
    <p class="quiet">
      Changed: yes, if the 95 % interval of the change excludes none; no, if it excludes a change that matters; cannot
      tell otherwise. The least change is what nine of ten such pairs of scans would show; of worse and better wall, the
      least loss of a territory.
    </p>
  );
}

/** The rows of a segment, the change of its uptake last: its interval and whether it changed stand beside it. */
const OF_SEGMENT = rowsOf("SerialSegment").toSorted((a, b) => Number(Boolean(a.verdict)) - Number(Boolean(b.verdict)));

function Segments({ of, caption }: { of: SerialSegment[]; caption: string }) {
  return (
    <div class="wide" tabIndex={0} role="region" aria-label={caption}>
      <PartTable
        caption={caption}
        head="Segment"
        parts={of}
        nameOf={one => `${one.segment} ${one.name}`}
        rows={OF_SEGMENT}
        more={[
          [
            "95 % interval",
            ({ change_interval_points: ends }) => (ends ? `${number(ends[0], 0)} to ${number(ends[1], 0)}` : "–"),
          ],
          ["changed", ({ change_verdict }) => verdictWords(change_verdict)],
        ]}
      />
    </div>
  );
}

/** The segments that changed between two scans, and all of them where somebody asks. */
export function SegmentsOfPair({ report, pair }: { report: SerialReport; pair: Pair }) {
  const segments = uptakeOf(report, pair)?.segments ?? [];
  const changed = segments.filter(one => one.change_verdict === "yes");
  const unknown = segments.filter(one => one.change_verdict === "cannot_tell").length;
  return (
    <>
      {changed.length > 0 ? (
        <Segments of={changed} caption="Segments that changed" />
      ) : (
        <p>No segment is told to have changed.</p>
      )}
      {unknown > 0 && (
        <p class="quiet">
          The scans cannot tell whether {unknown} other {unknown === 1 ? "segment" : "segments"} changed.
        </p>
      )}
      <details>
        <summary>All segments</summary>
        <Segments of={segments} caption="All segments" />
      </details>
    </>
  );
}

/** The scans in their order, and what was stated of them. */
export function ScansInOrder({ series: { report, volumes } }: { series: Series }) {
  const odd = oddScans(report);
  const isDated = !report.flags.some(flag => flag.code === "dates_not_stated");
  return (
    <section class="serial-scans" aria-label="Scans">
      <ol>
        {report.scans.map((scan, n) => {
          const volume = volumes[n];
          const role = volume && statedRole(volume);
          return (
            <li key={scan.number}>
              <p>
                <b>Scan {scan.number}</b> {scan.date ?? "no date"} {role && <span class={`role ${role}`}>{role}</span>}{" "}
                {odd.includes(scan.number) && <span class="warning">may be the odd one</span>}
              </p>
              <p>
                {volume ? (
                  <a href={`#/scan/${volume.id}`} title={nameOf(volume)}>
                    {cut(nameOf(volume))}
                  </a>
                ) : (
                  <span class="quiet">erased</span>
                )}
                {scan.series_description && ` ${scan.series_description}`}
              </p>
              <p class="quiet">{particularsOf(scan)}</p>
              {scan.warnings.map(text => (
                <p key={text} class="warning">
                  {text}
                </p>
              ))}
            </li>
          );
        })}
      </ol>
      <p class="quiet">
        {isDated ? "In the order of the dates in their headers." : "In the order in which they were given."}{" "}
        {report.parameters["same_patient"] === true && "It was stated that all are of one patient. "}
        {typeof report.parameters["mass_g"] === "number" &&
          `The mass of the muscle was stated: ${number(report.parameters["mass_g"], 0, "g")}. `}
        {report.gated ? "All are gated: a beat is fitted to each." : "Not all are gated, so there are no beats."}
      </p>
      <Limits report={report} />
    </section>
  );
}

function particularsOf(scan: SerialScan): string {
  return [
    `confidence of the fit ${number(100 * scan.confidence, 0, "%")}`,
    scan.number > 1 && `moved ${number(scan.moved_mm, 1, "mm")}, turned ${number(scan.turned_degrees, 0)}°`,
    scan.resolution_mm && `resolution ${number(scan.resolution_mm.value, 1, "mm")}`,
    scan.beats_per_minute != null && `${number(scan.beats_per_minute, 0)} beats a minute`,
  ]
    .filter(Boolean)
    .join(" · ");
}

/** By which normal limits all scans are scored. */
function Limits({ report }: { report: SerialReport }) {
  const known = useWatched(normals);
  const id = report.parameters["normals"];
  if (typeof id !== "string") return null;
  const limits = known.find(one => one.id === id);
  return (
    <p class="quiet">
      Scored by normal limits{limits ? ` “${limits.name}”` : ""}. {limits?.summary.simulated && <Simulated />}
    </p>
  );
}
