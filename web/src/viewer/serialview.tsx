// Scans of one patient over the years: what changed, every figure by date, the maps of all scans, and what was stated.

import { useEffect, useState } from "preact/hooks";
import { type Job, type Parameters, type Result, type Volume, get, save, words } from "../api";
import { fileNameOf } from "../bundle";
import { Confirm } from "../confirm";
import { eraseResult, find, loadResult, scansOf, serials, serialsOf } from "../library";
import { type Draft, draftOf, parameterSpecs } from "../parameters";
import { resultName } from "../resultnames";
import { home } from "../route";
import { SerialForm } from "../serialform";
import { SimulatedMark } from "../simulatedmark";
import { useWatched } from "../state";
import { moment, study } from "../words";
import { Reasons, areNotComparable } from "./comparedfacts";
import { Downloads, Takeaways } from "./figures";
import { type Pair, type Series, figuresIn, firstAndLast, loadSeries, pairName, spoken } from "./serial";
import { ChangesHint, FiguresByDate, ScansInOrder, SegmentsOfPair, SerialHeadlines } from "./serialfacts";
import { SerialMaps } from "./serialmaps";
import { Trend } from "./trend";
import { NotShown, Working, isOfOtherPatient, problemIn } from "./working";

const TITLE = "Over the years";

export function SerialView({ id }: { id: string }) {
  return id.startsWith("job_") ? (
    <Working id={id} title={TITLE} view="serial" again={job => <Again of={job} />} />
  ) : (
    <Shown id={id} />
  );
}

function Shown({ id }: { id: string }) {
  const [series, setSeries] = useState<Series | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    let gone = false;
    const read = async () => {
      const found = find(id) ?? (await loadResult(id));
      if (!found) throw new Error("This comparison was erased.");
      const loaded = await loadSeries(found);
      if (!gone) setSeries(loaded);
    };
    read().catch(error => !gone && setProblem(words(error)));
    return () => void (gone = true);
  }, [id]);
  if (problem) return <NotShown title={TITLE} problem={problem} />;
  if (!series) return <p class="quiet pad">Opening the comparison …</p>;
  return <Serial series={series} />;
}

function Serial({ series }: { series: Series }) {
  const { report, result, volumes } = series;
  const [pair, setPair] = useState(firstAndLast(report));
  const last = volumes.findLast(volume => volume !== null);
  const flags = report.flags.map(flag => ({ ...flag, reason: spoken(flag.reason) }));
  const isDoubtful = areNotComparable({ flags });
  return (
    <div class="comparison serial">
      <aside class="facts" aria-label="What changed">
        <header>
          <h1>{TITLE}</h1>
          {last && study(last) && (
            <p>
              <b>{study(last)}</b> <SimulatedMark of={last} />
            </p>
          )}
        </header>
        {last && <Takeaways result={result} volume={last} prints={false} />}
        {isDoubtful && <Reasons report={{ flags }} />}
        <SerialHeadlines report={report} />
        {!isDoubtful && <Reasons report={{ flags }} />}
        <ScansInOrder series={series} />
        {last && <Tables result={result} volume={last} />}
        {last && <Downloads result={result} volume={last} />}
        <Others result={result} />
        <p class="research foot">Research software, not a medical device. Measurements are not a diagnosis.</p>
      </aside>
      <div class="serial-main">
        <FigureByDate series={series} />
        <SerialMaps series={series} pair={pair} />
        <section class="figures particulars" aria-label="Figures by date">
          <PairChoice series={series} pair={pair} onPair={setPair} />
          <h2>Figures by date</h2>
          <div class="wide" tabIndex={0} role="region" aria-label="Table of figures by date">
            <FiguresByDate report={report} pair={pair} />
          </div>
          <ChangesHint />
          <h2>Segments that changed</h2>
          <SegmentsOfPair report={report} pair={pair} />
        </section>
      </div>
    </div>
  );
}

/** One figure by date, which somebody chooses. */
function FigureByDate({ series: { report } }: { series: Series }) {
  const figures = figuresIn(report);
  const [chosen, setChosen] = useState(figures[0]?.place);
  const figure = figures.find(one => one.place === chosen);
  if (!figure) return null;
  return (
    <section class="figures trend-by-date" aria-label="Trend">
      <label class="inline">
        Figure
        <select value={figure.place} onChange={event => setChosen(event.currentTarget.value)}>
          {figures.map(one => (
            <option key={one.place} value={one.place}>
              {one.label}
            </option>
          ))}
        </select>
      </label>
      <Trend report={report} figure={figure} />
      <p class="quiet">
        {figure.about} Whiskers: the 95 % interval of the change against scan 1, about its figure (dashed): one that
        leaves the dashed line is a change.
      </p>
    </section>
  );
}

/** Which two scans are compared in tables. */
function PairChoice({
  series: { report },
  pair,
  onPair,
}: {
  series: Series;
  pair: Pair;
  onPair: (pair: Pair) => void;
}) {
  if (report.pairs.length < 2) return null;
  const at = report.pairs.findIndex(one => one.earlier === pair.earlier && one.later === pair.later);
  return (
    <label class="inline">
      Changes
      <select
        value={at}
        onChange={event => {
          const chosen = report.pairs[Number(event.currentTarget.value)];
          if (chosen) onPair({ earlier: chosen.earlier, later: chosen.later });
        }}>
        {report.pairs.map((one, n) => (
          <option key={pairName(report, one)} value={n}>
            {pairName(report, one)}
          </option>
        ))}
      </select>
    </label>
  );
}

/** The files that are read on elsewhere. */
const TABLES: [string, string][] = [
  ["figures.csv", "Figures by date, CSV"],
  ["changes.csv", "Changes, CSV"],
  ["segments.csv", "Segments, CSV"],
  ["serial.json", "Report, JSON"],
  ["trend.svg", "Trend, SVG"],
];

function Tables({ result, volume }: { result: Result; volume: Volume }) {
  const [problem, setProblem] = useState("");
  return (
    <section class="downloads" aria-label="Tables and trend">
      <ul class="files">
        {TABLES.flatMap(([name, text]) => {
          const found = result.files.find(one => one.name === name);
          if (!found) return [];
          const load = () => save(found.href, `${fileNameOf(volume)}_${name}`);
          return [
            <li key={name}>
              <button type="button" class="plain" onClick={() => void load().catch(error => setProblem(words(error)))}>
                {text}
              </button>
            </li>,
          ];
        })}
      </ul>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </section>
  );
}

/** Other comparisons of these scans, and erasing this one. */
function Others({ result }: { result: Result }) {
  useWatched(serials);
  const [isAgain, setAgain] = useState(false);
  const others = serialsOf(...scansOf(result)).filter(other => other.id !== result.id);
  return (
    <section class="others" aria-label="Other comparisons">
      {others.slice(0, 4).map(other => (
        <a key={other.id} class="result" href={`#/serial/${other.id}`}>
          <b>{resultName(other)}</b> {moment(other.created_at)}
          {other.parameters["normals"] ? " with normal limits" : ""}
        </a>
      ))}
      {isAgain ? (
        <Again of={result} onClose={() => setAgain(false)} />
      ) : (
        <button type="button" onClick={() => setAgain(true)}>
          Compare again …
        </button>
      )}
      <Confirm
        label="Erase this comparison"
        question="Erase this comparison? The scans stay."
        act={() => eraseResult(result.id).then(home)}>
        Erase
      </Confirm>
    </section>
  );
}

/** Asks for the same scans, or some of them, with other limits or parameters. */
function Again({ of, onClose }: { of: Result | Job; onClose?: () => void }) {
  const [form, setForm] = useState<{
    scans: Volume[];
    draft: Draft;
    problem: { field: string; text: string } | null;
  } | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    const scans = scansOf(of).map(id => get<Volume>(`/v1/volumes/${id}`));
    Promise.all([Promise.all(scans), parameterSpecs()]).then(
      ([volumes, { serial: specs }]) =>
        setForm({
          scans: volumes,
          draft: draftOf(of.parameters as unknown as Parameters, specs),
          problem: "kind" in of ? problemIn(of, specs) : null,
        }),
      error => setProblem(words(error)),
    );
  }, [of.id]);
  if (problem)
    return (
      <p class="error" role="alert">
        {problem}
      </p>
    );
  if (!form) return null;
  return (
    <SerialForm
      scans={form.scans}
      draft={form.draft}
      problem={form.problem}
      otherPatient={"kind" in of && isOfOtherPatient(of)}
      {...(onClose ? { onClose } : {})}
    />
  );
}
