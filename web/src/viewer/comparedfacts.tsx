// What a comparison says in figures and words.

import type { ComponentChildren } from "preact";
import type { Result } from "../api";
import { newerCorrections } from "../corrections";
import {
  BesideTable,
  type Figure,
  PartTable,
  figureOf,
  flatName,
  intervalOf,
  meaningOf,
  rowsOf,
  verdictOf,
  written,
} from "../figures";
import type { BeatReport, ComparedScan, ComparisonReport, Perfusion } from "../generated/openapi";
import { beats, fits } from "../library";
import { Simulated } from "../limits";
import { useWatched } from "../state";
import { moment, number } from "../words";
import { type Compared, flagsOf, isSimulated } from "./compared";
import { useSegmentMarks } from "./comparedmaps";
import type { ComparedScene } from "./comparedscene";

/** The figures that are read first: name, figure, what stands smaller beside it, and what it is. */
export function headlinesOf(report: ComparisonReport): [string, string, string, string][] {
  const beside = besideHeadlines(report);
  return rowsOf("ComparisonReport")
    .filter(row => row.short && figureOf(row, report) !== undefined)
    .map(row => [
      capital(row.short!),
      written(row, figureOf(row, report)),
      [beside[row.place], intervalOf(row, report) && `90 %: ${intervalOf(row, report)}`, verdictOf(row, report)]
        .filter(Boolean)
        .join("; "),
      meaningOf(row),
    ]);
}

const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);

/** What stands beside a headline, by its place. */
function besideHeadlines(report: ComparisonReport): Record<string, string> {
  const isUncertain = report.flags.some(flag => flag.code === "tid_uncertain");
  const { summed_percent, beat, stress, rest } = report;
  const [sss, srs, sds] = (summed_percent ?? []).map(share => number(share, 0, "%"));
  return {
    tid: `${number(stress.cavity_ml, 0)}\u00a0/\u00a0${number(rest.cavity_ml, 0, "ml")}${isUncertain ? ", uncertain" : ""}`,
    reversible_percent: "of the wall",
    fixed_percent: "of the wall",
    sss: sss ?? "",
    srs: srs ?? "",
    sds: sds ?? "",
    "beat/ef_change_points": `${number(beat?.stress_ef_percent, 0)} / ${number(beat?.rest_ef_percent, 0, "%")}`,
  };
}

export function Headlines({ report }: { report: ComparisonReport }) {
  return (
    <dl class="headlines compared-headlines">
      {headlinesOf(report).map(([name, value, beside, about]) => (
        <div key={name}>
          <dt title={about}>{name}</dt>
          <dd>
            {value}
            {beside && <span class="interval">{beside}</span>}
          </dd>
        </div>
      ))}
    </dl>
  );
}

/** What tells both measures of the change apart, where both stand. */
export function BothMeasures({ report }: { report: ComparisonReport }) {
  if (report.sds == null) return null;
  return (
    <p class="quiet">
      The reversible share says how large the part of the wall is that loses uptake at stress; SDS says how much it
      loses, in points of 17 segments scored 0 to 4 (in per cent of 68).
    </p>
  );
}

/** Whether both scans should not be compared at all: that is said before any figure. */
export function areNotComparable({ flags }: Pick<ComparisonReport, "flags">): boolean {
  return flags.some(flag => flag.code === "not_comparable");
}

/** Reasons to look closer, in words. */
export function Reasons({ report }: { report: Pick<ComparisonReport, "flags"> }) {
  const flags = flagsOf(report);
  return (
    <div class={flags.length ? "verdict doubt" : "verdict"}>
      {areNotComparable(report) && (
        <p>
          <b>These scans are not comparable as they are.</b>
        </p>
      )}
      {flags.length > 0 ? (
        <ul>
          {flags.map(flag => (
            <li key={flag.code + flag.reason}>{sentence(flag.reason)}</li>
          ))}
        </ul>
      ) : (
        <p class="quiet">No reason to doubt the comparison was found.</p>
      )}
    </div>
  );
}

function sentence(text: string): string {
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;
}

/** That a fit of its scans was corrected after the comparison was made; nothing where none was. */
export function Outdated({ made }: { made: Result }) {
  useWatched(fits);
  useWatched(beats);
  const newer = newerCorrections(made);
  if (newer.length === 0) return null;
  return (
    <p class="warning">
      {newer.map(([role, fit]) => `The fit at ${role} was corrected on ${moment(fit.created_at)}.`).join(" ")} This
      comparison is older and does not have the correction: compare again.
    </p>
  );
}

/** The limits by which it was scored, in words. */
export function limitsOf({ normals }: Perfusion): string {
  const people = normals.sex === "mixed" ? "men and women" : normals.sex === "F" ? "women" : "men";
  return `${normals.cases} ${people}, ${normals.protocol}, ${normals.tracer}, ${normals.attenuation_corrected ? "attenuation corrected" : "attenuation not corrected"}`;
}

/** Whether z and scores are of simulated people, and the limits' reasons to look closer. */
export function LimitsUsed({ perfusion }: { perfusion: Perfusion }) {
  return (
    <div class="limits-used">
      <p>
        Normal limits of {limitsOf(perfusion)}. {perfusion.normals.simulated && <Simulated />}
      </p>
      {perfusion.flags.length > 0 && (
        <ul>
          {perfusion.flags.map(flag => (
            <li key={flag.code + flag.reason}>{sentence(flag.reason)}</li>
          ))}
        </ul>
      )}
      <p class="quiet">{sentence(perfusion.note)}</p>
    </div>
  );
}

/** Deficit, extent and summed score of scans beside normal limits. */
export function PerfusionTable({ of }: { of: [string, Perfusion][] }) {
  const rows = rowsOf("Perfusion").filter(row => row.headline);
  return <BesideTable caption="Uptake beside normal limits" of={of} rows={rows} />;
}

/** The rows of the figures that normal limits may have. */
const LIMITED = [...rowsOf("BeatReport"), ...rowsOf("SegmentationReport")];

/** Figures of the whole heart beside the range of 95 in 100 of the people. */
export function FiguresBeside({ perfusion }: { perfusion: Perfusion }) {
  const rows = perfusion.figures.filter(one => one.segment == null);
  if (rows.length === 0) return null;
  return (
    <details>
      <summary>Figures of the heart beside their limits</summary>
      <table class="segments">
        <caption class="hidden">Figures of the heart beside their limits</caption>
        <thead>
          <tr>
            <th scope="col">Figure</th>
            <th scope="col">here</th>
            <th scope="col">95 in 100 people</th>
            <th scope="col">z</th>
          </tr>
        </thead>
        <tbody>
          {rows.map(one => {
            const row = LIMITED.find(row => flatName(row) === one.figure);
            const digits = row?.digits ?? 1;
            return (
              <tr key={one.figure}>
                <th scope="row" title={row?.about}>
                  {row?.label ?? one.figure}
                </th>
                <td>{number(one.value, digits, row?.unit)}</td>
                <td>
                  {number(one.low, digits)} to {number(one.high, digits)}
                </td>
                <td>{number(one.z, 1)}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </details>
  );
}

export function SegmentScores({ perfusion }: { perfusion: Perfusion }) {
  return (
    <>
      <PartTable
        caption="Segments beside normal limits"
        head="Segment"
        parts={perfusion.segments}
        nameOf={one => `${one.segment} ${one.name}`}
        rows={rowsOf("SegmentScore")}
      />
      <PartTable
        caption="Territories beside normal limits"
        head="Territory"
        parts={perfusion.territories}
        nameOf={one => one.name}
        rows={rowsOf("TerritoryScore")}
      />
    </>
  );
}

export function TerritoryTable({ report }: { report: ComparisonReport }) {
  return (
    <PartTable
      caption="Territories at stress and at rest"
      head="Territory"
      parts={report.territories}
      nameOf={one => one.name}
      rows={rowsOf("ComparedTerritory")}
    />
  );
}

export function SegmentChanges({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { report } = compared;
  return (
    <PartTable
      caption="Segments at stress and at rest"
      marks={useSegmentMarks(compared, scene)}
      head="Segment"
      parts={report.segments}
      nameOf={one => `${one.segment} ${one.name}`}
      rows={rowsOf("ComparedSegment")}
    />
  );
}

/** EF and volumes at stress beside those at rest. */
export function BeatTable({ report: { beat } }: { report: ComparisonReport }) {
  if (!beat) return null;
  const rows = rowsOf("BeatReport");
  const at = (scan: string) =>
    Object.fromEntries(rows.map(row => [row.place, (beat as Record<string, unknown>)[`${scan}_${row.place}`]]));
  return (
    <BesideTable
      caption="The beat at stress and at rest"
      of={[
        ["stress", at("stress")],
        ["rest", at("rest")],
      ]}
      rows={rows}
    />
  );
}

/** The same with what stress has more, and the intervals of both beats. */
export function BeatChangeTable({
  report: { beat },
  reports,
}: {
  report: ComparisonReport;
  reports: { stress: BeatReport; rest: BeatReport } | null;
}) {
  if (!beat) return null;
  const figures = beat as Record<string, unknown>;
  const of = (scan: string, row: Figure): number | undefined => {
    const value = figures[`${scan}_${row.place}`];
    return typeof value === "number" ? value : undefined;
  };
  const change = (row: Figure) => {
    const [stress, rest] = [of("stress", row), of("rest", row)];
    if (stress === undefined || rest === undefined) return "–";
    return written({ ...row, signed: true, unit: row.unit === "%" ? "points" : row.unit }, stress - rest);
  };
  const rows = rowsOf("BeatReport").filter(row => of("stress", row) !== undefined || of("rest", row) !== undefined);
  return (
    <table>
      <caption class="hidden">The beat at stress and at rest, and its change</caption>
      <thead>
        <tr>
          <td />
          <th scope="col">stress</th>
          <th scope="col">rest</th>
          <th scope="col">change</th>
        </tr>
      </thead>
      <tbody>
        {rows.map(row => (
          <tr key={row.place}>
            <th scope="row" title={row.about}>
              {row.label}
            </th>
            {(["stress", "rest"] as const).map(scan => (
              <td key={scan}>
                {written(row, of(scan, row))}
                {reports && intervalOf(row, reports[scan]) && (
                  <span class="interval">90 %: {intervalOf(row, reports[scan])}</span>
                )}
              </td>
            ))}
            <td>{change(row)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** How both scans were brought together. */
export function MatchTable({ report }: { report: ComparisonReport }) {
  const caption = "How both scans were matched";
  const rows = rowsOf("ComparisonReport").filter(row => row.section === caption);
  return <BesideTable caption={caption} of={[["", report]]} rows={rows} />;
}

/** Description, tracer, dose, correction of a scan, as far as its header says. */
export function madeWith({
  series_description,
  radiopharmaceutical,
  injected_dose,
  attenuation_corrected,
}: ComparedScan): string {
  return [
    series_description,
    radiopharmaceutical,
    injected_dose && `dose ${injected_dose} MBq`,
    attenuation_corrected == null ? "" : attenuation_corrected ? "attenuation corrected" : "attenuation not corrected",
  ]
    .filter(Boolean)
    .join(" · ");
}

/** What attenuation may have to do with the extents of both scans, a sentence each; nothing where it has nothing. */
export function attenuationNotes({ stress, rest }: ComparisonReport): string {
  const scans: [string, ComparedScan][] = [
    ["Stress", stress],
    ["Rest", rest],
  ];
  return scans
    .flatMap(([name, { polar }]) => {
      const attenuation = polar?.attenuation;
      if (!attenuation) return [];
      const said =
        attenuation.corrected === false
          ? "attenuation was not corrected"
          : "nothing says that attenuation was corrected";
      const part = number(attenuation.inferior_extent_percent, 1, "%");
      return [`${name}: ${part} of the wall lies below the threshold in inferior segments; ${said}.`];
    })
    .join(" ");
}

export function SimulatedNote({ report }: { report: ComparisonReport }): ComponentChildren {
  return isSimulated(report) ? (
    <p class="simulated-note">
      z and scores: normal limits of <Simulated />
    </p>
  ) : null;
}
