// One scan: its slices, the wall, the polar map, what was measured, and what can be done about it.

import { useCallback, useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Job, type Kind, type Parameters, type Result, type Volume, fieldOf, get, sentences, words } from "../api";
import { Confirm } from "../confirm";
import { JobLine, asksForHeart } from "../jobline";
import {
  beats,
  comparisons,
  comparisonsOf,
  eraseResult,
  find,
  fits,
  isActive,
  jobs,
  loadResult,
  loadScan,
  madeBy,
  models,
  resultsOf,
  serials,
  serialsOf,
} from "../library";
import { pick, picked } from "../pairing";
import { type Draft, ParameterForm, draftOf, parameterSpecs, valuesOf } from "../parameters";
import { ReadMark } from "../readmark";
import { nameAmong, resultName, timeOf } from "../resultnames";
import { home, isAt, open, openComparison, openSerial, route } from "../route";
import { SimulatedMark } from "../simulatedmark";
import { useWatched } from "../state";
import { file, isFiledHere } from "../work";
import { isBeat, isFit, isGated, kindOf, moment, nameOf, shape, study, titleOf } from "../words";
import { BeatCharts, BeatMaps, PerfusionView } from "./beatview";
import { LUT, UPTAKE, WALL_LUT, kept } from "./colours";
import { Correction } from "./correction";
import { Downloads, Figures, Takeaways } from "./figures";
import { type Loaded, loadLoaded, readGates, voxelsOf } from "./loaded";
import { Pictures } from "./pictures";
import { Player } from "./player";
import { PolarView } from "./polarview";
import { readableScan } from "./readable";
import { ReadingPanel } from "./readingpanel";
import { Scene } from "./scene";
import { sheetOf } from "./sheet";
import { type Printed, printsAs } from "./sheetparts";

export function Viewer({ volume: id }: { volume: string }) {
  const [volume, setVolume] = useState<Volume | null>(null);
  const [problem, setProblem] = useState("");
  const { result: chosen, other } = useWatched(route);
  const known = useWatched(beats).length + useWatched(fits).length + useWatched(models).length;
  const load = useCallback(() => {
    setProblem("");
    loadScan(id).then(setVolume, error => setProblem(words(error)));
  }, [id]);
  useEffect(load, [load]);
  const results = useMemo(() => resultsOf(id), [id, known, volume]);
  const jobOfRoute = chosen?.startsWith("job_") ? chosen : null;
  const current = jobOfRoute
    ? null
    : (chosen ??
      (results.find(result => isBeat(result.id)) ?? results.find(result => isFit(result.id)) ?? results[0])?.id ??
      null);
  if (problem) {
    return (
      <div class="pad">
        <h1 class="hidden">Scan</h1>
        <p class="error" role="alert">
          {problem}
        </p>
        <button type="button" onClick={load}>
          Try again
        </button>{" "}
        <button type="button" onClick={home}>
          Back to the list
        </button>
      </div>
    );
  }
  if (!volume) return <p class="quiet pad">Opening the scan …</p>;
  return <Scan volume={volume} results={results} current={current} otherId={other} retry={jobOfRoute} />;
}

interface ScanProps {
  volume: Volume;
  results: Result[];
  current: string | null;
  otherId: string | null;
  retry: string | null;
}

function Scan({ volume, results, current, otherId, retry }: ScanProps) {
  const own = useWatched(jobs).filter(job => job.volume === volume.id);
  const [scene, setScene] = useState<Scene | null>(null);
  const [shown, setShown] = useState<Loaded | null>(null);
  const [other, setOther] = useState<Loaded | null>(null);
  const [problem, setProblem] = useState("");
  const running = useRef(new Set<string>());

  // A job that ends while its scan is open shows its result. While somebody corrects a fit, only a job of this tab does:
  // another result would replace the one that is corrected, and discard what was typed.
  useEffect(() => {
    for (const job of own) {
      if (isActive(job)) {
        running.current.add(job.id);
        continue;
      }
      if (!running.current.delete(job.id) || job.state !== "succeeded") continue;
      const made = madeBy(job);
      if (!made || job.kind === "reading" || !isAt(volume.id) || (scene?.edit.value && !isFiledHere(job))) continue;
      if (job.kind === "comparison") openComparison(made);
      else if (job.kind === "serial") openSerial(made);
      else open(volume.id, made, job.labels["parent"] ?? null);
    }
  }, [own]);

  const parameters = current ? find(current)?.parameters : undefined;
  // Volumes that count as gates only by order are not summed by the service.
  const frame = parameters?.["frame"] ?? (parameters?.["gated"] ? 0 : null);
  useEffect(() => {
    let gone = false;
    setProblem("");
    voxelsOf(volume, typeof frame === "number" ? frame : null).then(
      voxels => !gone && setScene(new Scene(voxels, kept(LUT, "Hot iron"), kept(WALL_LUT, UPTAKE))),
      error => !gone && setProblem(words(error)),
    );
    return () => void (gone = true);
  }, [volume, frame]);

  useEffect(() => {
    let gone = false;
    const take = (wanted: string | null, set: (loaded: Loaded | null) => void) => {
      if (!wanted) return set(null);
      (find(wanted) ? Promise.resolve(find(wanted)) : loadResult(wanted))
        .then(result => (result ? loadLoaded(result) : null))
        .then(
          loaded => {
            if (gone) return;
            set(loaded);
            if (!loaded) setProblem("This result was erased.");
          },
          error => !gone && setProblem(words(error)),
        );
    };
    take(current, setShown);
    take(otherId, setOther);
    return () => void (gone = true);
  }, [current, otherId]);

  // A model knows no axis; a fit of the same scan lends it.
  useEffect(() => {
    const fit = scene && !scene.heart.value && shown && resultsOf(volume.id).find(result => isFit(result.id));
    if (fit)
      void loadLoaded(fit).then(
        loaded => (scene.heart.value ??= loaded.heart),
        () => undefined,
      );
  }, [scene, shown]);

  const gates = shown?.beat?.report.gates.length ?? 0;
  useEffect(() => {
    if (!scene || gates === 0 || (scene.gates.value.length === gates && scene.gates.value.every(Boolean))) return;
    let gone = false;
    readGates(volume, gates, read => {
      if (!gone) scene.gates.value = read;
      return !gone;
    }).catch(error => !gone && setProblem(words(error)));
    return () => void (gone = true);
  }, [scene, volume, gates]);

  const busy = own.some(isActive);

  // What would be printed, whenever somebody prints.
  const printed = useRef<Printed | null>(null);
  const [changed, setChanged] = useState<[string, string][]>([]);
  printed.current = scene && shown ? { scene, volume, shown, other, parameters: changed } : null;
  useEffect(() => printsAs(() => printed.current && sheetOf(printed.current)), []);
  useEffect(() => {
    const result = shown?.result;
    if (result)
      void parameterSpecs().then(
        specs => setChanged(Object.entries(draftOf(result.parameters, specs[kindOf(result.id)]))),
        () => undefined,
      );
  }, [shown]);

  // A job tells of its progress many times a second: the pictures are not drawn again for that, which would take the
  // processor from the job.
  const pictures = useMemo(
    () =>
      scene && (
        <Pictures
          scene={scene}
          name={nameOf(volume)}
          shown={shown}
          other={other}
          empty={
            busy
              ? "The wall appears here when the work is done."
              : "Fit the ventricle, or make a model, to see the wall here."
          }>
          <Busy volume={volume.id} />
          {shown?.beat && <Player scene={scene} report={shown.beat.report} />}
        </Pictures>
      ),
    [scene, volume, shown, other, busy],
  );
  const facts = useMemo(
    () => shown && scene && <Facts scene={scene} volume={volume} shown={shown} other={other} />,
    [scene, volume, shown, other],
  );
  return (
    <div class="viewer">
      <Side
        volume={volume}
        results={results}
        jobs={own}
        current={current}
        otherId={otherId}
        retry={retry}
        scene={scene}
        shown={shown}
      />
      <section class="stage" aria-label="Pictures">
        {problem && (
          <p class="error" role="alert">
            {problem}
          </p>
        )}
        {pictures ?? (!problem && <p class="quiet pad">Reading the voxels …</p>)}
      </section>
      <aside class="facts" aria-label="Measurements">
        {facts ?? (
          <p class="quiet pad">
            {current ? "Reading the result …" : "Fit the ventricle to see its measurements and polar map here."}
          </p>
        )}
      </aside>
    </div>
  );
}

/** The work that is under way on a scan. */
function Busy({ volume }: { volume: string }) {
  const job = useWatched(jobs).find(one => one.volume === volume && isActive(one));
  return job ? (
    <div class="busy" role="status">
      <JobLine job={job} />
    </div>
  ) : null;
}

interface SideProps {
  volume: Volume;
  results: Result[];
  jobs: Job[];
  current: string | null;
  otherId: string | null;
  retry: string | null;
  scene: Scene | null;
  shown: Loaded | null;
}

const WORK: { kind: Kind; name: string }[] = [
  { kind: "beat", name: "Fit the beat" },
  { kind: "segmentation", name: "Fit the ventricle" },
  { kind: "model", name: "Surface model" },
];

function Side({ volume, results, jobs: own, current, otherId, retry, scene, shown }: SideProps) {
  const [tab, setTab] = useState<"work" | "correct" | null>(retry ? "work" : null);
  const [kind, setKind] = useState<Kind>(isGated(volume) ? "beat" : "segmentation");
  const [draft, setDraft] = useState<Draft>({});
  const [problem, setProblem] = useState<{ field: string | null; text: string } | null>(null);
  const [sending, setSending] = useState(false);
  const readable = useMemo(() => shown && readableScan(shown), [shown]);

  const repeat = ({ kind, parameters }: Pick<Job, "kind" | "parameters">) => {
    if (kind === "normals" || kind === "comparison" || kind === "serial" || kind === "reading") return;
    setKind(kind);
    setTab("work");
    void parameterSpecs().then(specs => setDraft(draftOf(parameters as Parameters, specs[kind])));
  };
  const mend = (failed: Job) => (asksForHeart(failed) ? setTab("correct") : repeat(failed));
  useEffect(() => {
    if (!retry) return;
    void get<Job>(`/v1/jobs/${retry}`).then(
      job => {
        mend(job);
        if (job.error)
          setProblem({
            field: job.error.field?.split(/[./]/).pop() ?? null,
            text: sentences(job.error).join(" ").trim(),
          });
      },
      () => undefined,
    );
  }, [retry]);
  const send = async (event: Event) => {
    event.preventDefault();
    setProblem(null);
    setSending(true);
    try {
      const specs = await parameterSpecs();
      await file(kind, volume, valuesOf(draft, specs[kind]));
    } catch (error) {
      setProblem({ field: fieldOf(error), text: words(error) });
    }
    setSending(false);
  };
  // The tab decides whether slices show the handles of the correction.
  useEffect(() => {
    if (scene && tab !== "correct") {
      scene.edit.value = null;
      if (scene.tool.value === "correct") scene.tool.value = "cursor";
    }
  }, [tab, scene]);

  return (
    <aside class="side" aria-label="Scan and work">
      <header>
        <h1>{titleOf(volume)}</h1>
        {study(volume) && (
          <p>
            {study(volume)} <SimulatedMark of={volume} />
          </p>
        )}
        <p class="quiet">
          {volume.format}, {shape(volume)}
          <br />
          {moment(volume.created_at)}
        </p>
        {volume.warnings.map(text => (
          <p key={text} class="warning">
            {text}
          </p>
        ))}
      </header>
      <section aria-label="Results">
        <ul class="choices">
          {results.map(result => (
            <li key={result.id} class={result.id === current ? "current" : result.id === otherId ? "other" : ""}>
              <button
                type="button"
                class="pick"
                aria-pressed={result.id === current}
                onClick={() => open(volume.id, result.id, otherId === result.id ? null : otherId)}>
                <b>{resultName(result)}</b>
                <span class="quiet">
                  {timeOf(result, results)} <ReadMark of={result.id} />
                </span>
                <Origin result={result} jobs={own} results={results} />
              </button>
              {current && result.id !== current && (
                <button
                  type="button"
                  class="plain"
                  aria-pressed={result.id === otherId}
                  aria-label={`Compare with ${resultName(result)} of ${timeOf(result, results)}`}
                  onClick={() => open(volume.id, current, result.id === otherId ? null : result.id)}>
                  {result.id === otherId ? "Stop comparing" : "Compare"}
                </button>
              )}
              {result.id === current && (
                <Confirm
                  label={`Erase ${nameAmong(result, results)}`}
                  question="Erase this result?"
                  act={() => eraseResult(result.id).then(() => open(volume.id))}>
                  Erase
                </Confirm>
              )}
            </li>
          ))}
        </ul>
        <Comparisons volume={volume.id} />
        {own
          .filter(job => job.state !== "succeeded")
          .slice(0, 5)
          .map(job => (
            <JobLine key={job.id} job={job} onChange={mend} />
          ))}
      </section>
      {readable && <ReadingPanel key={readable.result.id} readable={readable} volume={volume} />}
      <div class="tabs" role="group" aria-label="What to do">
        <button
          type="button"
          class={results.length ? "" : "main"}
          aria-expanded={tab === "work"}
          onClick={() => setTab(tab === "work" ? null : "work")}>
          New fit or model
        </button>
        <button
          type="button"
          aria-expanded={tab === "correct"}
          disabled={!scene}
          onClick={() => {
            // Named in the address, so that no later fit takes its place.
            if (tab !== "correct" && current) open(volume.id, current, otherId);
            setTab(tab === "correct" ? null : "correct");
          }}>
          Correct by hand
        </button>
      </div>
      {tab === "work" && (
        <form class="panel" onSubmit={event => void send(event)} aria-label="New fit or model">
          <span class="choice" role="group" aria-label="Kind of work">
            {WORK.filter(one => one.kind !== "beat" || volume.frames > 1).map(one => (
              <button
                key={one.kind}
                type="button"
                aria-pressed={kind === one.kind}
                onClick={() => {
                  setKind(one.kind);
                  setDraft({});
                  setProblem(null);
                }}>
                {one.name}
              </button>
            ))}
          </span>
          <ParameterForm kind={kind} volume={volume} draft={draft} onChange={setDraft} problem={problem} />
          <button class="main" disabled={sending}>
            {kind === "model" ? "Make the model" : "Fit"}
          </button>
          {shown && (
            <button
              type="button"
              class="plain"
              onClick={() =>
                repeat({ kind: kindOf(shown.result.id), parameters: shown.result.parameters as Job["parameters"] })
              }>
              Take the parameters of the shown result
            </button>
          )}
        </form>
      )}
      {tab === "correct" && scene && <Correction scene={scene} volume={volume} shown={shown} />}
      <p class="research foot">Research software, not a medical device. Measurements are not a diagnosis.</p>
    </aside>
  );
}

/** The comparisons, of rest and stress and over the years, in which a scan takes part. */
function Comparisons({ volume }: { volume: string }) {
  useWatched(comparisons);
  useWatched(serials);
  return (
    <>
      {comparisonsOf(volume).map(made => (
        <a key={made.id} class="result" href={`#/comparison/${made.id}`}>
          <b>Rest and stress</b> <span class="quiet">{moment(made.created_at)}</span> <ReadMark of={made.id} />
        </a>
      ))}
      {serialsOf(volume).map(made => (
        <a key={made.id} class="result" href={`#/serial/${made.id}`}>
          <b>{resultName(made)}</b> <span class="quiet">{moment(made.created_at)}</span>
        </a>
      ))}
      <button
        type="button"
        class="plain"
        onClick={() => {
          if (!picked.value.includes(volume)) pick(volume);
          home();
        }}>
        Compare rest and stress …
      </button>
    </>
  );
}

/** Which result a corrected fit came from, and what was changed. */
function Origin({ result, jobs: own, results }: { result: Result; jobs: Job[]; results: Result[] }) {
  const labels = own.find(job => madeBy(job) === result.id && job.labels["changed"])?.labels;
  if (!labels) return null;
  const parent = results.find(other => other.id === labels["parent"]);
  const names: Record<string, string> = { center: "centre", edge: "wall shown", roll: "turn" };
  const changed = (labels["changed"] ?? "")
    .split(" ")
    .map(name => names[name] ?? name)
    .join(", ");
  return (
    <span class="quiet">
      by hand: {changed}
      {labels["parent"] && `; from ${parent ? `the fit of ${timeOf(parent, results)}` : "a fit that was erased"}`}
    </span>
  );
}

function Facts({ scene, volume, shown, other }: { scene: Scene; volume: Volume; shown: Loaded; other: Loaded | null }) {
  return (
    <>
      <Takeaways result={shown.result} volume={volume} />
      {shown.beat && <Figures shown={shown} other={other} />}
      {shown.beat && <BeatCharts scene={scene} report={shown.beat.report} />}
      {shown.polar && shown.heart && (
        <div class="polars">
          {shown.beat && <h2>Uptake, all gates</h2>}
          <PolarView
            scene={scene}
            map={shown.polar}
            mesh={shown.mesh}
            heart={shown.heart}
            title={other?.polar ? "Shown fit" : "Polar map"}
          />
          {shown.report?.polar?.attenuation && <p class="quiet">{shown.report.polar.attenuation.note}</p>}
          {other?.polar && other.heart && (
            <details open>
              <summary>
                Compared: {resultName(other.result)}, {timeOf(other.result, [shown.result])}
              </summary>
              <PolarView scene={scene} map={other.polar} mesh={other.mesh} heart={other.heart} title="Compared fit" />
            </details>
          )}
        </div>
      )}
      <PerfusionView scene={scene} shown={shown} />
      {shown.beat && <BeatMaps scene={scene} shown={shown} beat={shown.beat} />}
      {!shown.beat && <Figures shown={shown} other={other} />}
      <Downloads result={shown.result} volume={volume} />
    </>
  );
}
