// Normal limits that are stored: what they are made of; one is added from its file, or erased.

import { useRef, useState } from "preact/hooks";
import { type Normals, call, save, words } from "./api";
import { Confirm } from "./confirm";
import { useDrop } from "./drop";
import { JobLine } from "./jobline";
import { eraseNormals, jobs, loadNormals, loaded, normals, trouble } from "./library";
import { useWatched } from "./state";
import { moment, number } from "./words";

const SEX: Record<string, string> = { F: "women", M: "men", mixed: "men and women together" };

export function LimitsView() {
  const all = useWatched(normals);
  const isLoaded = useWatched(loaded);
  const problem = useWatched(trouble);
  const building = useWatched(jobs).filter(job => job.kind === "normals" && job.state !== "succeeded");
  const [state, setState] = useState("");
  const [failed, setFailed] = useState("");
  const chooser = useRef<HTMLInputElement>(null);
  const add = async (files: File[]) => {
    setFailed("");
    for (const file of files) {
      setState(`Adding ${file.name} …`);
      try {
        const name = file.name.replace(/\.json$/i, "").slice(0, 100);
        // As it was written: read and written again by a browser, numbers are spelt otherwise, and the file's hash is
        // another.
        const answer = await call(`/v1/normals?${new URLSearchParams({ name })}`, {
          method: "POST",
          headers: { "content-type": "application/json" },
          body: await textOf(file),
        });
        const added = (await answer.json()) as Normals;
        setState(`Added: ${added.name}.`);
      } catch (error) {
        setState("");
        setFailed(`${file.name}: ${words(error)}`);
      }
    }
    await loadNormals();
  };
  const over = useDrop(files => void add(files));
  return (
    <div class="list limits">
      <h1>Normal limits</h1>
      <section class={`drop${over ? " over" : ""}`} aria-label="Add normal limits">
        <div class="choose">
          <strong>{over ? "Let go to add" : "Drop a file of normal limits here"}</strong>
          <span class="quiet">
            The JSON file that <code>ventriform normals build</code> writes of a cohort of healthy people.
          </span>
        </div>
        <div class="buttons">
          <button type="button" class="main" onClick={() => chooser.current?.click()}>
            Choose a file
          </button>
          <input
            ref={chooser}
            class="hidden"
            type="file"
            accept=".json,application/json"
            tabIndex={-1}
            aria-label="File of normal limits"
            onChange={event => {
              void add([...(event.currentTarget.files ?? [])]);
              event.currentTarget.value = "";
            }}
          />
        </div>
      </section>
      <p role="status" class="quiet">
        {state}
      </p>
      {(failed || problem) && (
        <p class="error" role="alert">
          {failed || problem}
        </p>
      )}
      {building.map(job => (
        <JobLine key={job.id} job={job} />
      ))}
      {isLoaded && all.length === 0 && (
        <p class="quiet">
          None is stored. Without limits, uptake is shown in per cent of each scan’s own brightest wall, and there are
          no scores. The program has none: limits hold for one camera, protocol and tracer.
        </p>
      )}
      <ul class="limits-list">
        {all.map(limits => (
          <LimitsItem key={limits.id} limits={limits} />
        ))}
      </ul>
    </div>
  );
}

/** The text of a JSON file. */
async function textOf(file: File): Promise<string> {
  const text = await file.text();
  try {
    JSON.parse(text);
  } catch {
    throw new Error("This is not a JSON file. Choose the file that normals build has written.");
  }
  return text;
}

function LimitsItem({ limits }: { limits: Normals }) {
  const [problem, setProblem] = useState("");
  const { name, summary, links, created_at } = limits;
  return (
    <li class="limits-item">
      <div class="limits-head">
        <h2>{name}</h2>
        {summary.simulated && <Simulated />}
        <span class="end">
          <button
            type="button"
            class="plain"
            aria-label={`Download ${name}`}
            onClick={() => void save(links.limits, `${name}.json`).catch((error: unknown) => setProblem(words(error)))}>
            Download
          </button>
          <Confirm
            label={`Erase ${name}`}
            question="Erase these limits? What was scored by them stays."
            act={() => eraseNormals(limits.id)}>
            Erase
          </Confirm>
        </span>
      </div>
      <p class="quiet">
        {summary.people} · added {moment(created_at)} · built by version {summary.program_version}
        {summary.excluded > 0 && ` · ${summary.excluded} ${summary.excluded === 1 ? "case" : "cases"} left out`}
      </p>
      <div class="scrolled" tabIndex={0} role="region" aria-label={`Groups of ${name}`}>
        <table class="plain-table">
          <thead>
            <tr>
              <th scope="col">Group</th>
              <th scope="col">protocol</th>
              <th scope="col">tracer</th>
              <th scope="col">attenuation corrected</th>
              <th scope="col">people</th>
              <th scope="col">own wall below the others’ limits</th>
            </tr>
          </thead>
          <tbody>
            {summary.groups.map(group => (
              <tr key={`${group.sex} ${group.protocol} ${group.tracer} ${group.attenuation_corrected}`}>
                <th scope="row">{SEX[group.sex]}</th>
                <td>{group.protocol}</td>
                <td>{group.tracer}</td>
                <td>{group.attenuation_corrected ? "yes" : "no"}</td>
                <td>{group.cases}</td>
                <td>{number(group.mean_extent_percent, 1, "%")}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </li>
  );
}

/** Says of limits, wherever their figures are shown, that no patient is in them. */
export function Simulated() {
  return <strong class="simulated">simulated people, not patients</strong>;
}
