// The results of `ventriform evaluate`, read from their folder on this computer. Nothing is sent.

import { useCallback, useEffect, useMemo, useRef, useState } from "preact/hooks";
import { pathOf, useDrop } from "./drop";
import {
  type Evaluation,
  type FitOfCase,
  type Line,
  type Opened,
  type Variant,
  VARIANTS,
  openFolder,
} from "./evaluation";
import { number } from "./words";

/** What was opened stays until another folder is. */
let kept: Opened | null = null;

export function EvaluationView() {
  const [opened, setOpened] = useState(kept);
  const [problem, setProblem] = useState("");
  const folder = useRef<HTMLInputElement>(null);
  const take = useCallback((files: File[]) => {
    setProblem("");
    openFolder(new Map(files.map(file => [pathOf(file), file]))).then(
      found => setOpened((kept = found)),
      (error: Error) => setProblem(error.message),
    );
  }, []);
  const over = useDrop(take);
  return (
    <div class="list evaluation">
      <h1 class={opened ? "" : "hidden"}>{opened ? `Evaluation ${opened.name}` : "Evaluation of a cohort"}</h1>
      <section class={`drop${over ? " over" : ""}${opened ? "" : " empty"}`} aria-label="Open an evaluation">
        <div class="choose">
          <strong>
            {over ? "Let go to open" : opened ? "Another evaluation" : "Drop the folder of an evaluation here"}
          </strong>
          <span class="quiet">
            The folder that <code>ventriform evaluate --output</code> wrote. It stays on this computer: nothing is sent.
          </span>
        </div>
        <div class="buttons">
          <button type="button" class={opened ? "" : "main"} onClick={() => folder.current?.click()}>
            Choose a folder
          </button>
          <input
            ref={folder}
            class="hidden"
            type="file"
            multiple
            tabIndex={-1}
            aria-label="Folder of an evaluation"
            {...{ webkitdirectory: true }}
            onChange={event => {
              take([...(event.currentTarget.files ?? [])]);
              event.currentTarget.value = "";
            }}
          />
        </div>
      </section>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
      {opened && <Results opened={opened} />}
    </div>
  );
}

function Results({ opened }: { opened: Opened }) {
  const { evaluation, table } = opened;
  const cases = useMemo(() => [...new Set(evaluation.fits.map(fit => fit.case))], [evaluation]);
  const [shown, setShown] = useState<string | null>(cases[0] ?? null);
  useEffect(() => setShown(cases[0] ?? null), [cases]);
  return (
    <>
      {evaluation.problems.length > 0 && (
        <section>
          <h2>What is missing</h2>
          <ul class="missing">
            {evaluation.problems.map(one => (
              <li key={one.case + one.problem}>
                <b>{one.case}</b>: {one.problem}
              </li>
            ))}
          </ul>
        </section>
      )}
      <Findings evaluation={evaluation} />
      <Table1 table={table} shown={shown} onShow={setShown} />
      {shown && <Patient opened={opened} name={shown} cases={cases} onShow={setShown} />}
      <Figure3 evaluation={evaluation} />
      <section>
        <details>
          <summary>Settings</summary>
          <table class="plain-table">
            <tbody>
              {Object.entries(evaluation.settings).map(([name, value]) => (
                <tr key={name}>
                  <th scope="row">{name}</th>
                  <td>{value}</td>
                </tr>
              ))}
              {evaluation.templates.map(one => (
                <tr key={one.case}>
                  <th scope="row">template {one.case}</th>
                  <td>{one.source}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </details>
      </section>
    </>
  );
}

function Findings({ evaluation }: { evaluation: Evaluation }) {
  if (evaluation.findings.length === 0) return null;
  return (
    <section>
      <h2>The paper's findings</h2>
      <ul class="findings">
        {evaluation.findings.map(one => (
          <li key={one.claim}>
            <p>
              <b>{one.claim.replace(/\.$/, "")}</b>:{" "}
              <span class={`finding ${one.verdict.replace(/ .*/, "")}`}>{one.verdict}</span>{" "}
              <span class="quiet">{one.sample}</span>
            </p>
            <p class="quiet">{one.figures}</p>
          </li>
        ))}
      </ul>
    </section>
  );
}

const GOLD: Record<string, string> = { expert: "the expert's masks", truth: "the true wall" };

function Table1({ table, shown, onShow }: { table: Line[]; shown: string | null; onShow: (name: string) => void }) {
  const golds = useMemo(
    () => [...new Set(table.filter(line => line.jaccard !== null).map(line => line.gold))],
    [table],
  );
  const templates = useMemo(() => [...new Set(table.map(line => line.template))], [table]);
  const [gold, setGold] = useState("expert");
  const [template, setTemplate] = useState("all");
  const rows = table.filter(
    line => line.gold === (golds.includes(gold) ? gold : golds[0]) && line.template === template,
  );
  const kinds = [...new Map(rows.map(line => [`${line.model} ${line.points}`, line])).values()].sort(
    (a, b) => VARIANTS.indexOf(a.model) - VARIANTS.indexOf(b.model) || a.points - b.points,
  );
  const cases = [...new Set(rows.map(line => line.case))];
  const cell = new Map(rows.map(line => [`${line.case} ${line.model} ${line.points}`, line]));
  if (golds.length === 0) return null;
  return (
    <section aria-label="Table 1">
      <h2>Table 1: agreement with {GOLD[golds.includes(gold) ? gold : golds[0]!]}</h2>
      <div class="tools">
        {golds.length > 1 && (
          <label class="inline">
            Against
            <select value={gold} onChange={event => setGold(event.currentTarget.value)}>
              {golds.map(one => (
                <option key={one} value={one}>
                  {GOLD[one]}
                </option>
              ))}
            </select>
          </label>
        )}
        <label class="inline">
          Model of
          <select value={template} onChange={event => setTemplate(event.currentTarget.value)}>
            {templates.map(one => (
              <option key={one} value={one}>
                {one === "all" ? "all templates (mean)" : one}
              </option>
            ))}
          </select>
        </label>
        <span class="quiet">
          E_J (Jaccard index) / E_CD (contour distance, voxels). Choose a patient to see the slices.
        </span>
      </div>
      <div class="scrolled" tabIndex={0} role="group" aria-label="Table 1, scrollable">
        <table class="plain-table table1">
          <thead>
            <tr>
              <th scope="col">Patient</th>
              {kinds.map(kind => (
                <th key={kind.model + kind.points} scope="col">
                  {NAMES[kind.model]}, {kind.points}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {cases.map(name => {
              const own = kinds.map(kind => cell.get(`${name} ${kind.model} ${kind.points}`));
              const best = Math.max(...own.map(line => line?.jaccard ?? -1));
              return (
                <tr key={name} class={name === shown ? "current" : name === "mean" ? "mean" : ""}>
                  <th scope="row">
                    {name === "mean" ? (
                      "mean"
                    ) : (
                      <button type="button" class="plain" aria-pressed={name === shown} onClick={() => onShow(name)}>
                        {name}
                      </button>
                    )}
                  </th>
                  {own.map((line, n) => (
                    <td key={n} class={line?.jaccard === best ? "best" : ""} title={line?.sample}>
                      {number(line?.jaccard, 3)} / {number(line?.contour, 3)}
                    </td>
                  ))}
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
    </section>
  );
}

const NAMES: Record<Variant, string> = {
  reference: "reference",
  retiled: "re-tiled",
  flipped: "flips alone",
  fitted: "fit alone",
  optimised: "finished",
  auto: "auto",
};

interface PatientProps {
  opened: Opened;
  name: string;
  cases: string[];
  onShow: (name: string) => void;
}

function Patient({ opened, name, cases, onShow }: PatientProps) {
  const picture = opened.evaluation.pictures.find(one => one.case === name);
  const file = picture && opened.files.get(picture.file);
  const [address, setAddress] = useState("");
  useEffect(() => {
    if (!file) return setAddress("");
    const url = URL.createObjectURL(file);
    setAddress(url);
    return () => URL.revokeObjectURL(url);
  }, [file]);
  const at = cases.indexOf(name);
  const fits = opened.evaluation.fits.filter(fit => fit.case === name);
  const step = (by: number) => onShow(cases[(at + by + cases.length) % cases.length]!);
  return (
    <section
      class="patient"
      aria-label={`Patient ${name}`}
      onKeyDown={event => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (by) step(by);
      }}>
      <h2>Patient {name}</h2>
      <div class="buttons">
        <button type="button" onClick={() => step(-1)}>
          Previous
        </button>
        <button type="button" onClick={() => step(1)}>
          Next
        </button>
        <span class="quiet">
          {at + 1} of {cases.length}
        </span>
      </div>
      {address ? (
        <figure>
          <img src={address} alt={`Slices of ${name} with the contours of the fit and the expert`} />
          <figcaption class="quiet">
            Short axis, horizontal and vertical long axis; <span class="key fit-key" /> the fit,{" "}
            <span class="key expert-key" /> the expert. {picture?.caption}
          </figcaption>
        </figure>
      ) : (
        <p class="quiet">
          {picture ? `The folder lacks ${picture.file}.` : "There are no slices of this patient: it has no fit."}
        </p>
      )}
      <details>
        <summary>{fits.length} fits</summary>
        <div class="scrolled" tabIndex={0} role="group" aria-label="Fits, scrollable">
          <table class="plain-table">
            <thead>
              <tr>
                <th scope="col">Template</th>
                <th scope="col">Model</th>
                <th scope="col">Points</th>
                <th scope="col">State</th>
                <th scope="col">E_J expert</th>
                <th scope="col">E_J truth</th>
              </tr>
            </thead>
            <tbody>
              {fits.map(fit => (
                <FitRow key={`${fit.template} ${fit.model} ${fit.points}`} fit={fit} />
              ))}
            </tbody>
          </table>
        </div>
      </details>
    </section>
  );
}

function FitRow({ fit }: { fit: FitOfCase }) {
  return (
    <tr>
      <th scope="row">{fit.template}</th>
      <td>{NAMES[fit.model]}</td>
      <td>{fit.points}</td>
      <td>
        {fit.state}
        {fit.reason && `: ${fit.reason}`}
      </td>
      <td>{number(fit.expert.jaccard, 3)}</td>
      <td>{number(fit.truth.jaccard, 3)}</td>
    </tr>
  );
}

const MEASURES: Record<string, [string, (row: Evaluation["figure3"][number]) => number]> = {
  raw: ["fitness, as in the paper", row => row.fitness.raw],
  normalised: ["fitness, 1 is perfect", row => row.fitness.normalised],
  shape: ["triangle shape 2r/R, mean", row => row.radius_ratio.mean],
};

function Figure3({ evaluation }: { evaluation: Evaluation }) {
  const [measure, setMeasure] = useState("raw");
  const [template, setTemplate] = useState("all");
  const [title, read] = MEASURES[measure]!;
  const templates = [...new Set(evaluation.figure3.map(row => row.template))];
  const series = VARIANTS.flatMap(variant => {
    const rows = evaluation.figure3.filter(
      row => row.model === variant && (template === "all" || row.template === template),
    );
    const points = [...new Set(rows.map(row => row.points))].sort((a, b) => a - b);
    const places = points.map((n): [number, number] => {
      const own = rows.filter(row => row.points === n);
      return [n, own.reduce((sum, row) => sum + read(row), 0) / own.length];
    });
    return places.length ? [{ variant, places }] : [];
  });
  if (series.length === 0) return null;
  const columns = [...new Set(series.flatMap(({ places }) => places.map(([n]) => n)))].sort((a, b) => a - b);
  return (
    <section aria-label="Figure 3">
      <h2>Figure 3: {title}</h2>
      <div class="tools">
        <label class="inline">
          Show
          <select value={measure} onChange={event => setMeasure(event.currentTarget.value)}>
            {Object.entries(MEASURES).map(([name, [text]]) => (
              <option key={name} value={name}>
                {text}
              </option>
            ))}
          </select>
        </label>
        <label class="inline">
          Models of
          <select value={template} onChange={event => setTemplate(event.currentTarget.value)}>
            <option value="all">all templates (mean)</option>
            {templates.map(one => (
              <option key={one}>{one}</option>
            ))}
          </select>
        </label>
        {series.map(({ variant }) => (
          <span key={variant} class={`line-key ${variant}`}>
            {NAMES[variant]}
          </span>
        ))}
      </div>
      <Chart series={series} x="points" y={title} />
      <div class="scrolled" tabIndex={0} role="group" aria-label="The figures, scrollable">
        <table class="plain-table">
          <thead>
            <tr>
              <th scope="col">Model</th>
              {columns.map(n => (
                <th key={n} scope="col">
                  {n} points
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {series.map(({ variant, places }) => (
              <tr key={variant}>
                <th scope="row">{NAMES[variant]}</th>
                {columns.map(n => (
                  <td key={n}>{number(places.find(([at]) => at === n)?.[1], 3)}</td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** Round steps that divide a range into four to eight parts. */
function ticks(low: number, high: number): number[] {
  const rough = (high - low) / 6 || 1;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(n => n * size).find(n => n >= rough)!;
  const out = [];
  for (let n = Math.ceil(low / step); n * step <= high + step / 1e6; n++) out.push(n * step);
  return out;
}

function Chart({ series, x, y }: { series: { variant: Variant; places: [number, number][] }[]; x: string; y: string }) {
  const all = series.flatMap(one => one.places);
  const [left, right] = [Math.min(...all.map(([n]) => n)), Math.max(...all.map(([n]) => n))];
  const [least, most] = [Math.min(...all.map(([, v]) => v)), Math.max(...all.map(([, v]) => v))];
  const spare = (most - least || 1) * 0.08;
  const [low, high] = [least - spare, most + spare];
  const at = ([n, v]: [number, number]): [number, number] => [
    60 + (560 * (n - left)) / (right - left || 1),
    250 - (230 * (v - low)) / (high - low),
  ];
  const digits = high - low < 1 ? 2 : 1;
  return (
    <svg
      class="chart"
      viewBox="0 0 640 300"
      role="img"
      aria-label={`${y} by number of ${x}; the table below has the figures`}>
      {ticks(low, high).map(value => {
        const [, v] = at([left, value]);
        return (
          <g key={value}>
            <line class="grid-line" x1={60} x2={620} y1={v} y2={v} />
            <text x={54} y={v + 4} text-anchor="end">
              {value.toFixed(digits)}
            </text>
          </g>
        );
      })}
      {[...new Set(all.map(([n]) => n))].map(n => (
        <text key={n} x={at([n, low])[0]} y={270} text-anchor="middle">
          {n}
        </text>
      ))}
      <text x={340} y={292} text-anchor="middle">
        {x}
      </text>
      {series.map(({ variant, places }) => (
        <g key={variant} class={variant}>
          <polyline
            points={places
              .map(place =>
                at(place)
                  .map(part => part.toFixed(1))
                  .join(","),
              )
              .join(" ")}
          />
          {places.map(place => {
            const [h, v] = at(place);
            return (
              <circle key={place[0]} cx={h} cy={v} r={3.5}>
                <title>{`${NAMES[variant]}, ${place[0]} ${x}: ${place[1].toFixed(3)}`}</title>
              </circle>
            );
          })}
        </g>
      ))}
    </svg>
  );
}
