// What was measured, beside what it is compared with; the reasons to doubt it; and every file of it.

import { at } from "../base";
import { useState } from "preact/hooks";
import { type Kind, type Result, type Volume, key, save, words } from "../api";
import { fileNameOf, objectsOf, saveResult } from "../bundle";
import { bytes, kindOf, moment, number, resultName } from "../words";
import type {
  Agreement,
  BeatReport,
  Evidence,
  ModelSummary,
  SegmentationReport,
  VolumeIntervals,
} from "../generated/openapi";
import type { Loaded } from "./loaded";

/** Name, figure, digits, unit; for some, the interval that holds the truth in nine of ten hearts. */
type Row = [
  string,
  (loaded: Loaded) => number | null | undefined,
  number,
  string,
  ((loaded: Loaded) => number[] | null | undefined)?,
];

const of = (read: (report: SegmentationReport) => number | null | undefined) => (loaded: Loaded) =>
  loaded.report && read(loaded.report);
const summary = (name: keyof ModelSummary) => (loaded: Loaded) => loaded.result.summary[name];
const measure = (name: keyof Agreement) => of(report => report.measures?.[name]);

const interval = (read: (of: VolumeIntervals) => number[]) => (loaded: Loaded) => {
  const found = loaded.report?.volumes_ml.anatomical_interval;
  return found && read(found);
};

const beat =
  <T,>(read: (report: BeatReport) => T) =>
  (loaded: Loaded) =>
    loaded.beat && read(loaded.beat.report);
const reliable = (read: (phase: BeatReport["phase"]) => number) =>
  beat(({ phase }) => (phase.reliable ? read(phase) : undefined));

const FIT: [string, Row[]][] = [
  [
    "",
    [
      ["Cavity", of(r => r.volumes_ml.anatomical?.cavity ?? r.volumes_ml.cavity), 0, "ml", interval(of => of.cavity)],
      ["Wall", of(r => r.volumes_ml.anatomical?.wall ?? r.volumes_ml.wall), 0, "ml", interval(of => of.wall)],
      ["Mass", of(r => r.mass_g), 0, "g"],
      ["Thickness", of(r => r.thickness_mm?.anatomical.mean), 1, "mm"],
      ["Below the threshold", of(r => r.polar?.extent_percent), 1, "%"],
    ],
  ],
  [
    "As the blurred image shows it",
    [
      ["Cavity", of(r => r.volumes_ml.apparent?.cavity), 0, "ml"],
      ["Wall", of(r => r.volumes_ml.apparent?.wall), 0, "ml"],
      ["Thickness", of(r => r.thickness_mm?.apparent.mean), 1, "mm"],
    ],
  ],
  [
    "Against the expert",
    [
      ["Jaccard", measure("jaccard"), 3, ""],
      ["Dice", measure("dice"), 3, ""],
      ["Contour distance", measure("contour_distance_mm"), 1, "mm"],
      ["Volume difference", measure("volume_difference_ml"), 0, "ml"],
    ],
  ],
];

const MODEL: [string, Row[]][] = [
  [
    "",
    [
      ["Points", summary("vertices"), 0, ""],
      ["Distance to the surface, mean", summary("distance_mean_mm"), 2, "mm"],
      ["Hausdorff distance", summary("hausdorff_mm"), 1, "mm"],
      ["Volume error", summary("volume_error_percent"), 2, "%"],
      ["Triangle shape 2r/R, mean", summary("radius_ratio_mean"), 3, ""],
      ["Triangle shape 2r/R, least", summary("radius_ratio_min"), 3, ""],
      ["Self-intersections", summary("self_intersections"), 0, ""],
    ],
  ],
];

const BEAT: [string, Row[]][] = [
  [
    "",
    [
      ["Ejection fraction", beat(r => r.ef_percent), 0, "%", beat(r => r.ef_interval_percent)],
      ["End-diastolic volume", beat(r => r.edv_ml), 0, "ml", beat(r => r.edv_interval_ml)],
      ["End-systolic volume", beat(r => r.esv_ml), 0, "ml", beat(r => r.esv_interval_ml)],
      ["Stroke volume", beat(r => r.sv_ml), 0, "ml"],
      ["Mass", beat(r => r.mass_g), 0, "g"],
      ["Peak ejection rate", beat(r => r.rates?.peak_ejection_edv_per_s), 1, "EDV/s"],
      ["Peak filling rate", beat(r => r.rates?.peak_filling_edv_per_s), 1, "EDV/s"],
      ["Time to peak filling", beat(r => r.rates?.time_to_peak_filling_ms), 0, "ms"],
      ["R-R interval", beat(r => r.rr_ms), 0, "ms"],
    ],
  ],
  [
    "Phases of the wall",
    [
      ["Mean", reliable(phase => phase.mean_degrees), 0, "°"],
      ["Standard deviation", reliable(phase => phase.sd_degrees), 0, "°"],
      ["By noise alone", beat(r => r.phase.noise_degrees), 0, "°"],
      ["Bandwidth, 95 %", reliable(phase => phase.bandwidth_degrees), 0, "°"],
      ["Entropy", reliable(phase => phase.entropy_percent), 0, "%"],
    ],
  ],
];

/** Figures of comparisons have a view of their own. */
const ROWS: Record<Kind, [string, Row[]][]> = { segmentation: FIT, model: MODEL, beat: BEAT, comparison: [["", []]] };

/** The figures that are read first. */
export function headlines(shown: Loaded): [string, string, string][] {
  const rows = ROWS[kindOf(shown.result.id)][0]![1];
  return rows
    .slice(0, 5)
    .flatMap(([name, read, digits, unit, interval]): [string, string, string][] =>
      typeof read(shown) === "number"
        ? [[name, number(read(shown), digits, unit), between(interval?.(shown), digits)]]
        : [],
    );
}

function between(interval: number[] | null | undefined, digits: number): string {
  return interval ? `${number(interval[0], digits)} to ${number(interval[1], digits)}` : "";
}

/** What a chance of a good fit says to a reader, from the greatest down. */
const CONFIDENCE_WORDS: [number, string][] = [
  [0.9, "Very likely a good fit."],
  [0.7, "Probably a good fit: look over its contours."],
  [0.4, "Perhaps a poor fit: check its contours."],
  [0, "Probably a poor fit: correct it by hand."],
];

const share = (value: number) => number(100 * value, 0, "%");

/** Figures behind the confidence. */
const EVIDENCE: [string, (evidence: Evidence) => string][] = [
  ["Wall whose edge is seen", evidence => share(evidence.active_sensors)],
  ["Wall that is dark", evidence => share(evidence.dark)],
  ["Wall beside something brighter", evidence => share(evidence.beside)],
  ["Brightness that the cavity lacks", evidence => share(evidence.hollowness)],
  ["Chance that the patient moved", evidence => share(evidence.chance_of_motion)],
];

/**
 * Whether the fit is good, in words; every reason to doubt it; and the figures behind both, which are `open` on paper.
 */
export function Verdict({ shown, open = false }: { shown: Loaded; open?: boolean }) {
  const flags = shown.report?.flags ?? shown.beat?.report.flags ?? [];
  const confidence = shown.report?.fit.confidence ?? shown.beat?.report.confidence;
  const evidence = shown.report?.evidence;
  const heart = shown.report?.template ?? shown.beat?.report.template;
  const known = typeof confidence === "number";
  const words =
    shown.beat && typeof shown.beat.report.ef_percent !== "number"
      ? "The gates show no beat: there is no ejection fraction."
      : known && CONFIDENCE_WORDS.find(([least]) => confidence >= least)?.[1];
  return (
    <div class={flags.length ? "verdict doubt" : "verdict"}>
      {words && (
        <p>
          <b>{words}</b>
        </p>
      )}
      {flags.length > 0 ? (
        <ul>
          {flags.map(flag => (
            <li key={flag.code}>{flag.reason}</li>
          ))}
        </ul>
      ) : (
        <p class="quiet">No reason to doubt it was found.</p>
      )}
      {known && (
        <details open={open}>
          <summary>Figures behind it</summary>
          <p>
            Of fits judged like this one{shown.beat && ", to the sum of the gates"},{" "}
            {confidence > 0.99 ? "more than 99" : (100 * confidence).toFixed(0)} in 100 agree with a reader who draws
            the visible edge (Jaccard index 0.75 or more). Calibrated on simulated scans: a reader who draws farther out
            agrees less.
            <meter min={0} max={1} low={0.5} high={0.8} optimum={1} value={confidence} aria-label="Confidence" />
          </p>
          {evidence && (
            <table>
              <tbody>
                {EVIDENCE.map(([name, read]) => (
                  <tr key={name}>
                    <th scope="row">{name}</th>
                    <td>{read(evidence)}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          )}
          {heart && <p class="quiet">Fitted heart: {heart}</p>}
        </details>
      )}
    </div>
  );
}

export function Figures({ shown, other, verdict = true }: { shown: Loaded; other: Loaded | null; verdict?: boolean }) {
  const sections = ROWS[kindOf(shown.result.id)];
  const { report } = shown;
  const warnings = report?.warnings ?? shown.beat?.report.warnings ?? [];
  const reason = shown.beat?.report.no_rates;
  return (
    <section class="figures" aria-label="Figures">
      {(report || shown.beat) && verdict && <Verdict shown={shown} />}
      {verdict &&
        warnings.map(text => (
          <p key={text} class="warning">
            {text}
          </p>
        ))}
      <table>
        <caption class="hidden">Figures of the shown result{other && " and of the compared one"}</caption>
        <thead class={other ? "" : "hidden"}>
          <tr>
            <td />
            <th scope="col">shown</th>
            {other && <th scope="col">compared</th>}
          </tr>
        </thead>
        {sections.map(([title, rows]) => {
          const filled = rows.filter(([, read]) => typeof read(shown) === "number");
          if (filled.length === 0) return null;
          return (
            <tbody key={title}>
              {title && (
                <tr>
                  <th scope="colgroup" colSpan={3} class="part">
                    {title}
                  </th>
                </tr>
              )}
              {filled.map(([name, read, digits, unit, interval]) => (
                <tr key={name}>
                  <th scope="row">
                    {name}
                    {interval?.(shown) && <span class="interval">90 %: {between(interval(shown), digits)}</span>}
                  </th>
                  <td>{number(read(shown), digits, unit)}</td>
                  {other && <td>{number(read(other), digits, unit)}</td>}
                </tr>
              ))}
            </tbody>
          );
        })}
      </table>
      {reason && <p class="quiet">No rates: {reason}.</p>}
      <p class="quiet">
        {resultName(shown.result)} of {moment(shown.result.created_at)}
      </p>
    </section>
  );
}

/** What is taken away most often, which stands first. */
export function Takeaways({ result, volume }: { result: Result; volume: Volume }) {
  const [state, setState] = useState("");
  const failed = (error: unknown) => setState(words(error));
  const page = result.links.page;
  return (
    <section class="downloads takeaways" aria-label="Report and print">
      <div class="buttons">
        {page &&
          (key.value ? (
            <button type="button" onClick={() => void save(page, `${fileNameOf(volume)}_report.html`).catch(failed)}>
              Report
            </button>
          ) : (
            <a class="button" href={at(page)} target="_blank" rel="noopener">
              Report
            </a>
          ))}
        <button type="button" onClick={() => print()}>
          Print
        </button>
        <button type="button" onClick={() => void saveResult(volume, result, setState).catch(failed)}>
          Everything as zip
        </button>
      </div>
      <p role="status" class="quiet">
        {state}
      </p>
    </section>
  );
}

export function Downloads({ result, volume }: { result: Result; volume: Volume }) {
  const [state, setState] = useState("");
  const name = fileNameOf(volume);
  const failed = (error: unknown) => setState(words(error));
  const objects = objectsOf(volume, result);
  return (
    <section class="downloads" aria-label="Files">
      <p role="status" class="quiet">
        {state}
      </p>
      <details>
        <summary>{result.files.length} files</summary>
        <ul class="files">
          {result.files.map(one => (
            <li key={one.name}>
              <button
                type="button"
                class="plain"
                onClick={() => void save(one.href, `${name}_${one.name}`).catch(failed)}>
                {one.name}
              </button>
              <span class="quiet">{bytes(one.bytes)}</span>
            </li>
          ))}
        </ul>
      </details>
      {objects.length > 0 && (
        <details>
          <summary>{objects.length} DICOM objects</summary>
          <ul class="files">
            {objects.map(path => {
              const object = path.slice(path.lastIndexOf("/") + 1);
              return (
                <li key={path}>
                  <button
                    type="button"
                    class="plain"
                    onClick={() => void save(path, `${name}_${object}`).catch(failed)}>
                    {object}
                  </button>
                </li>
              );
            })}
          </ul>
        </details>
      )}
    </section>
  );
}
