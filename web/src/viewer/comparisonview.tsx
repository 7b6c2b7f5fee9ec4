// Rest and stress of one patient, as readers know it: slices above each other, polar maps beside each other, both
// walls, and what they say in figures.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Job, type Parameters, type Result, type Volume, get, isNoHeart, words } from "../api";
import { Confirm } from "../confirm";
import { comparisons, eraseResult, find, loadResult, loadResultsOf } from "../library";
import { PairForm } from "../pairform";
import { type Draft, draftOf, parameterSpecs } from "../parameters";
import { home } from "../route";
import { SimulatedMark } from "../simulatedmark";
import { useWatched } from "../state";
import { cut, moment, nameOf, study } from "../words";
import { type Compared, type NamedMap, loadComparison, mapsOf } from "./compared";
import {
  BeatTable,
  BothMeasures,
  Headlines,
  Outdated,
  LimitsUsed,
  MatchTable,
  PerfusionTable,
  Reasons,
  SegmentChanges,
  SegmentScores,
  SimulatedNote,
  TerritoryTable,
  areNotComparable,
  attenuationNotes,
  madeWith,
} from "./comparedfacts";
import { RowsOfSlices, WindowOfSlices } from "./comparedlook";
import { ComparedBeats, ComparedPlayer } from "./comparedbeat";
import { ComparedCorrection, CorrectScan } from "./comparedcorrection";
import { ComparedMaps } from "./comparedmaps";
import { ComparedScene } from "./comparedscene";
import { ComparedSlices, LargePair } from "./comparedslices";
import { ComparisonSheet } from "./comparisonsheet";
import { Downloads, Takeaways } from "./figures";
import { HeartWall } from "./heartwall";
import { useMedia } from "./media";
import { lutOf } from "./mapsrow";
import { readableComparison } from "./readable";
import { ReadingPanel, ReadingState } from "./readingpanel";
import { screenshot } from "./screenshot";
import { printsAs } from "./sheetparts";
import { ColourBar, byMap, coloursOf } from "./wall";
import { NotShown, Working, isOfOtherPatient, problemIn } from "./working";

export function ComparisonView({ id }: { id: string }) {
  return id.startsWith("job_") ? (
    <Working id={id} title="Rest and stress" view="comparison" again={job => <PairAgain job={job} />} />
  ) : (
    <Shown id={id} />
  );
}

/** What can be changed of a comparison that failed. */
function PairAgain({ job }: { job: Job }) {
  const [again, setAgain] = useState<{
    pair: [Volume, Volume];
    draft: Draft;
    problem: { field: string | null; text: string } | null;
  } | null>(null);
  useEffect(() => {
    const parameters = job.parameters as unknown as Parameters;
    const [stress, rest] = [job.volume, parameters["rest"]];
    if (!stress || typeof rest !== "string") return;
    Promise.all([get<Volume>(`/v1/volumes/${stress}`), get<Volume>(`/v1/volumes/${rest}`), parameterSpecs()]).then(
      ([atStress, atRest, { comparison: specs }]) =>
        setAgain({ pair: [atStress, atRest], draft: draftOf(parameters, specs), problem: problemIn(job, specs) }),
      () => undefined,
    );
  }, [job.id]);
  if (!again) return null;
  const [stress, rest] = again.pair;
  return (
    <>
      {job.error && isNoHeart(job.error) && (
        <p>
          Open the scan{" "}
          {job.error.detail.startsWith("rest") ? (
            <a href={`#/scan/${rest.id}`}>at rest</a>
          ) : (
            <a href={`#/scan/${stress.id}`}>at stress</a>
          )}{" "}
          and press <b>Correct by hand</b>. What is fitted there is taken here.
        </p>
      )}
      <PairForm
        pair={again.pair}
        stress={stress.id}
        draft={again.draft}
        problem={again.problem}
        otherPatient={isOfOtherPatient(job)}
      />
    </>
  );
}

function Shown({ id }: { id: string }) {
  const [result, setResult] = useState<Result | null>(find(id) ?? null);
  const [compared, setCompared] = useState<Compared | null>(null);
  const [scans, setScans] = useState<{ stress: Volume; rest: Volume } | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    let gone = false;
    const read = async () => {
      const found = find(id) ?? (await loadResult(id));
      if (!found) throw new Error("This comparison was erased.");
      const rest = String(found.parameters["rest"]);
      const [atStress, atRest, loaded] = await Promise.all([
        get<Volume>(`/v1/volumes/${found.volume}`),
        get<Volume>(`/v1/volumes/${rest}`),
        loadComparison(found),
      ]);
      if (gone) return;
      setResult(found);
      setScans({ stress: atStress, rest: atRest });
      for (const scan of [atStress, atRest]) loadResultsOf(scan.id);
      setCompared(loaded);
    };
    read().catch(error => !gone && setProblem(words(error)));
    return () => void (gone = true);
  }, [id]);
  if (problem) return <NotShown title="Rest and stress" problem={problem} />;
  if (!result || !compared || !scans) return <p class="quiet pad">Opening the comparison …</p>;
  return <Comparison compared={compared} scans={scans} />;
}

interface ComparisonProps {
  compared: Compared;
  scans: { stress: Volume; rest: Volume };
}

/** Where the rows of slices have the height of the window, and the walls stand beside them. */
const WIDE = "(min-width: 1700px)";

function Comparison({ compared, scans }: ComparisonProps) {
  const wide = useMedia(WIDE);
  const scene = useMemo(() => new ComparedScene(), [compared]);
  const readable = useMemo(() => readableComparison(compared), [compared]);
  useEffect(
    () => printsAs(() => <ComparisonSheet compared={compared} scene={scene} scans={scans} />),
    [compared, scene, scans],
  );
  return (
    <div class="comparison">
      <aside class="facts" aria-label="Figures">
        <Head compared={compared} scans={scans} scene={scene} />
        <ComparedCorrection compared={compared} scene={scene} scans={scans} />
        <Takeaways result={compared.result} volume={scans.stress} />
        <ReadingState of={compared.result.id} />
        <Outdated made={compared.result} />
        {areNotComparable(compared.report) && <Reasons report={compared.report} />}
        <Headlines report={compared.report} />
        <BothMeasures report={compared.report} />
        <SimulatedNote report={compared.report} />
        {!areNotComparable(compared.report) && <Reasons report={compared.report} />}
        <ReadingPanel readable={readable} volume={scans.stress} />
        <Particulars compared={compared} scene={scene} />
        <Downloads result={compared.result} volume={scans.stress} />
        <Others compared={compared} />
        <p class="research foot">Research software, not a medical device. Measurements are not a diagnosis.</p>
      </aside>
      <Stage compared={compared} scene={scene} scans={scans} wide={wide} />
      <div class="pictures maps-side">
        <ComparedMaps compared={compared} scene={scene} />
        <ComparedBeats compared={compared} scene={scene} scans={scans} />
        {wide && (
          <div class="side-walls">
            <Walls compared={compared} scene={scene} />
          </div>
        )}
      </div>
    </div>
  );
}

function Head({ compared, scans, scene }: ComparisonProps & { scene: ComparedScene }) {
  const { report } = compared;
  return (
    <header>
      <h1>Rest and stress</h1>
      {study(scans.stress) && (
        <p>
          <b>{study(scans.stress)}</b> <SimulatedMark of={scans.stress} />
        </p>
      )}
      {(["stress", "rest"] as const).map(scan => (
        <p key={scan}>
          <span class={`role ${scan}`}>{scan}</span>{" "}
          <a href={`#/scan/${scans[scan].id}`} title={nameOf(scans[scan])}>
            {cut(nameOf(scans[scan]))}
          </a>
          {madeWith(report[scan]) && <span class="quiet"> {madeWith(report[scan])}</span>}{" "}
          <CorrectScan compared={compared} scene={scene} scan={scan} />
        </p>
      ))}
    </header>
  );
}

/** Tables, folded. */
function Particulars({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { report } = compared;
  const beside = (["stress", "rest"] as const).flatMap(scan => {
    const { perfusion } = report[scan];
    return perfusion ? [[scan, perfusion] as [string, typeof perfusion]] : [];
  });
  return (
    <section class="figures particulars" aria-label="Particulars">
      {beside.length > 0 && (
        <details open>
          <summary>Beside normal limits</summary>
          <PerfusionTable of={beside} />
          {beside.slice(0, 1).map(([scan, perfusion]) => (
            <LimitsUsed key={scan} perfusion={{ ...perfusion, flags: [] }} />
          ))}
          {beside.map(([scan, perfusion]) => (
            <details key={scan}>
              <summary>Scores at {scan}</summary>
              <div class="wide" tabIndex={0} role="region" aria-label={`Scores at ${scan}`}>
                <SegmentScores perfusion={perfusion} />
              </div>
            </details>
          ))}
        </details>
      )}
      {report.beat && (
        <details open>
          <summary>The beat</summary>
          <BeatTable report={report} />
        </details>
      )}
      {(report.no_beat ?? []).length > 0 && (
        <p class="quiet">
          {report.beat ? "No ejection fractions" : "No beats"} were compared:{" "}
          {(report.no_beat ?? []).map(({ reason }) => reason).join("; ")}.
        </p>
      )}
      {report.territories.length > 0 && (
        <details>
          <summary>Territories</summary>
          <p class="quiet">Per cent; stress is scaled to rest.</p>
          <div class="wide" tabIndex={0} role="region" aria-label="Territories">
            <TerritoryTable report={report} />
          </div>
        </details>
      )}
      <details>
        <summary>Segments</summary>
        <p class="quiet">Per cent; stress is scaled to rest.</p>
        <div class="wide" tabIndex={0} role="region" aria-label="Segments">
          <SegmentChanges compared={compared} scene={scene} />
        </div>
      </details>
      <details>
        <summary>How both were matched</summary>
        <MatchTable report={report} />
      </details>
      {attenuationNotes(report) && <p class="quiet">{attenuationNotes(report)}</p>}
      {(["stress", "rest"] as const).flatMap(scan =>
        report[scan].warnings.map(text => (
          <p key={scan + text} class="warning">
            {scan === "stress" ? "Stress" : "Rest"}: {text}
          </p>
        )),
      )}
    </section>
  );
}

/** Other comparisons of the same scans, and erasing this one. */
function Others({ compared: { result } }: { compared: Compared }) {
  const scans = [result.volume, String(result.parameters["rest"])];
  const others = useWatched(comparisons).filter(
    other =>
      other.id !== result.id && (scans.includes(other.volume) || scans.includes(String(other.parameters["rest"]))),
  );
  return (
    <section class="others" aria-label="Other comparisons">
      {others.slice(0, 4).map(other => (
        <a key={other.id} class="result" href={`#/comparison/${other.id}`}>
          <b>Compared {moment(other.created_at)}</b>
          {other.parameters["normals"] ? " with normal limits" : ""}
        </a>
      ))}
      <Again result={result} />
      <Confirm
        label="Erase this comparison"
        question="Erase this comparison? The scans stay."
        act={() => eraseResult(result.id).then(home)}>
        Erase
      </Confirm>
    </section>
  );
}

/** Compares the same scans again, with other limits or parameters. */
function Again({ result }: { result: Result }) {
  const [form, setForm] = useState<{ pair: [Volume, Volume]; draft: Draft } | null>(null);
  const [problem, setProblem] = useState("");
  const opened = () => {
    Promise.all([
      get<Volume>(`/v1/volumes/${result.volume}`),
      get<Volume>(`/v1/volumes/${String(result.parameters["rest"])}`),
      parameterSpecs(),
    ]).then(
      ([stress, rest, specs]) => setForm({ pair: [stress, rest], draft: draftOf(result.parameters, specs.comparison) }),
      error => setProblem(words(error)),
    );
  };
  return (
    <>
      {form ? (
        <PairForm pair={form.pair} stress={form.pair[0].id} draft={form.draft} onClose={() => setForm(null)} />
      ) : (
        <button type="button" onClick={opened}>
          Compare again …
        </button>
      )}
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}

interface StageProps extends ComparisonProps {
  scene: ComparedScene;
  /** Whether the walls stand elsewhere. */
  wide: boolean;
}

function Stage({ compared, scene, scans, wide }: StageProps) {
  const stage = useRef<HTMLElement>(null);
  const [chosen, setBelow] = useState<"walls" | "slices">("walls");
  const below = wide && chosen === "walls" ? null : chosen;
  const [rows, setRows] = useState(false);
  const outlined = useWatched(scene.contours);
  const smooth = useWatched(scene.smooth);
  return (
    <section class="pictures compared-stage" aria-label="Slices and walls" ref={stage}>
      <div class="toolbar" role="toolbar" aria-label="How to look">
        <WindowOfSlices scene={scene} />
        <label class="inline">
          <input
            type="checkbox"
            checked={outlined}
            onChange={event => (scene.contours.value = event.currentTarget.checked)}
          />{" "}
          contours
        </label>
        <label class="inline">
          <input
            type="checkbox"
            checked={smooth}
            onChange={event => (scene.smooth.value = event.currentTarget.checked)}
          />{" "}
          smooth
        </label>
        <button type="button" class="plain" aria-expanded={rows} onClick={() => setRows(!rows)}>
          Rows …
        </button>
        <span class="end">
          <span class="choice" role="group" aria-label="Below the slices">
            {!wide && (
              <button type="button" aria-pressed={below === "walls"} onClick={() => setBelow("walls")}>
                Walls in 3-D
              </button>
            )}
            <button
              type="button"
              aria-pressed={below === "slices"}
              onClick={() => setBelow(wide && below === "slices" ? "walls" : "slices")}>
              Slice, large
            </button>
          </span>
          <button
            type="button"
            class="plain"
            aria-label="Screenshot"
            title="Screenshot"
            onClick={() => stage.current && screenshot(stage.current, `${nameOf(scans.stress)} rest and stress`)}>
            <svg class="icon" viewBox="0 0 20 20" aria-hidden="true">
              <path d="M3 6h3l1-2h6l1 2h3v10H3zM10 8a3 3 0 1 0 .01 0" />
            </svg>
          </button>
        </span>
      </div>
      {rows && <RowsOfSlices scene={scene} />}
      {compared.report.beat && <ComparedPlayer compared={compared} scene={scene} scans={scans} />}
      <ComparedSlices compared={compared} scene={scene} />
      {below && (
        <div class="below">
          {below === "walls" ? (
            <Walls compared={compared} scene={scene} />
          ) : (
            <LargePair compared={compared} scene={scene} />
          )}
        </div>
      )}
    </section>
  );
}

/** The figures by which walls are coloured: what is known of both. */
function paintsOf(compared: Compared): { name: string; of: [NamedMap, NamedMap] }[] {
  const maps = mapsOf(compared);
  const names: Partial<Record<NamedMap["figure"], string>> = {
    uptake: "Uptake",
    difference: "Rest less stress",
    z: "z",
    score: "Score",
  };
  return (["uptake", "difference", "z", "score"] as const).flatMap(figure => {
    const [one, other = one] = maps.filter(map => map.figure === figure);
    return one && other ? [{ name: names[figure] ?? figure, of: [one, other] as [NamedMap, NamedMap] }] : [];
  });
}

function Walls({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const paints = useMemo(() => paintsOf(compared), [compared]);
  const [chosen, setChosen] = useState("Uptake");
  const lut = useWatched(scene.lut);
  const paint = paints.find(one => one.name === chosen) ?? paints[0];
  const coloured = useMemo(
    () =>
      paint &&
      [compared.stress, compared.rest].map((one, n) => {
        const named = paint.of[n]!;
        return one.heart
          ? coloursOf(byMap(one.mesh, named.map, one.heart), {
              lut: lutOf(named, lut),
              range: named.map.range,
              below: named.map.below,
            })
          : null;
      }),
    [compared, paint, lut],
  );
  if (!paint || !coloured) return <p class="off">There is no map to colour the walls by.</p>;
  const [low, high] = paint.of[0].map.range;
  return (
    <>
      <div class="pair">
        {[compared.stress, compared.rest].map(
          (one, n) =>
            coloured[n] && (
              <HeartWall
                key={one.scan}
                one={one}
                scene={scene}
                colours={coloured[n]!}
                title={n === 0 ? "Stress" : "Rest"}
              />
            ),
        )}
      </div>
      <div class="layers">
        <select
          aria-label="Colour of the walls"
          value={paint.name}
          onChange={event => setChosen(event.currentTarget.value)}>
          {paints.map(one => (
            <option key={one.name}>{one.name}</option>
          ))}
        </select>
        <ColourBar
          lut={lutOf(paint.of[0], lut)}
          low={String(low)}
          high={`${high}${paint.of[0].map.unit && ` ${paint.of[0].map.unit}`}`}
        />
        <span class="quiet">Drag turns both.</span>
      </div>
    </>
  );
}
