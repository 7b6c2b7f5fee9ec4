// One scan: its slices, the wall, the polar map, what was measured, and what can be done about it.

import { useCallback, useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Job, type Result, type Volume, fieldOf, get, sentences, words } from "../api";
import { Confirm } from "../confirm";
import { JobLine } from "../jobline";
import { eraseResult, find, fits, isActive, jobs, loadResult, loadScan, models, resultsOf } from "../library";
import { type Draft, type Kind, ParameterForm, draftOf, parameterSpecs, valuesOf } from "../parameters";
import { home, open, route } from "../route";
import { useWatched } from "../state";
import { file } from "../work";
import { isFit, moment, nameOf, resultName, shape, study } from "../words";
import { LUTS } from "./colours";
import { Correction } from "./correction";
import { Downloads, Figures } from "./figures";
import { HEART_WIDTH, type Loaded, layersOf, loadLoaded, voxelsOf } from "./loaded";
import { PATIENT, heartPlanes } from "./plane";
import { PolarView, WALL_LUT } from "./polarview";
import { type Layer, Scene, type Tool } from "./scene";
import { type Printed, printsAs } from "./sheet";
import { Slice } from "./slice";
import { Stack } from "./stack";
import { ColourBar, Wall, uptake } from "./wall";
import { screenshot } from "./screenshot";

const LUT = "ventriform.lut";

function kept(key: string, standard: string) {
  return LUTS[localStorage.getItem(key) ?? ""] ?? LUTS[standard]!;
}

export function Viewer({ volume: id }: { volume: string }) {
  const [volume, setVolume] = useState<Volume | null>(null);
  const [problem, setProblem] = useState("");
  const { result: chosen, other } = useWatched(route);
  const known = useWatched(fits).length + useWatched(models).length;
  const load = useCallback(() => {
    setProblem("");
    loadScan(id).then(setVolume, error => setProblem(words(error)));
  }, [id]);
  useEffect(load, [load]);
  const results = useMemo(() => resultsOf(id), [id, known, volume]);
  const jobOfRoute = chosen?.startsWith("job_") ? chosen : null;
  const current = jobOfRoute ? null : (chosen ?? (results.find(result => isFit(result.id)) ?? results[0])?.id ?? null);
  if (problem) {
    return <div class="pad"><p class="error" role="alert">{problem}</p><button type="button" onClick={load}>Try again</button> <button type="button" onClick={home}>Back to the list</button></div>;
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
  const seen = useRef(new Set(own.filter(job => !isActive(job)).map(job => job.id)));

  // A job that ends while its scan is open shows its result.
  useEffect(() => {
    for (const job of own) {
      if (job.state !== "succeeded" || seen.current.has(job.id)) continue;
      seen.current.add(job.id);
      const made = job.segmentation ?? job.model;
      if (made) open(volume.id, made, job.labels["parent"] ?? null);
    }
  }, [own]);

  const frame = (current && find(current)?.parameters["frame"]) ?? null;
  useEffect(() => {
    let gone = false;
    setProblem("");
    voxelsOf(volume, typeof frame === "number" ? frame : null).then(
      voxels => !gone && setScene(new Scene(voxels, kept(LUT, "Hot iron"), kept(WALL_LUT, "Perfusion"))),
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
        .then(loaded => {
          if (gone) return;
          set(loaded);
          if (!loaded) setProblem("This result was erased.");
        }, error => !gone && setProblem(words(error)));
    };
    take(current, setShown);
    take(otherId, setOther);
    return () => void (gone = true);
  }, [current, otherId]);

  // What would be printed, whenever somebody prints.
  const printed = useRef<Printed | null>(null);
  const [changed, setChanged] = useState<[string, string][]>([]);
  printed.current = scene && shown ? { scene, volume, shown, other, parameters: changed } : null;
  useEffect(() => printsAs(() => printed.current), []);
  useEffect(() => {
    const result = shown?.result;
    if (result) void parameterSpecs().then(specs => setChanged(Object.entries(draftOf(result.parameters, specs[isFit(result.id) ? "segmentation" : "model"]))), () => undefined);
  }, [shown]);

  return (
    <div class="viewer">
      <Side volume={volume} results={results} jobs={own} current={current} otherId={otherId} retry={retry} scene={scene} shown={shown} />
      <section class="stage" aria-label="Pictures">
        {problem && <p class="error" role="alert">{problem}</p>}
        {scene ? <Pictures scene={scene} volume={volume} shown={shown} other={other} busy={own.find(isActive)} /> : !problem && <p class="quiet pad">Reading the voxels …</p>}
      </section>
      <aside class="facts" aria-label="Measurements">
        {shown && scene ? <Facts scene={scene} volume={volume} shown={shown} other={other} /> : <p class="quiet pad">{current ? "Reading the result …" : "Fit the ventricle to see its measurements and polar map here."}</p>}
      </aside>
    </div>
  );
}

interface PicturesProps {
  scene: Scene;
  volume: Volume;
  shown: Loaded | null;
  other: Loaded | null;
  busy: Job | undefined;
}

function Pictures({ scene, volume, shown, other, busy }: PicturesProps) {
  const [heartAligned, setHeartAligned] = useState(true);
  const [big, setBig] = useState<number | null>(null);
  const heart = useWatched(scene.heart);
  const layers = useWatched(scene.layers);
  const window_ = useWatched(scene.window);
  const tool = useWatched(scene.tool);
  const lut = useWatched(scene.lut);
  const edit = useWatched(scene.edit);
  const difference = useWatched(scene.difference);
  const smooth = useWatched(scene.smooth);
  const stage = useRef<HTMLDivElement>(null);
  const [help, setHelp] = useState(false);

  // Each result brings its contours and its axis; the cursor goes to the heart the first time.
  useEffect(() => {
    const before = new Map(scene.layers.value.map(layer => [layer.name, layer.shown]));
    scene.layers.value = layersOf(shown, other).map(layer => ({ ...layer, shown: before.get(layer.name) ?? layer.shown }));
    scene.difference.value = null;
    const first = scene.heart.value === null;
    scene.heart.value = shown?.heart ?? other?.heart ?? scene.heart.value;
    if (shown && first) {
      scene.cursor.value = shown.middle;
      scene.view.value = { width: HEART_WIDTH, middle: scene.heart.value ? null : shown.middle };
      // The window reaches to the wall's own maximum: liver and gut may be hotter.
      const hottest = Math.max(...uptake(scene.voxels, shown.mesh));
      if (hottest > scene.voxels.lowest) scene.window.value = { low: scene.window.value.low, high: hottest };
    }
    if (!shown && scene.view.value.width === 0) scene.view.value = { width: 260, middle: null };
  }, [scene, shown, other]);
  // A model knows no axis; a fit of the same scan lends it.
  useEffect(() => {
    const fit = !scene.heart.value && shown && resultsOf(volume.id).find(result => isFit(result.id));
    if (fit) void loadLoaded(fit).then(loaded => (scene.heart.value ??= loaded.heart), () => undefined);
  }, [scene, shown]);

  const aligned = heart && heartAligned;
  const planes = useMemo(() => (aligned ? heartPlanes(heart) : PATIENT), [aligned, heart]);
  const short = useMemo(() => (heart ? heartPlanes(heart)[0]! : null), [heart]);
  const toggle = (name: string) => (scene.layers.value = layers.map(layer => (layer.name === name ? { ...layer, shown: !layer.shown } : layer)));
  const masks = shown?.mask && (other?.mask ?? shown.expert) ? { fit: shown.mask, other: (other?.mask ?? shown.expert)! } : null;

  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (event.ctrlKey || event.metaKey || event.altKey || ["INPUT", "SELECT", "TEXTAREA"].includes(target.tagName)) return;
      const keys: Record<string, () => void> = {
        h: () => setHeartAligned(now => !now),
        c: () => {
          const any = scene.layers.value.some(layer => layer.shown);
          scene.layers.value = scene.layers.value.map(layer => ({ ...layer, shown: !any }));
        },
        f: () => void (document.fullscreenElement ? document.exitFullscreen() : stage.current?.requestFullscreen()),
        w: () => (scene.tool.value = scene.tool.value === "window" ? "cursor" : "window"),
        m: () => (scene.tool.value = scene.tool.value === "move" ? "cursor" : "move"),
        "?": () => setHelp(now => !now),
        Escape: () => setBig(null),
      };
      keys[event.key]?.();
    };
    addEventListener("keydown", press);
    return () => removeEventListener("keydown", press);
  }, [scene]);

  const range = scene.voxels.highest - Math.min(0, scene.voxels.lowest);
  const tools: [Tool, string][] = [["cursor", "Point"], ["window", "Window"], ["move", "Move"]];
  return (
    <div class="pictures" ref={stage}>
      <div class="toolbar" role="toolbar" aria-label="How to look">
        <span class="choice" role="group" aria-label="Planes">
          <button type="button" aria-pressed={Boolean(aligned)} disabled={!heart} onClick={() => setHeartAligned(true)}>Heart</button>
          <button type="button" aria-pressed={!aligned} onClick={() => setHeartAligned(false)}>Patient</button>
        </span>
        <span class="choice" role="group" aria-label="What a drag does">
          {tools.map(([name, text]) => <button key={name} type="button" aria-pressed={tool === name || (name === "cursor" && tool === "correct")} onClick={() => (scene.tool.value = name === "cursor" && edit ? "correct" : name)}>{text}</button>)}
        </span>
        <label class="inline">
          <select aria-label="Colours" value={Object.keys(LUTS).find(name => LUTS[name] === lut)} onChange={event => {
            scene.lut.value = LUTS[event.currentTarget.value]!;
            localStorage.setItem(LUT, event.currentTarget.value);
          }}>
            {Object.keys(LUTS).map(name => <option key={name}>{name}</option>)}
          </select>
        </label>
        <label class="inline brightness">
          <ColourBar lut={lut} low={window_.low.toFixed(0)} high={window_.high.toFixed(0)} />
          <input type="range" aria-label="Brightest value" min={1} max={130} value={Math.round((100 * window_.high) / (range || 1))} onInput={event => (scene.window.value = { low: window_.low, high: (range * Number(event.currentTarget.value)) / 100 })} />
        </label>
        <span class="end">
          <button type="button" class="plain" title="Screenshot" aria-label="Screenshot" onClick={() => stage.current && screenshot(stage.current, nameOf(volume))}><Icon d="M3 6h3l1-2h6l1 2h3v10H3zM10 8a3 3 0 1 0 .01 0" /></button>
          <button type="button" class="plain" onClick={() => void (document.fullscreenElement ? document.exitFullscreen() : stage.current?.requestFullscreen())} title="Full screen" aria-label="Full screen"><Icon d="M3 8V3h5M12 3h5v5M17 12v5h-5M8 17H3v-5" /></button>
          <button type="button" class="plain" title="Keys and mouse" aria-label="Keys and mouse" aria-expanded={help} onClick={() => setHelp(!help)}>?</button>
        </span>
      </div>
      {help && <Keys />}
      {layers.length > 0 && (
        <div class="layers" role="group" aria-label="Contours">
          {layers.map(layer => (
            <label key={layer.name} class="inline">
              <input type="checkbox" checked={layer.shown} onChange={() => toggle(layer.name)} />
              <Swatch layer={layer} />
              {layer.name}
            </label>
          ))}
          {masks && (
            <label class="inline">
              <input type="checkbox" checked={difference !== null} onChange={event => (scene.difference.value = event.currentTarget.checked ? masks : null)} />
              difference <span class="quiet"><span class="only here" /> only here <span class="only there" /> only {other?.mask ? "compared" : "expert"}</span>
            </label>
          )}
          <label class="inline"><input type="checkbox" checked={smooth} onChange={event => (scene.smooth.value = event.currentTarget.checked)} /> smooth</label>
        </div>
      )}
      {busy && <div class="busy" role="status"><JobLine job={busy} /></div>}
      <div class={`grid${big === null ? "" : " one"}`}>
        {planes.map((plane, n) => (big === null || big === n) && <Slice key={n} scene={scene} plane={plane} onBig={() => setBig(big === n ? null : n)} />)}
        {(big === null || big === 3) && (shown ? (
          <Wall scene={scene} mesh={shown.mesh} inner={shown.otherEdge} other={other?.mesh ?? null} polar={shown.polar} displacement={shown.displacement} surface={shown.surface} />
        ) : <div class="off">{busy ? "The wall appears here when the work is done." : "Fit the ventricle, or make a model, to see the wall here."}</div>)}
      </div>
      {short && <Stack scene={scene} plane={short} />}
    </div>
  );
}

function Swatch({ layer }: { layer: Layer }) {
  return <svg class="swatch" viewBox="0 0 18 6" aria-hidden="true"><line x1="1" y1="3" x2="17" y2="3" stroke={layer.colour} stroke-width="3" stroke-dasharray={layer.dashed ? "3 3" : undefined} /></svg>;
}

function Icon({ d }: { d: string }) {
  return <svg class="icon" viewBox="0 0 20 20" aria-hidden="true"><path d={d} /></svg>;
}

function Keys() {
  const rows = [
    ["Click or drag", "put the cursor there, in all views"],
    ["Wheel, Page Up, Page Down", "through the slices"],
    ["Arrows", "move the cursor; on the 3-D view turn it"],
    ["Shift + drag, right button, [ ]", "window"],
    ["Ctrl + wheel, pinch, + −", "zoom; two fingers move the picture"],
    ["Double click", "one view large, and back"],
    ["H", "heart or patient planes"],
    ["C", "contours on and off"],
    ["W, M", "drag sets the window, moves the picture"],
    ["Home, 0", "back to the heart"],
    ["F", "full screen"],
  ];
  return <dl class="keys">{rows.map(([key, what]) => <div key={key}><dt>{key}</dt><dd>{what}</dd></div>)}</dl>;
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

function Side({ volume, results, jobs: own, current, otherId, retry, scene, shown }: SideProps) {
  const [tab, setTab] = useState<"work" | "correct" | null>(retry ? "work" : null);
  const [kind, setKind] = useState<Kind>("segmentation");
  const [draft, setDraft] = useState<Draft>({});
  const [problem, setProblem] = useState<{ field: string | null; text: string } | null>(null);
  const [sending, setSending] = useState(false);

  const repeat = (job: Pick<Job, "kind" | "parameters">) => {
    setKind(job.kind);
    setTab("work");
    void parameterSpecs().then(specs => setDraft(draftOf(job.parameters, specs[job.kind])));
  };
  useEffect(() => {
    if (!retry) return;
    void get<Job>(`/v1/jobs/${retry}`).then(job => {
      repeat(job);
      if (job.error) setProblem({ field: job.error.field?.split(/[./]/).pop() ?? null, text: sentences(job.error).join(" ").trim() });
    }, () => undefined);
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
        <h1>{nameOf(volume)}</h1>
        {study(volume) && <p>{study(volume)}</p>}
        <p class="quiet">{volume.format}, {shape(volume)}<br />{moment(volume.created_at)}</p>
        {volume.warnings.map(text => <p key={text} class="warning">{text}</p>)}
      </header>
      <section aria-label="Results">
        <ul class="choices">
          {results.map(result => (
            <li key={result.id} class={result.id === current ? "current" : result.id === otherId ? "other" : ""}>
              <button type="button" class="pick" aria-pressed={result.id === current} onClick={() => open(volume.id, result.id, otherId === result.id ? null : otherId)}>
                <b>{resultName(result)}</b>
                <span class="quiet">{moment(result.created_at)}</span>
                <Origin result={result} jobs={own} results={results} />
              </button>
              {current && result.id !== current && (
                <button type="button" class="plain" aria-pressed={result.id === otherId} aria-label={`Compare with ${resultName(result)} of ${moment(result.created_at)}`} onClick={() => open(volume.id, current, result.id === otherId ? null : result.id)}>{result.id === otherId ? "Stop comparing" : "Compare"}</button>
              )}
              {result.id === current && <Confirm label={`Erase ${resultName(result)}`} question="Erase this result?" act={() => eraseResult(result.id).then(() => open(volume.id))}>Erase</Confirm>}
            </li>
          ))}
        </ul>
        {own.filter(job => job.state !== "succeeded").slice(0, 5).map(job => <JobLine key={job.id} job={job} onChange={repeat} />)}
      </section>
      <div class="tabs" role="group" aria-label="What to do">
        <button type="button" class={results.length ? "" : "main"} aria-expanded={tab === "work"} onClick={() => setTab(tab === "work" ? null : "work")}>New fit or model</button>
        <button type="button" aria-expanded={tab === "correct"} disabled={!scene} onClick={() => setTab(tab === "correct" ? null : "correct")}>Correct by hand</button>
      </div>
      {tab === "work" && (
        <form class="panel" onSubmit={event => void send(event)} aria-label="New fit or model">
          <span class="choice" role="group" aria-label="Kind of work">
            <button type="button" aria-pressed={kind === "segmentation"} onClick={() => {
              setKind("segmentation");
              setDraft({});
              setProblem(null);
            }}>Fit the ventricle</button>
            <button type="button" aria-pressed={kind === "model"} onClick={() => {
              setKind("model");
              setDraft({});
              setProblem(null);
            }}>Surface model</button>
          </span>
          <ParameterForm kind={kind} volume={volume} draft={draft} onChange={setDraft} problem={problem} />
          <button class="main" disabled={sending}>{kind === "segmentation" ? "Fit" : "Make the model"}</button>
          {shown && <button type="button" class="plain" onClick={() => repeat({ kind: isFit(shown.result.id) ? "segmentation" : "model", parameters: shown.result.parameters })}>Take the parameters of the shown result</button>}
        </form>
      )}
      {tab === "correct" && scene && <Correction scene={scene} volume={volume} shown={shown} />}
      <p class="research foot">Research software, not a medical device. Measurements are no diagnosis.</p>
    </aside>
  );
}

/** Which result a corrected fit came from, and what was changed. */
function Origin({ result, jobs: own, results }: { result: Result; jobs: Job[]; results: Result[] }) {
  const labels = own.find(job => job.segmentation === result.id && job.labels["changed"])?.labels;
  if (!labels) return null;
  const parent = results.find(other => other.id === labels["parent"]);
  const names: Record<string, string> = { center: "centre", edge: "wall shown" };
  const changed = (labels["changed"] ?? "").split(" ").map(name => names[name] ?? name).join(", ");
  return <span class="quiet">by hand: {changed}{labels["parent"] && `; from ${parent ? `the fit of ${moment(parent.created_at)}` : "a fit that was erased"}`}</span>;
}

function Facts({ scene, volume, shown, other }: { scene: Scene; volume: Volume; shown: Loaded; other: Loaded | null }) {
  return (
    <>
      {shown.polar && shown.heart && (
        <div class="polars">
          <PolarView scene={scene} map={shown.polar} mesh={shown.mesh} heart={shown.heart} title={other?.polar ? "Shown fit" : "Polar map"} />
          {other?.polar && other.heart && (
            <details open>
              <summary>Compared: {resultName(other.result)}, {moment(other.result.created_at)}</summary>
              <PolarView scene={scene} map={other.polar} mesh={other.mesh} heart={other.heart} title="Compared fit" />
            </details>
          )}
        </div>
      )}
      <Figures shown={shown} other={other} />
      <Downloads result={shown.result} volume={volume} />
    </>
  );
}
