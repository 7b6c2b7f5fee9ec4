// What was measured, beside what it is compared with; the reasons to doubt it; and every file of it.

import { at } from "../base";
import { useState } from "preact/hooks";
import { type Result, type Volume, key, save, words } from "../api";
import { fileNameOf, objectsOf, saveResult } from "../bundle";
import { resultName } from "../resultnames";
import { bytes, kindOf, moment, number } from "../words";
import { type Figure, flatName, intervalOf, rowsOf, figureOf, written } from "../figures";
import type { Evidence } from "../generated/openapi";
import type { Loaded } from "./loaded";

/** The rows of a result's figures, and the document that has them. Those of comparisons have a view of their own. */
function figuresOf(shown: Loaded): { rows: Figure[]; report: unknown } {
  switch (kindOf(shown.result.id)) {
    case "segmentation":
      return { rows: rowsOf("SegmentationReport"), report: shown.report };
    case "beat":
      return { rows: rowsOf("BeatReport"), report: shown.beat?.report };
    case "model":
      return { rows: rowsOf("ModelReport").map(inSummary), report: shown.result.summary };
    case "comparison":
    case "serial":
      return { rows: [], report: null };
  }
}

const inSummary = (row: Figure): Figure => ({ ...row, place: flatName(row) });

/** Most figures at the top of a printed page. */
const HEADLINES = 5;

/** The figures that are read first. */
export function headlines(shown: Loaded): [string, string, string][] {
  const { rows, report } = figuresOf(shown);
  return rows
    .filter(row => row.headline && figureOf(row, report) !== undefined)
    .slice(0, HEADLINES)
    .map(row => [row.label, written(row, figureOf(row, report)), intervalOf(row, report)]);
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

/** How sure something is, as a bar. */
function Chance({ of, value }: { of: string; value: number }) {
  return (
    <meter min={0} max={1} low={0.5} high={0.8} optimum={1} value={value} aria-label={`Confidence of the ${of}`} />
  );
}

/**
 * Whether the fit is good, in words; every reason to doubt it; and the figures behind both, which are `open` on paper.
 */
export function Verdict({ shown, open = false }: { shown: Loaded; open?: boolean }) {
  const flags = shown.report?.flags ?? shown.beat?.report.flags ?? [];
  const confidence = shown.report?.fit.confidence ?? shown.beat?.report.confidence;
  const ofSize = shown.report?.fit.size_confidence;
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
        <p class="quiet">No flags.</p>
      )}
      {known && (
        <details open={open}>
          <summary>Figures behind it</summary>
          <p>
            <b>Place:</b> of fits judged like this one{shown.beat && ", to the sum of the gates"},{" "}
            {confidence > 0.99 ? "more than 99" : (100 * confidence).toFixed(0)} in 100 agree with a reader who draws
            the visible edge (Jaccard index 0.75 or more). Calibrated on simulated scans: a reader who draws farther out
            agrees less.
            <Chance of="place" value={confidence} />
          </p>
          {typeof ofSize === "number" && (
            <p>
              <b>Size:</b> of hearts that look like this one, {(100 * ofSize).toFixed(0)} in 100 have a cavity within 20
              % of the one found.
              <Chance of="size" value={ofSize} />
            </p>
          )}
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
  const { rows, report: figures } = figuresOf(shown);
  const compared = other && figuresOf(other).report;
  const sections = [...new Set(rows.map(row => row.section ?? ""))];
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
        {sections.map(title => {
          const filled = rows.filter(row => (row.section ?? "") === title && figureOf(row, figures) !== undefined);
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
              {filled.map(row => (
                <tr key={row.place}>
                  <th scope="row" title={row.about}>
                    {row.label}
                    {intervalOf(row, figures) && <span class="interval">90 %: {intervalOf(row, figures)}</span>}
                  </th>
                  <td>{written(row, figureOf(row, figures))}</td>
                  {other && <td>{written(row, figureOf(row, compared))}</td>}
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

interface PageProps {
  path: string;
  /** The name that it is saved under, where the page has a key, which a link cannot carry. */
  name: string;
  children: string;
  failed: (error: unknown) => void;
}

/** A button for an HTML page of the service. */
export function PageButton({ path, name, children, failed }: PageProps) {
  return key.value ? (
    <button type="button" onClick={() => void save(path, name).catch(failed)}>
      {children}
    </button>
  ) : (
    <a class="button" href={at(path)} target="_blank" rel="noopener">
      {children}
    </a>
  );
}

/** What is taken away most often, which stands first. */
export function Takeaways({
  result,
  volume,
  prints = true,
}: {
  result: Result;
  volume: Volume;
  /** Whether the view has a sheet of its own; what has none is printed from its report. */
  prints?: boolean;
}) {
  const [state, setState] = useState("");
  const failed = (error: unknown) => setState(words(error));
  const page = result.links.page;
  return (
    <section class="downloads takeaways" aria-label="Report and print">
      <div class="buttons">
        {page && (
          <PageButton path={page} name={`${fileNameOf(volume)}_report.html`} failed={failed}>
            Report
          </PageButton>
        )}
        {prints && (
          <button type="button" onClick={() => print()}>
            Print
          </button>
        )}
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
