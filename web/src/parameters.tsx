// Every parameter of a model or fit: names, ranges, defaults and help come from the service's own document.

import { useEffect, useState } from "preact/hooks";
import { type Kind, type ParameterValue, type Parameters, type Result, type Volume, get, page } from "./api";
import { fits, models, normals, templates, volumes } from "./library";
import { resultName, timeOf } from "./resultnames";
import { useWatched } from "./state";
import { cut, isLabelMap, nameOf } from "./words";

interface Schema {
  type?: string | string[];
  enum?: string[];
  default?: ParameterValue;
  minimum?: number;
  maximum?: number;
  pattern?: string;
  items?: { type: string };
  minItems?: number;
  maxItems?: number;
  description?: string;
  "x-title"?: string;
  "x-group"?: string;
  "x-unit"?: string;
}

export interface Spec {
  name: string;
  schema: Schema;
  help: string;
  /** The name that people read. */
  title: string;
  /** The heading that it stands under; empty for those that a form begins with. */
  group: string;
  unit: string;
}

interface Parameter {
  $ref?: string;
  in: string;
  name?: string;
  description?: string;
  schema?: Schema;
}

interface Document {
  paths: Record<string, { post?: { parameters: Parameter[] } }>;
  components: {
    parameters: Record<string, Parameter>;
    schemas: Record<string, { properties?: Record<string, Schema> }>;
  };
}

/** Of requests, and of the scans of a comparison, which the page has chosen before. */
const NOT_OF_THE_WORK = new Set([
  "external_id",
  "labels",
  "webhook",
  "webhook_events",
  "priority",
  "send",
  "to",
  "stress",
  "rest",
  "others",
]);

let specs: Promise<Record<Kind, Spec[]>> | undefined;

/** The parameters of every kind of work. */
export function parameterSpecs(): Promise<Record<Kind, Spec[]>> {
  specs ??= get<Document>("/openapi.json").then(
    document => ({
      model: read(document, "/v1/models"),
      segmentation: read(document, "/v1/segmentations"),
      beat: read(document, "/v1/beats"),
      comparison: read(document, "/v1/comparisons"),
      serial: ofSchema(document, "SerialParameters"),
    }),
    error => {
      specs = undefined;
      throw error;
    },
  );
  return specs;
}

function read(document: Document, path: string): Spec[] {
  return (document.paths[path]?.post?.parameters ?? []).flatMap(given => {
    const parameter = document.components.parameters[given.$ref?.split("/").pop() ?? ""] ?? given;
    const { name, schema } = parameter;
    if (parameter.in !== "query" || !name || !schema || NOT_OF_THE_WORK.has(name)) return [];
    return [specOf(name, schema, parameter.description)];
  });
}

/** Of work that is asked for by bodies only. */
function ofSchema(document: Document, name: string): Spec[] {
  return Object.entries(document.components.schemas[name]?.properties ?? {})
    .filter(([name]) => !NOT_OF_THE_WORK.has(name))
    .map(([name, schema]) => specOf(name, schema));
}

function specOf(name: string, schema: Schema, help?: string): Spec {
  return {
    name,
    schema,
    help: help ?? schema.description ?? "",
    title: schema["x-title"] ?? name,
    group: schema["x-group"] ?? "",
    unit: schema["x-unit"] ?? "",
  };
}

/** What chooses the group of the normal limits, once limits are chosen. */
const LIMITS_GROUP = "Group of the normal limits";

/** The parameters that a form begins with, those of the limits' group, and the others by their groups. */
function arranged(all: Spec[]): { main: Spec[]; limits: Spec[]; groups: [string, Spec[]][] } {
  const groups = new Map<string, Spec[]>();
  for (const spec of all) groups.set(spec.group, [...(groups.get(spec.group) ?? []), spec]);
  const take = (group: string) => {
    const found = groups.get(group) ?? [];
    groups.delete(group);
    return found;
  };
  return { main: take(""), limits: take(LIMITS_GROUP), groups: [...groups] };
}

/** What a person has written, by parameter; the text of a field, so that a slip can be corrected. */
export type Draft = Record<string, string>;

/** The values of a draft as the service wants them. Empty fields mean the default. */
export function valuesOf(draft: Draft, all: Spec[]): Record<string, ParameterValue> {
  const values: Record<string, ParameterValue> = {};
  for (const { name, schema } of all) {
    const text = draft[name]?.trim();
    if (!text) continue;
    if (schema.type === "array") values[name] = partsOf(text).map(numberOr);
    else if (schema.type === "integer" || schema.type === "number") values[name] = numberOr(text);
    else if (schema.type === "boolean") values[name] = text === "true";
    else values[name] = text;
  }
  return values;
}

/** The numbers of a list. With semicolons between them, or nothing but blanks, a comma in a number is a decimal comma. */
function partsOf(text: string): string[] {
  if (text.includes(";")) return text.split(/\s*;\s*/).filter(Boolean);
  const words = text.split(/\s+/);
  return words.length > 1 && words.every(word => !word.endsWith(",")) ? words : text.split(/[\s,]+/);
}

/** The number that a person has written, with a decimal point or comma; else the text, for the service to refuse. */
function numberOr(text: string): number | string {
  const number = Number(text.replace(/^([+-]?\d*),(\d+)$/, "$1.$2"));
  return Number.isFinite(number) ? number : text;
}

/** The draft that repeats the parameters of a job or result: only what differs from the defaults. */
export function draftOf(parameters: Parameters, all: Spec[]): Draft {
  const draft: Draft = {};
  for (const { name, schema } of all) {
    const value = parameters[name];
    if (value == null || JSON.stringify(value) === JSON.stringify(schema.default)) continue;
    draft[name] = Array.isArray(value) ? value.join(", ") : String(value);
  }
  return draft;
}

const PRESETS = "ventriform.presets";
type Presets = Record<string, Draft>;

function presetsOf(kind: Kind): Presets {
  try {
    return JSON.parse(localStorage.getItem(`${PRESETS}.${kind}`) ?? "{}") as Presets;
  } catch {
    return {};
  }
}

function keep(kind: Kind, presets: Presets): void {
  localStorage.setItem(`${PRESETS}.${kind}`, JSON.stringify(presets));
}

interface FormProps {
  kind: Kind;
  volume: Volume;
  draft: Draft;
  onChange: (draft: Draft) => void;
  problem: { field: string | null; text: string } | null;
}

export function ParameterForm({ kind, volume, draft, onChange, problem }: FormProps) {
  const [all, setAll] = useState<Spec[] | null>(null);
  const [presets, setPresets] = useState(() => presetsOf(kind));
  const [naming, setNaming] = useState("");
  useEffect(() => {
    void parameterSpecs().then(
      found => setAll(found[kind]),
      () => setAll([]),
    );
    setPresets(presetsOf(kind));
  }, [kind]);
  if (!all) return <p class="quiet">Reading the parameters …</p>;
  const { main, limits, groups } = arranged(all);
  const field = (spec: Spec) => (
    <Field
      key={spec.name}
      spec={spec}
      volume={volume}
      text={draft[spec.name] ?? ""}
      limits={draft["normals"] ?? ""}
      onText={text =>
        onChange({
          ...draft,
          ...(spec.name === "normals" ? Object.fromEntries(limits.map(({ name }) => [name, ""])) : {}),
          [spec.name]: text,
        })
      }
      error={problem?.field === spec.name ? problem.text : ""}
    />
  );
  const changed = (list: Spec[]) => list.filter(spec => draft[spec.name]).length;
  const inMore = groups.flatMap(([, list]) => list);
  // A field behind "more" is opened when something is wrong with it.
  const mustShow = inMore.some(spec => spec.name === problem?.field);
  return (
    <div class="parameters">
      <div class="fields">
        {main.filter(spec => spec.name !== "frame" || volume.frames > 1).map(field)}
        {draft["normals"] && limits.map(field)}
      </div>
      <details open={mustShow || undefined}>
        <summary>More{changed(inMore) ? <span class="count">{changed(inMore)} set</span> : null}</summary>
        {groups.map(([title, list]) => (
          <details class="group" key={title} open={list.some(spec => spec.name === problem?.field) || undefined}>
            <summary>
              {title}
              {changed(list) ? <span class="count">{changed(list)} set</span> : null}
            </summary>
            <div class="fields">{list.map(field)}</div>
          </details>
        ))}
        <div class="presets">
          <label>
            Preset
            <select
              value=""
              onChange={event => {
                const chosen = presets[event.currentTarget.value];
                if (chosen) onChange(chosen);
              }}>
              <option value="">choose …</option>
              {Object.keys(presets).map(name => (
                <option key={name}>{name}</option>
              ))}
            </select>
          </label>
          <label>
            Keep as
            <input value={naming} placeholder="a name" onInput={event => setNaming(event.currentTarget.value)} />
          </label>
          <button
            type="button"
            disabled={!naming.trim()}
            onClick={() => {
              const next = { ...presets, [naming.trim()]: draft };
              keep(kind, next);
              setPresets(next);
              setNaming("");
            }}>
            Keep
          </button>
          {Object.keys(presets).length > 0 && (
            <button
              type="button"
              class="plain"
              onClick={() => {
                keep(kind, {});
                setPresets({});
              }}>
              Forget all
            </button>
          )}
          <button type="button" class="plain" onClick={() => onChange({})}>
            All defaults
          </button>
        </div>
      </details>
      {problem &&
        !all.some(spec => spec.name === problem.field && (draft["normals"] || spec.group !== LIMITS_GROUP)) && (
          <p class="error" role="alert">
            {problem.text}
          </p>
        )}
    </div>
  );
}

interface FieldProps {
  spec: Spec;
  volume: Volume;
  text: string;
  /** The normal limits that are chosen; empty: none. */
  limits: string;
  onText: (text: string) => void;
  error: string;
}

function Field({ spec, volume, text, limits, onText, error }: FieldProps) {
  const { name, schema, help, title, unit } = spec;
  const id = `parameter-${name}`;
  const described = `${id}-help${error ? ` ${id}-error` : ""}`;
  const common = { id, "aria-describedby": described, "aria-invalid": error ? true : undefined };
  const standard = schema.default === undefined ? "automatic" : String(schema.default);
  const range = [
    schema.minimum !== undefined && schema.maximum !== undefined ? `${schema.minimum} to ${schema.maximum}` : "",
    schema.default !== undefined ? `default ${standard}` : "",
  ]
    .filter(Boolean)
    .join(", ");
  let input;
  if (name === "model") input = <ModelChoice common={common} text={text} onText={onText} volume={volume} />;
  else if (name === "expert") input = <ExpertChoice common={common} text={text} onText={onText} volume={volume} />;
  else if (name === "normals") input = <NormalsChoice common={common} text={text} onText={onText} />;
  else if (name === "tracer" || /(^|_)protocol$/.test(name))
    input = (
      <GroupChoice
        common={common}
        text={text}
        onText={onText}
        limits={limits}
        of={name === "tracer" ? "tracer" : "protocol"}
      />
    );
  else if (name === "reader") input = <ReaderChoice common={common} text={text} onText={onText} />;
  else if (schema.type === "boolean") {
    input = (
      <select
        {...common}
        value={text || standard}
        onChange={event => onText(event.currentTarget.value === standard ? "" : event.currentTarget.value)}>
        <option value="false">no</option>
        <option value="true">yes</option>
      </select>
    );
  } else if (schema.enum) {
    input = (
      <select
        {...common}
        value={text || (schema.default as string | undefined) || ""}
        onChange={event => onText(event.currentTarget.value === schema.default ? "" : event.currentTarget.value)}>
        {schema.default === undefined && <option value="">automatic</option>}
        {schema.enum.map(choice => (
          <option key={choice} value={choice}>
            {choice.replaceAll("_", " ")}
          </option>
        ))}
      </select>
    );
  } else {
    const numeric = schema.type === "number" || schema.type === "integer";
    const shown =
      schema.type === "array"
        ? schema.maxItems === 3
          ? "x, y, z"
          : schema.maxItems === 6
            ? "i0, j0, k0, i1, j1, k1"
            : ""
        : standard;
    input = (
      <input
        {...common}
        value={text}
        inputMode={numeric ? "decimal" : "text"}
        placeholder={shown}
        onInput={event => onText(event.currentTarget.value)}
        autocomplete="off"
        spellcheck={false}
      />
    );
  }
  return (
    <div class={error ? "field wrong" : "field"}>
      <label for={id}>
        {title}
        {unit && <span class="unit"> {unit}</span>}
      </label>
      {input}
      <details class="help">
        <summary aria-label={`About ${title}`}>?</summary>
        <span>
          {help}
          {range && ` (${range})`}
        </span>
      </details>
      <span id={`${id}-help`} class="hidden">
        {help} {range}
      </span>
      {error && (
        <p id={`${id}-error`} class="error" role="alert">
          {error}
        </p>
      )}
    </div>
  );
}

interface ChoiceProps {
  common: { id: string };
  text: string;
  onText: (text: string) => void;
  volume: Volume;
}

function ModelChoice({ common, text, onText, volume }: ChoiceProps) {
  const known = useWatched(models);
  const library = useWatched(templates) as (Result & { name?: string })[];
  const own = useWatched(fits).filter(fit => fit.volume === volume.id);
  return (
    <select
      {...common}
      value={text || "auto"}
      onChange={event => onText(event.currentTarget.value === "auto" ? "" : event.currentTarget.value)}>
      <option value="auto">auto: the best of the built-in hearts and the library</option>
      {library.length > 0 && (
        <optgroup label="Library">
          {library.map(item => (
            <option key={item.id} value={item.id}>
              {item.name ?? item.id}
            </option>
          ))}
        </optgroup>
      )}
      {known.length > 0 && (
        <optgroup label="Models">
          {known.map(item => (
            <option key={item.id} value={item.id}>
              {String(item.summary["vertices"])} points, {timeOf(item, known)}
            </option>
          ))}
        </optgroup>
      )}
      {own.length > 0 && (
        <optgroup label="Fits of this scan">
          {own.map(item => (
            <option key={item.id} value={item.id}>
              {resultName(item)} of {timeOf(item, own)}
            </option>
          ))}
        </optgroup>
      )}
      {text && ![...known, ...library, ...own].some(item => item.id === text) && <option value={text}>{text}</option>}
    </select>
  );
}

function ExpertChoice({ common, text, onText, volume }: ChoiceProps) {
  const masks = useWatched(volumes).filter(other => isLabelMap(other) && other.id !== volume.id);
  return (
    <select {...common} value={text} onChange={event => onText(event.currentTarget.value)}>
      <option value="">none</option>
      {masks.map(mask => (
        <option key={mask.id} value={mask.id}>
          {cut(nameOf(mask))}
        </option>
      ))}
      {text && !masks.some(mask => mask.id === text) && <option value={text}>{text}</option>}
    </select>
  );
}

/** Stored normal limits; it says of simulated ones that they are. */
function NormalsChoice({ common, text, onText }: Omit<ChoiceProps, "volume">) {
  const known = useWatched(normals);
  return (
    <select {...common} value={text} onChange={event => onText(event.currentTarget.value)}>
      <option value="">none: no z, no scores</option>
      {known.map(limits => (
        <option key={limits.id} value={limits.id}>
          {cut(limits.name)}
          {limits.summary.simulated ? " (simulated people, not patients)" : ""}
        </option>
      ))}
      {text && !known.some(limits => limits.id === text) && <option value={text}>{text}</option>}
    </select>
  );
}

/** Protocols or tracers of the groups of normal limits. */
function GroupChoice({
  common,
  text,
  onText,
  limits,
  of,
}: Omit<ChoiceProps, "volume"> & { limits: string; of: "protocol" | "tracer" }) {
  const groups = useWatched(normals).find(one => one.id === limits)?.summary.groups ?? [];
  const words = [...new Set(groups.map(group => group[of]))];
  return (
    <select {...common} value={text} onChange={event => onText(event.currentTarget.value)}>
      <option value="">automatic</option>
      {words.map(word => (
        <option key={word} value={word}>
          {word}
        </option>
      ))}
      {text && !words.includes(text) && <option value={text}>{text}</option>}
    </select>
  );
}

/** Readers' profiles: how a person draws the wall. */
export function ReaderChoice({ common, text, onText }: Omit<ChoiceProps, "volume">) {
  const [readers, setReaders] = useState<{ id: string; name: string }[]>([]);
  useEffect(() => {
    void page<{ id: string; name: string }>("readers", { limit: 100 }).then(
      found => setReaders(found.items),
      () => undefined,
    );
  }, []);
  return (
    <select {...common} value={text} onChange={event => onText(event.currentTarget.value)}>
      <option value="">none: the wall as fitted</option>
      {readers.map(reader => (
        <option key={reader.id} value={reader.id}>
          {reader.name}
        </option>
      ))}
      {text && !readers.some(reader => reader.id === text) && <option value={text}>{text}</option>}
    </select>
  );
}
