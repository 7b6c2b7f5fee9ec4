// What a comparison says in figures and words.

import type { ComponentChildren } from "preact";
import type { ComparedScan, ComparisonReport, Perfusion } from "../generated/openapi";
import { Simulated } from "../limits";
import { number } from "../words";
import { flagsOf, isSimulated } from "./compared";
import { shown } from "./polar";

/** A signed change. */
function change(value: number | null | undefined, digits: number, unit: string): string {
  return typeof value === "number" && Number(value.toFixed(digits)) > 0
    ? `+${number(value, digits, unit)}`
    : number(value, digits, unit);
}

/** The figures that are read first: name, figure, and what stands smaller beside it. */
export function headlinesOf(report: ComparisonReport): [string, string, string][] {
  const isUncertain = report.flags.some(flag => flag.code === "tid_uncertain");
  const { tid, reversible_percent, fixed_percent, sss, srs, sds, summed_percent, beat, stress, rest } = report;
  const scores = (
    [
      ["SSS", sss],
      ["SRS", srs],
      ["SDS", sds],
    ] as const
  ).flatMap(([name, score], n): [string, string, string][] =>
    score == null ? [] : [[name, String(score), summed_percent ? number(summed_percent[n], 0, "%") : ""]],
  );
  return [
    [
      "TID",
      number(tid, 2),
      `${number(stress.cavity_ml, 0)}\u00a0/\u00a0${number(rest.cavity_ml, 0, "ml")}${isUncertain ? ", uncertain" : ""}`,
    ],
    ["Reversible", number(reversible_percent, 0, "%"), "of the wall"],
    ["Fixed", number(fixed_percent, 0, "%"), "of the wall"],
    ...scores,
    ...(beat?.ef_change_points == null
      ? []
      : [
          [
            "EF, change",
            change(beat.ef_change_points, 0, ""),
            `points: ${number(beat.stress_ef_percent, 0)} / ${number(beat.rest_ef_percent, 0, "%")}`,
          ] as [string, string, string],
        ]),
  ];
}

export function Headlines({ report }: { report: ComparisonReport }) {
  return (
    <dl class="headlines compared-headlines">
      {headlinesOf(report).map(([name, value, beside]) => (
        <div key={name}>
          <dt>{name}</dt>
          <dd>
            {value}
            {beside && <span class="interval">{beside}</span>}
          </dd>
        </div>
      ))}
    </dl>
  );
}

/** Whether both scans should not be compared at all: that is said before any figure. */
export function areNotComparable(report: ComparisonReport): boolean {
  return report.flags.some(flag => flag.code === "not_comparable");
}

/** Reasons to look closer, in words. */
export function Reasons({ report }: { report: ComparisonReport }) {
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
  const rows: [string, (one: Perfusion) => string][] = [
    ["Deficit score", one => number(one.deficit_percent, 1, "%")],
    [`Wall more than ${of[0]?.[1].z_limit ?? 2.5} SD below normal`, one => number(one.extent_percent, 0, "%")],
    ["Mean depth there", one => number(one.severity, 1, "SD")],
    ["Summed score", one => `${one.summed_score} (${number(one.summed_percent, 0, "%")})`],
  ];
  return (
    <table>
      <caption class="hidden">Uptake beside normal limits</caption>
      <thead class={of.length > 1 ? "" : "hidden"}>
        <tr>
          <td />
          {of.map(([name]) => (
            <th key={name} scope="col">
              {name}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, read]) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            {of.map(([scan, one]) => (
              <td key={scan}>{read(one)}</td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

const UNITS: Record<string, string> = { ml: "ml", mm: "mm", g: "g", percent: "%", degrees: "°", points: "points" };
const FIGURE_WORDS: Record<string, string> = { ef: "EF", edv: "EDV", esv: "ESV", tid: "TID", sd: "SD" };

/** The name of a figure of the limits, which ends with its unit, in words and with the unit apart. */
function figureName(name: string): [string, string] {
  const words = name.split("_");
  const unit = UNITS[words.at(-1) ?? ""] ?? "";
  const left = (unit ? words.slice(0, -1) : words).map(word => FIGURE_WORDS[word] ?? word).join(" ");
  return [left.charAt(0).toUpperCase() + left.slice(1), unit];
}

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
            const [name, unit] = figureName(one.figure);
            const digits = one.high < 10 ? 2 : 0;
            return (
              <tr key={one.figure}>
                <th scope="row">{name}</th>
                <td>{number(one.value, digits, unit)}</td>
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
    <table class="segments">
      <caption class="hidden">Segments and territories beside normal limits</caption>
      <thead>
        <tr>
          <th scope="col">Segment</th>
          <th scope="col">z</th>
          <th scope="col">score</th>
          <th scope="col">below</th>
        </tr>
      </thead>
      <tbody>
        {perfusion.segments.map(one => (
          <tr key={one.segment}>
            <th scope="row">
              {one.segment} {one.name}
            </th>
            <td>{number(one.z, 1)}</td>
            <td>{one.score ?? "–"}</td>
            <td>{number(one.extent_percent, 0, "%")}</td>
          </tr>
        ))}
        {perfusion.territories.map(one => (
          <tr key={one.name}>
            <th scope="row">{one.name}</th>
            <td />
            <td>{one.summed_score}</td>
            <td>{number(one.extent_percent, 0, "%")}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

export function TerritoryTable({ report }: { report: ComparisonReport }) {
  return (
    <table class="segments">
      <caption class="hidden">Territories at stress and at rest</caption>
      <thead>
        <tr>
          <th scope="col">Territory</th>
          <th scope="col">stress</th>
          <th scope="col">rest</th>
          <th scope="col">less</th>
          <th scope="col">reversible</th>
          <th scope="col">fixed</th>
        </tr>
      </thead>
      <tbody>
        {report.territories.map(one => (
          <tr key={one.name}>
            <th scope="row">{one.name}</th>
            <td>{number(shown(one.stress_percent), 0)}</td>
            <td>{number(shown(one.rest_percent), 0)}</td>
            <td>{number(one.difference_points, 0)}</td>
            <td>{number(one.reversible_percent, 0, "%")}</td>
            <td>{number(one.fixed_percent, 0, "%")}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

export function SegmentChanges({ report }: { report: ComparisonReport }) {
  const scored = report.sss != null;
  const moved = report.segments.some(one => one.motion_change_mm != null);
  const head = [
    "stress",
    "rest",
    "less",
    "reversible",
    ...(scored ? ["scores"] : []),
    ...(moved ? ["motion, mm", "thickening"] : []),
  ];
  return (
    <table class="segments">
      <caption class="hidden">Segments at stress and at rest</caption>
      <thead>
        <tr>
          <th scope="col">Segment</th>
          {head.map(name => (
            <th key={name} scope="col">
              {name}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {report.segments.map(one => (
          <tr key={one.segment}>
            <th scope="row">
              {one.segment} {one.name}
            </th>
            <td>{number(shown(one.stress_percent), 0)}</td>
            <td>{number(shown(one.rest_percent), 0)}</td>
            <td>{number(one.difference_points, 0)}</td>
            <td>{number(one.reversible_percent, 0, "%")}</td>
            {scored && (
              <td>
                {one.stress_score ?? "–"} / {one.rest_score ?? "–"}
              </td>
            )}
            {moved && (
              <>
                <td>{change(one.motion_change_mm, 1, "")}</td>
                <td>{change(one.thickening_change_points, 0, "")}</td>
              </>
            )}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

export function BeatTable({ report }: { report: ComparisonReport }) {
  const { beat } = report;
  if (!beat) return null;
  const rows: [string, number | null | undefined, number | null | undefined, string][] = [
    ["Ejection fraction", beat.stress_ef_percent, beat.rest_ef_percent, "%"],
    ["End-diastolic volume", beat.stress_edv_ml, beat.rest_edv_ml, "ml"],
    ["End-systolic volume", beat.stress_esv_ml, beat.rest_esv_ml, "ml"],
  ];
  return (
    <table>
      <caption class="hidden">The beat at stress and at rest</caption>
      <thead>
        <tr>
          <td />
          <th scope="col">stress</th>
          <th scope="col">rest</th>
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, atStress, atRest, unit]) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            <td>{number(atStress, 0, unit)}</td>
            <td>{number(atRest, 0, unit)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** How both scans were brought together. */
export function MatchTable({ report }: { report: ComparisonReport }) {
  const rows: [string, string][] = [
    ["Wall with muscle in both scans", number(report.compared_percent, 0, "%")],
    ["Wall by which stress was scaled", number(report.matched_percent, 0, "%")],
    ["Counts of stress for one at rest", number(report.scale, 2)],
    ["Loss that counts as reversible", number(report.reversible_points, 0, "points")],
    ["Stress map turned by", number(report.turn_degrees, 0, "°")],
    ["Correlation of both maps", number(report.correlation, 2)],
  ];
  return (
    <table>
      <caption class="hidden">How both scans were matched</caption>
      <tbody>
        {rows.map(([name, value]) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            <td>{value}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
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

export function SimulatedNote({ report }: { report: ComparisonReport }): ComponentChildren {
  return isSimulated(report) ? (
    <p class="simulated-note">
      z and scores: normal limits of <Simulated />
    </p>
  ) : null;
}
