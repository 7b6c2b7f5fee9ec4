// The list of scans: what is being sent, what is stored, what was made of it.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Job, type Kind, type Result, type Volume, words } from "./api";
import { Confirm } from "./confirm";
import { useDrop } from "./drop";
import { Examples } from "./examples";
import { JobLine } from "./jobline";
import {
  beats,
  comparisons,
  eraseVolume,
  fits,
  isActive,
  jobs,
  loadResultsOf,
  loaded,
  models,
  put,
  refresh,
  refreshMade,
  scansOf,
  serials,
  trouble,
  volumes,
} from "./library";
import { byStudy, offeredPair, pairsOf, pick, picked, statedRole, stressOf, studyKey } from "./pairing";
import { PickedPair } from "./pairform";
import { Picture } from "./picture";
import { ComparisonLink, ResultLink, SerialLink } from "./resultlink";
import { open, openComparison, route } from "./route";
import { toldOf } from "./scankind";
import {
  type Asked,
  type Order,
  type Show,
  WHOLE,
  addStored,
  arrived,
  ask,
  asked,
  isWhole,
  listed,
  loadMore,
  more,
  readList,
  receiving,
  watchList,
} from "./scanlist";
import { SimulatedMark } from "./simulatedmark";
import { useWatched } from "./state";
import { StudyCard } from "./studycard";
import { type Upload, add, keepNames, onStored, uploads } from "./upload";
import { Uploads } from "./uploadlist";
import {
  acquisition,
  bytes,
  cut,
  isGated,
  isLabelMap,
  moment,
  nameOf,
  newest,
  shape,
  study,
  titleOf,
  wasSentAs,
} from "./words";
import { file, fileComparison } from "./work";

type Then = "fit" | "model" | "nothing";

/** The kind of fit for a scan: its gates are fitted together. */
const fitOf = (volume: Volume) => (isGated(volume) ? "beat" : "segmentation");

/** Whether it is all that this tab has sent, or all of an example. */
function isAlone({ isExample, batch }: Upload): boolean {
  const all = uploads.value.filter(upload => !isExample || upload.batch === batch);
  return all.length === 1 && all.every(upload => upload.state === "stored");
}

/** Compares the two scans of an example, which say what they are. Its view offers the beats, fitted by its own model. */
async function compareExample(pair: [Volume, Volume]): Promise<void> {
  const { stress } = stressOf(...pair);
  const [atStress, atRest] = stress === pair[1] ? [pair[1], pair[0]] : pair;
  const none = { fits: { stress: null, rest: null }, normals: null, parameters: {} };
  const job = await fileComparison({ stress: atStress, rest: atRest, ...none });
  if (route.value.view === "list") openComparison(job.id);
}

const THEN = "ventriform.then";
/** Pause after the last letter before a search is asked for, ms. */
const TYPING = 250;

export function WorkList() {
  const [then, setThen] = useState<Then>(() => (localStorage.getItem(THEN) as Then | null) ?? "fit");
  const [message, setMessage] = useState("");
  useEffect(() => {
    localStorage.setItem(THEN, then);
    onStored(
      (volume, upload) => {
        addStored(volume);
        if (then === "nothing" || isLabelMap(volume)) return;
        const alone = isAlone(upload);
        // The scans of an example that has several are compared before each is fitted.
        if (upload.isExample && !alone) return;
        file(then === "model" ? "model" : fitOf(volume), volume, {}).then(
          () => alone && route.value.view === "list" && open(volume.id),
          error => setMessage(words(error)),
        );
      },
      (together, areExamples) => {
        const pair = offeredPair(together);
        if (!pair) return;
        if (areExamples && then !== "nothing") compareExample(pair).catch(error => setMessage(words(error)));
        else picked.value = pair.map(volume => volume.id);
      },
    );
  }, [then]);
  return (
    <div class="list">
      <h1 class="hidden">Scans</h1>
      <Drop then={then} onThen={setThen} />
      <p class="error" role="status">
        {message}
      </p>
      <Uploads />
      <PickedPair />
      <Scans />
    </div>
  );
}

function Drop({ then, onThen }: { then: Then; onThen: (then: Then) => void }) {
  const over = useDrop(add);
  const chooser = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);
  const known = useWatched(volumes).length + useWatched(uploads).length;
  const isLoaded = useWatched(loaded);
  const named = useWatched(keepNames);
  const chosen = (input: HTMLInputElement) => {
    void add([...(input.files ?? [])]);
    input.value = "";
  };
  const empty = isLoaded && known === 0;
  return (
    <section class={`drop${over ? " over" : ""}${empty ? " empty" : ""}`} aria-label="Add scans">
      <div class="choose">
        <strong>{over ? "Let go to send" : "Drop cardiac SPECT scans here"}</strong>
        <span class="quiet">DICOM, NIfTI, .hdr with .img: files, series, folders, zips.</span>
      </div>
      <div class="buttons">
        <button type="button" class="main" onClick={() => chooser.current?.click()}>
          Choose files
        </button>
        <button type="button" onClick={() => folder.current?.click()}>
          Choose a folder
        </button>
        <input
          ref={chooser}
          class="hidden"
          type="file"
          multiple
          tabIndex={-1}
          aria-label="Files of scans"
          onChange={event => chosen(event.currentTarget)}
        />
        <input
          ref={folder}
          class="hidden"
          type="file"
          multiple
          tabIndex={-1}
          aria-label="Folder of scans"
          {...{ webkitdirectory: true }}
          onChange={event => chosen(event.currentTarget)}
        />
        <label class="inline">
          then
          <select value={then} onChange={event => onThen(event.currentTarget.value as Then)}>
            <option value="fit">fit the left ventricle</option>
            <option value="model">make a surface model</option>
            <option value="nothing">only store</option>
          </select>
        </label>
        <label class="inline">
          <input type="checkbox" checked={named} onChange={event => (keepNames.value = event.currentTarget.checked)} />{" "}
          keep file names
        </label>
      </div>
    </section>
  );
}

interface Row {
  volume: Volume;
  results: Result[];
  open: Job[];
  /** The comparisons in which it takes part. */
  compared: Result[];
  /** Those over the years. */
  years: Result[];
}

function Scans() {
  const all = useWatched(listed);
  const known = useWatched(volumes);
  const allFits = useWatched(fits);
  const allModels = useWatched(models);
  const allBeats = useWatched(beats);
  const allJobs = useWatched(jobs);
  const allComparisons = useWatched(comparisons);
  const allSerials = useWatched(serials);
  const next = useWatched(more);
  const isLoaded = useWatched(loaded);
  const problem = useWatched(trouble);
  const of = useWatched(asked);
  useEffect(() => watchList(refreshMade), []);
  const rows = useMemo((): Row[] => {
    const results = [...allBeats, ...allFits, ...allModels].sort(newest);
    const here = new Set(all.map(volume => volume.id));
    // The service does not know the names of files that this tab has sent.
    const sent = known.filter(volume => !here.has(volume.id) && wasSentAs(volume, of.search));
    return [...sent, ...all].map(volume => ({
      volume,
      results: results.filter(result => result.volume === volume.id),
      open: allJobs.filter(job => job.volume === volume.id && job.state !== "succeeded" && job.kind !== "normals"),
      compared: allComparisons
        .filter(made => made.volume === volume.id || made.parameters["rest"] === volume.id)
        .sort(newest),
      years: allSerials.filter(made => scansOf(made).includes(volume.id)).sort(newest),
    }));
  }, [all, known, of.search, allFits, allModels, allBeats, allJobs, allComparisons, allSerials]);
  const cards = useMemo(() => [...byStudy(rows, row => row.volume)], [rows]);
  if (!isLoaded)
    return problem ? (
      <p class="error pad">
        {problem}{" "}
        <button type="button" onClick={() => void refresh()}>
          Try again
        </button>
      </p>
    ) : (
      <p class="quiet pad">Reading the list …</p>
    );
  if (all.length === 0 && isWhole(of)) {
    return (
      <section class="welcome">
        <Receiving />
        <h2>From scan to ventricle</h2>
        <ol>
          <li>
            <b>Drop a scan.</b> It is stored on this service and nowhere else.
          </li>
          <li>
            <b>The left ventricle is found and fitted</b>, usually within two seconds.
          </li>
          <li>
            <b>Of a gated scan, all gates are fitted together</b>: the wall beats, with its volumes and ejection
            fraction.
          </li>
          <li>
            <b>Look at slices, wall and polar map together</b>; correct axis and centre by hand, compare, download.
          </li>
          <li>
            <b>Drop a patient’s scans at stress and at rest together</b> to compare them: slices above each other, what
            is reversible, TID.
          </li>
        </ol>
        <h2 class="aside">No scan at hand? Try a simulated one:</h2>
        <Examples />
      </section>
    );
  }
  return (
    <section aria-label="Stored scans">
      <Tools count={`${rows.length}${next ? "+" : ""} ${rows.length === 1 ? "scan" : "scans"}`} />
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
      <Arrived />
      <Receiving />
      <ul class="scans">
        {cards.map(([key, card]) => (
          <Card key={key} rows={card} />
        ))}
      </ul>
      {rows.length === 0 && <p class="quiet pad">Nothing matches.</p>}
      {next && <More />}
    </section>
  );
}

const REFINED: (keyof Asked)[] = ["role", "modality", "from", "to"];

/** What of the list is asked for: it is searched, filtered and ordered by the service. */
function Tools({ count }: { count: string }) {
  const of = useWatched(asked);
  const [search, setSearch] = useState(of.search);
  const typing = useRef<ReturnType<typeof setTimeout>>();
  const change = (text: string) => {
    setSearch(text);
    clearTimeout(typing.current);
    typing.current = setTimeout(() => ask({ search: text }), TYPING);
  };
  useEffect(() => () => clearTimeout(typing.current), []);
  const refined = REFINED.filter(name => of[name] !== WHOLE[name]).length;
  return (
    <div class="tools">
      <input
        type="search"
        aria-label="Search patient, name, id or label"
        placeholder="Search patient, name, id or label"
        maxLength={128}
        value={search}
        onInput={event => change(event.currentTarget.value)}
      />
      <label class="inline">
        Show
        <select value={of.show} onChange={event => ask({ show: event.currentTarget.value as Show })}>
          <option value="all">all scans</option>
          <option value="segmentation">with a fit</option>
          <option value="beat">with a beat</option>
          <option value="model">with a model</option>
          <option value="comparison">with rest and stress compared</option>
          <option value="nothing">without a result</option>
          <option value="unfinished">with a job under way</option>
          <option value="failed">with a failed job</option>
        </select>
      </label>
      <label class="inline">
        Sort
        <select value={of.order} onChange={event => ask({ order: event.currentTarget.value as Order })}>
          <option value="newest">newest first</option>
          <option value="study_date">latest study first</option>
          <option value="patient">by patient</option>
          <option value="name">by name</option>
          <option value="largest">largest first</option>
        </select>
      </label>
      <details class="filters">
        <summary>Filters{refined > 0 && ` (${refined})`}</summary>
        <label class="inline">
          Made at
          <select value={of.role} onChange={event => ask({ role: event.currentTarget.value as Asked["role"] })}>
            <option value="">rest or stress</option>
            <option value="rest">rest</option>
            <option value="stress">stress</option>
          </select>
        </label>
        <label class="inline">
          Modality
          <select value={of.modality} onChange={event => ask({ modality: event.currentTarget.value })}>
            <option value="">any</option>
            <option value="NM">NM</option>
            <option value="PT">PT</option>
            <option value="CT">CT</option>
            <option value="MR">MR</option>
          </select>
        </label>
        <label class="inline">
          Studies from
          <input type="date" value={of.from} onChange={event => ask({ from: event.currentTarget.value })} />
        </label>
        <label class="inline">
          to
          <input type="date" value={of.to} onChange={event => ask({ to: event.currentTarget.value })} />
        </label>
        {refined > 0 && (
          <button type="button" class="plain" onClick={() => ask({ role: "", modality: "", from: "", to: "" })}>
            No filter
          </button>
        )}
      </details>
      <details class="filters">
        <summary>Try an example</summary>
        <Examples />
      </details>
      <span class="quiet" role="status">
        {count}
      </span>
    </div>
  );
}

/** What has come since the list was read: rows do not move under the hand of who reads them. */
function Arrived() {
  const fresh = useWatched(arrived).length;
  const what = `${fresh} new ${fresh === 1 ? "scan" : "scans"}`;
  const show = () => void readList().catch(error => (trouble.value = words(error)));
  return (
    <div class="arrived" role="status">
      {fresh > 0 && (
        <button type="button" onClick={show}>
          Show {what}
        </button>
      )}
    </div>
  );
}

/** What other systems are sending. */
function Receiving() {
  const now = useWatched(receiving);
  if (!now?.series) return null;
  return (
    <p class="quiet" role="status">
      {now.series} series {now.series === 1 ? "is" : "are"} being received: {now.objects}{" "}
      {now.objects === 1 ? "object" : "objects"}, {bytes(now.bytes)} so far.
    </p>
  );
}

/** Goes on with the list; the first of the new rows is focused. */
function More() {
  const [reading, setReading] = useState(false);
  const go = () => {
    const before = new Set([...document.querySelectorAll(".scan a.name")].map(link => link.getAttribute("href")));
    setReading(true);
    loadMore()
      .then(
        () =>
          requestAnimationFrame(() => {
            const links = [...document.querySelectorAll<HTMLAnchorElement>(".scan a.name")];
            links.find(link => !before.has(link.getAttribute("href")))?.focus();
          }),
        error => (trouble.value = words(error)),
      )
      .finally(() => setReading(false));
  };
  return (
    <div class="paging">
      <button type="button" disabled={reading} onClick={go}>
        Load more
      </button>
    </div>
  );
}

/** A patient's study with its scans in rows, or a scan of no study by itself. */
function Card({ rows }: { rows: Row[] }) {
  const known = useWatched(volumes);
  const [first] = rows;
  const key = first ? studyKey(first.volume) : null;
  const scans = useMemo(() => known.filter(volume => studyKey(volume) === key), [known, key]);
  if (!first) return null;
  if (key === null) return <ScanRow row={first} compared={first.compared} alone />;
  const ids = new Set(scans.map(volume => volume.id));
  const isInside = (made: Result) => ids.has(made.volume) && ids.has(String(made.parameters["rest"]));
  const compared = new Map(rows.flatMap(row => row.compared.filter(isInside).map(made => [made.id, made])));
  const pairing = pairsOf(scans);
  const place = new Map(pairing.pairs.flatMap(pair => [pair.stress.id, pair.rest.id]).map((id, at) => [id, at]));
  const placeOf = (row: Row) => place.get(row.volume.id) ?? place.size;
  return (
    <StudyCard name={key} scans={scans} pairing={pairing} compared={[...compared.values()].sort(newest)}>
      {rows
        .toSorted((a, b) => placeOf(a) - placeOf(b))
        .map(row => (
          <ScanRow
            key={row.volume.id}
            row={{ ...row, open: row.open.filter(job => job.kind !== "serial"), years: [] }}
            compared={row.compared.filter(made => !isInside(made))}
          />
        ))}
    </StudyCard>
  );
}

/** `alone`: no other scan of its study is beside it, so that it says whose it is. */
function ScanRow({
  row: { volume, results, open: openJobs, years },
  compared,
  alone = false,
}: {
  row: Row;
  compared: Result[];
  alone?: boolean;
}) {
  const chosen = useWatched(picked).includes(volume.id);
  const role = statedRole(volume);
  const [problem, setProblem] = useState("");
  const [state, setState] = useState("");
  const name = nameOf(volume);
  const labels = Object.entries(volume.labels).filter(([label]) => label !== "name");
  const described = [...acquisition(volume), toldOf(volume)].filter(Boolean).join(" · ");
  useEffect(() => loadResultsOf(volume.id), [volume.id]);
  const start = (kind: Kind) => () => {
    setProblem("");
    file(kind, volume, {}).then(put, error => setProblem(words(error)));
  };
  return (
    <li class="scan">
      <a class="thumb" href={`#/scan/${volume.id}`} tabIndex={-1} aria-hidden="true">
        <Picture path={volume.links.preview} label="" />
      </a>
      <div class="what">
        <span class="title">
          <a class="name" href={`#/scan/${volume.id}`} title={name}>
            {cut(titleOf(volume))}
          </a>
          {role && <span class={`role ${role}`}>{role}</span>}
          {alone && <SimulatedMark of={volume} />}
        </span>
        {alone && study(volume) && <span title={study(volume)}>{study(volume, cut)}</span>}
        {described && <span>{described}</span>}
        <span class="quiet">
          {moment(volume.created_at)} · {bytes(volume.bytes)} · {volume.format} · {shape(volume)}
          {isLabelMap(volume) && " · label map"}
          {volume.legal_hold ? " · on legal hold" : ""}
        </span>
        {labels.length > 0 && (
          <span class="labels">
            {labels.map(([label, value]) => (
              <span key={label} title={value}>
                {label}: {cut(value)}
              </span>
            ))}
          </span>
        )}
        {volume.warnings.length > 0 && <span class="warning">{volume.warnings.join(" ")}</span>}
      </div>
      <div class="results">
        {openJobs.map(job => (
          <JobLine key={job.id} job={job} />
        ))}
        {compared.slice(0, 2).map(made => (
          <ComparisonLink key={made.id} made={made} />
        ))}
        {years.slice(0, 2).map(made => (
          <SerialLink key={made.id} made={made} />
        ))}
        {results.slice(0, 4).map(result => (
          <ResultLink key={result.id} result={result} among={results} />
        ))}
        {results.length > 4 && (
          <a class="result" href={`#/scan/${volume.id}`}>
            and {results.length - 4} more
          </a>
        )}
        {results.length + compared.length + years.length === 0 && !openJobs.some(isActive) && (
          <span class="quiet">no result yet</span>
        )}
        {problem && <span class="error">{problem}</span>}
        {state && (
          <span class="quiet" role="status">
            {state}
          </span>
        )}
      </div>
      <div class="actions">
        <button
          type="button"
          onClick={start(fitOf(volume))}
          aria-label={`Fit ${isGated(volume) ? "the beat" : "the ventricle"} of ${name}`}>
          Fit
        </button>
        <button type="button" onClick={start("model")} aria-label={`Make a model of ${name}`}>
          Model
        </button>
        {!isLabelMap(volume) && (
          <button
            type="button"
            class="plain"
            aria-pressed={chosen}
            aria-label={`Pick ${name} to compare rest and stress`}
            onClick={() => pick(volume.id)}>
            {chosen ? "Picked" : "Pick"}
          </button>
        )}
        <button
          type="button"
          class="plain"
          aria-label={`Download all of ${name} as zip`}
          onClick={() => {
            setProblem("");
            void import("./bundle")
              .then(bundle => bundle.saveScan(volume, setState))
              .catch((error: unknown) => {
                setState("");
                setProblem(words(error));
              });
          }}>
          Zip
        </button>
        <Confirm
          label={`Erase ${name}`}
          question="Erase the scan and all that was made of it?"
          act={() => eraseVolume(volume.id)}>
          Erase
        </Confirm>
      </div>
    </li>
  );
}
