// The documentation of the API, read from the service's own document: every operation with its parameters, bodies,
// answers and a command; operations that only read can be sent from here.

import { useEffect, useMemo, useState } from "preact/hooks";
import { at } from "./base";
import { authorization, get, words } from "./api";

interface Schema {
  $ref?: string;
  type?: string | string[];
  format?: string;
  enum?: unknown[];
  const?: unknown;
  items?: Schema;
  properties?: Record<string, Schema>;
  required?: string[];
  additionalProperties?: Schema | boolean;
  oneOf?: Schema[];
  anyOf?: Schema[];
  allOf?: Schema[];
  description?: string;
  default?: unknown;
  minimum?: number;
  maximum?: number;
  minLength?: number;
  maxLength?: number;
  pattern?: string;
}

interface Parameter {
  $ref?: string;
  name: string;
  in: string;
  required?: boolean;
  description?: string;
  schema?: Schema;
}

interface Example {
  $ref?: string;
  summary?: string;
  value?: unknown;
}

interface Media {
  schema?: Schema;
  example?: unknown;
  examples?: Record<string, Example>;
}

/** A file of a result: what it is, and when the result has it. */
interface FileFacts {
  description: string;
  exists: string;
  mediaType: string;
  schema: Schema;
}

interface Answer {
  $ref?: string;
  description?: string;
  content?: Record<string, Media>;
}

interface Operation {
  tags?: string[];
  summary?: string;
  description?: string;
  operationId?: string;
  parameters?: Parameter[];
  requestBody?: { description?: string; required?: boolean; content: Record<string, Media> };
  responses: Record<string, Answer>;
  security?: unknown[];
  "x-files"?: Record<string, FileFacts>;
}

interface Document {
  info: { title: string; version: string; description?: string };
  tags?: { name: string; description?: string }[];
  paths: Record<string, Record<string, Operation>>;
  components: {
    schemas: Record<string, Schema>;
    parameters?: Record<string, Parameter>;
    responses?: Record<string, Answer>;
    examples?: Record<string, Example>;
  };
}

interface Entry {
  id: string;
  method: string;
  path: string;
  operation: Operation;
}

const METHODS = ["get", "post", "put", "patch", "delete"];

export function Docs() {
  const [document_, setDocument] = useState<Document | null>(null);
  const [problem, setProblem] = useState("");
  const [search, setSearch] = useState("");
  useEffect(() => {
    get<Document>("/openapi.json").then(setDocument, error => setProblem(words(error)));
  }, []);
  const groups = useMemo(() => (document_ ? grouped(document_) : []), [document_]);
  if (!document_) return <p class={problem ? "error pad" : "quiet pad"}>{problem || "Reading the document …"}</p>;
  const text = search.trim().toLowerCase();
  const shown = groups
    .map(({ tag, about, entries }) => ({
      tag,
      about,
      entries: entries.filter(entry => matches(entry, text, document_)),
    }))
    .filter(group => group.entries.length);
  return (
    <div class="docs">
      <nav aria-label="Parts of the API">
        <input
          type="search"
          placeholder="Search the API"
          aria-label="Search the API"
          value={search}
          onInput={event => setSearch(event.currentTarget.value)}
        />
        <ul>
          {shown.map(({ tag, entries }) => (
            <li key={tag}>
              <a href={`#api-${tag}`}>{tag}</a> <span class="quiet">{entries.length}</span>
            </li>
          ))}
        </ul>
        <p>
          <a href={at("/openapi.json")}>openapi.json</a>
        </p>
      </nav>
      <div class="text">
        <h1>
          {document_.info.title} <span class="quiet">{document_.info.version}</span>
        </h1>
        <Prose text={document_.info.description ?? ""} />
        {shown.map(({ tag, about, entries }) => (
          <section key={tag} aria-labelledby={`api-${tag}`}>
            <h2 id={`api-${tag}`} tabIndex={-1}>
              {tag}
            </h2>
            {about && <Prose text={about} />}
            {entries.map(entry => (
              <Details key={entry.id} entry={entry} all={document_} />
            ))}
          </section>
        ))}
        {shown.length === 0 && <p class="quiet">Nothing matches.</p>}
      </div>
    </div>
  );
}

function grouped(all: Document) {
  const entries = Object.entries(all.paths).flatMap(([path, item]) =>
    METHODS.flatMap((method): Entry[] =>
      item[method] ? [{ id: `${method} ${path}`, method, path, operation: item[method] }] : [],
    ),
  );
  const tags = new Map((all.tags ?? []).map(tag => [tag.name, tag.description ?? ""]));
  for (const entry of entries)
    for (const tag of entry.operation.tags ?? ["other"]) if (!tags.has(tag)) tags.set(tag, "");
  return [...tags]
    .map(([tag, about]) => ({
      tag,
      about,
      entries: entries.filter(entry => (entry.operation.tags ?? ["other"]).includes(tag)),
    }))
    .filter(group => group.entries.length);
}

function matches({ id, operation }: Entry, text: string, all: Document): boolean {
  const names = [
    ...parametersOf(operation, all).map(parameter => parameter.name),
    ...Object.keys(operation["x-files"] ?? {}),
  ];
  return [id, operation.summary ?? "", operation.description ?? "", ...names].some(part =>
    part.toLowerCase().includes(text),
  );
}

function parametersOf(operation: Operation, all: Document): Parameter[] {
  return (operation.parameters ?? []).map(parameter =>
    parameter.$ref ? (all.components.parameters?.[last(parameter.$ref)] ?? parameter) : parameter,
  );
}

/** An answer; what stands beside a reference says more than what it refers to. */
function answerOf(given: Answer, all: Document): Answer {
  return given.$ref ? { ...all.components.responses?.[last(given.$ref)], ...given } : given;
}

/** Paragraphs with code between backticks. */
function Prose({ text }: { text: string }) {
  if (!text) return null;
  return (
    <>
      {text.split(/\n\s*\n/).map((part, n) => (
        <p key={n}>
          <Inline text={part} />
        </p>
      ))}
    </>
  );
}

function Inline({ text }: { text: string }) {
  return (
    <>
      {text
        .split(/(`[^`]+`)/)
        .map((part, n) => (part.startsWith("`") && part.length > 1 ? <code key={n}>{part.slice(1, -1)}</code> : part))}
    </>
  );
}

function Details({ entry: { method, path, operation }, all }: { entry: Entry; all: Document }) {
  const [opened, setOpened] = useState(false);
  return (
    <details class="operation" onToggle={event => setOpened(event.currentTarget.open)}>
      <summary>
        <span class={`method ${method}`}>{method.toUpperCase()}</span> <code>{path}</code>{" "}
        <span class="summary">{operation.summary}</span>
      </summary>
      {opened && <Body method={method} path={path} operation={operation} all={all} />}
    </details>
  );
}

function Body({ method, path, operation, all }: { method: string; path: string; operation: Operation; all: Document }) {
  const parameters = parametersOf(operation, all);
  const files = Object.entries(operation["x-files"] ?? {});
  const [values, setValues] = useState<Record<string, string>>({});
  const body = operation.requestBody;
  return (
    <div class="body">
      <Prose text={operation.description ?? ""} />
      {operation.security?.length === 0 && <p class="quiet">Needs no key.</p>}
      {parameters.length > 0 && (
        <table>
          <caption>Parameters</caption>
          <thead>
            <tr>
              <th scope="col">Name</th>
              <th scope="col">In</th>
              <th scope="col">Value</th>
              <th scope="col">Meaning</th>
            </tr>
          </thead>
          <tbody>
            {parameters.map(({ name, in: place, required, description, schema }) => (
              <tr key={place + name}>
                <th scope="row">
                  <code>{name}</code>
                  {required && <span class="quiet"> required</span>}
                </th>
                <td>{place}</td>
                <td>
                  {method === "get" && place !== "header" ? (
                    <input
                      aria-label={`${name}`}
                      value={values[name] ?? ""}
                      placeholder={schema ? typeOf(schema, all) : ""}
                      onInput={event => setValues({ ...values, [name]: event.currentTarget.value })}
                    />
                  ) : (
                    schema && typeOf(schema, all)
                  )}
                </td>
                <td>
                  <Inline text={description ?? schema?.description ?? ""} />{" "}
                  {schema && <span class="quiet">{limits(schema)}</span>}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {files.length > 0 && (
        <table>
          <caption>Files</caption>
          <thead>
            <tr>
              <th scope="col">Name</th>
              <th scope="col">Type</th>
              <th scope="col">What it is</th>
              <th scope="col">Exists</th>
            </tr>
          </thead>
          <tbody>
            {files.map(([name, { mediaType, schema, description, exists }]) => (
              <tr key={name}>
                <th scope="row">
                  <code>{name}</code>
                </th>
                <td>
                  <code>{mediaType}</code>
                  {schema.$ref && ` ${last(schema.$ref)}`}
                </td>
                <td>
                  <Inline text={description} />
                </td>
                <td>
                  <Inline text={exists} />
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {body && (
        <>
          <h3>Body</h3>
          <Prose text={body.description ?? ""} />
          {Object.entries(body.content).map(([type, media]) => (
            <MediaShown key={type} type={type} media={media} all={all} />
          ))}
        </>
      )}
      <h3>Answers</h3>
      <dl class="answers">
        {Object.entries(operation.responses).map(([status, given]) => {
          const answer = answerOf(given, all);
          return (
            <div key={status}>
              <dt>
                <b>{status}</b> <Inline text={answer.description ?? ""} />
              </dt>
              <dd>
                {Object.entries(answer.content ?? {}).map(([type, media]) => (
                  <MediaShown key={type} type={type} media={media} all={all} />
                ))}
              </dd>
            </div>
          );
        })}
      </dl>
      <Try
        method={method}
        path={path}
        parameters={parameters}
        values={values}
        body={body ? Object.keys(body.content) : []}
      />
    </div>
  );
}

function Try({
  method,
  path,
  parameters,
  values,
  body,
}: {
  method: string;
  path: string;
  parameters: Parameter[];
  values: Record<string, string>;
  body: string[];
}) {
  const [answer, setAnswer] = useState("");
  const filled = path.replace(/\{(\w+)\}/g, (whole, name: string) =>
    values[name] ? encodeURIComponent(values[name]) : whole,
  );
  const query = new URLSearchParams(
    parameters.filter(one => one.in === "query" && values[one.name]).map(one => [one.name, values[one.name]!]),
  ).toString();
  const address = filled + (query ? `?${query}` : "");
  const data = body.includes("application/json")
    ? " -H 'content-type: application/json' -d '{…}'"
    : body.length
      ? " --data-binary @FILE"
      : "";
  const verb = method === "get" || (method === "post" && data) ? "" : ` -X ${method.toUpperCase()}`;
  const send = async () => {
    setAnswer("…");
    try {
      const got = await fetch(at(address), { headers: authorization() });
      const type = got.headers.get("content-type") ?? "";
      const text = /json|text/.test(type)
        ? await got.text()
        : `${(await got.arrayBuffer()).byteLength} bytes of ${type}`;
      setAnswer(`${got.status}\n${pretty(text).slice(0, 20_000)}`);
    } catch (error) {
      setAnswer(words(error));
    }
  };
  return (
    <>
      <h3>Command</h3>
      <pre tabIndex={0} aria-label="Command">{`curl -fsS${verb}${data} '${location.origin}${at(address)}'`}</pre>
      {method === "get" && !/events$/.test(path) && (
        <button type="button" disabled={/\{/.test(address)} onClick={() => void send()}>
          Send
        </button>
      )}
      {answer && (
        <pre tabIndex={0} aria-label="Answer">
          {answer}
        </pre>
      )}
    </>
  );
}

function pretty(text: string): string {
  try {
    return JSON.stringify(JSON.parse(text), null, 2);
  } catch {
    return text;
  }
}

function MediaShown({ type, media, all }: { type: string; media: Media; all: Document }) {
  const shared = Object.values(media.examples ?? {}).map(one =>
    one.$ref ? (all.components.examples?.[last(one.$ref)] ?? one) : one,
  );
  const examples = media.example !== undefined ? [{ value: media.example }, ...shared] : shared;
  const binary = media.schema?.format === "binary" || (!media.schema && !examples.length);
  if (binary && !examples.length)
    return (
      <p>
        <code>{type}</code>
      </p>
    );
  return (
    <details>
      <summary>
        <code>{type}</code> {media.schema && typeOf(media.schema, all)}
      </summary>
      {media.schema && <SchemaShown schema={media.schema} all={all} depth={0} />}
      {examples.slice(0, 2).map((example, n) => (
        <pre key={n} tabIndex={0} aria-label={`Example of ${type}`}>
          {typeof example.value === "string" ? example.value : JSON.stringify(example.value, null, 2)}
        </pre>
      ))}
    </details>
  );
}

function SchemaShown({ schema, all, depth }: { schema: Schema; all: Document; depth: number }) {
  const target = resolve(schema, all);
  const inner = target.items ? resolve(target.items, all) : target;
  const properties = {
    ...inner.properties,
    ...Object.assign({}, ...(inner.allOf ?? []).map(part => resolve(part, all).properties ?? {})),
  } as Record<string, Schema>;
  if (Object.keys(properties).length === 0 || depth > 4) return null;
  return (
    <ul class="schema">
      {Object.entries(properties).map(([name, property]) => (
        <Property
          key={name}
          name={name}
          schema={property}
          required={inner.required?.includes(name) ?? false}
          all={all}
          depth={depth}
        />
      ))}
    </ul>
  );
}

function Property({
  name,
  schema,
  required,
  all,
  depth,
}: {
  name: string;
  schema: Schema;
  required: boolean;
  all: Document;
  depth: number;
}) {
  const [opened, setOpened] = useState(false);
  const target = resolve(schema, all);
  const line = (
    <>
      <code>{name}</code>{" "}
      <span class="quiet">
        {typeOf(schema, all)}
        {required ? "" : ", optional"} {limits(target)}
      </span>{" "}
      <Inline text={schema.description ?? target.description ?? ""} />
    </>
  );
  const nested = target.properties ?? (target.items && resolve(target.items, all).properties);
  if (!nested) return <li>{line}</li>;
  return (
    <li>
      <details onToggle={event => event.target === event.currentTarget && setOpened(event.currentTarget.open)}>
        <summary>{line}</summary>
        {opened && <SchemaShown schema={target} all={all} depth={depth + 1} />}
      </details>
    </li>
  );
}

function last(reference: string): string {
  return reference.split("/").pop() ?? "";
}

function resolve(schema: Schema, all: Document): Schema {
  if (schema.$ref) return all.components.schemas[last(schema.$ref)] ?? schema;
  const some = (schema.oneOf ?? schema.anyOf)?.filter(part => part.type !== "null");
  return some?.length === 1 ? resolve(some[0]!, all) : schema;
}

function typeOf(schema: Schema, all: Document): string {
  if (schema.$ref) {
    const target = resolve(schema, all);
    return target.enum ? target.enum.join(" | ") : last(schema.$ref);
  }
  if (schema.enum) return schema.enum.join(" | ");
  const some = schema.oneOf ?? schema.anyOf;
  if (some) return some.map(part => typeOf(part, all)).join(" | ");
  if (schema.allOf) return schema.allOf.map(part => typeOf(part, all)).join(" & ");
  if (schema.items) return `list of ${typeOf(schema.items, all)}`;
  return [schema.type ?? "any"].flat().join(" | ");
}

function limits({ minimum, maximum, minLength, maxLength, default: standard }: Schema): string {
  const parts = [
    minimum !== undefined && maximum !== undefined
      ? `${minimum} to ${maximum}`
      : minimum !== undefined
        ? `at least ${minimum}`
        : maximum !== undefined
          ? `at most ${maximum}`
          : "",
    maxLength !== undefined ? `${minLength ?? 0} to ${maxLength} characters` : "",
    standard !== undefined && standard !== null ? `default ${JSON.stringify(standard)}` : "",
  ];
  return parts.filter(Boolean).join(", ");
}
