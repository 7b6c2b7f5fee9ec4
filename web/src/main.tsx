// The page: its head, what is asked of the person everywhere, and the view that the address names.

import { type ComponentType, render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { key, reachable, signIn, wanted } from "./api";
import { at } from "./base";
import { refresh } from "./library";
import { route } from "./route";
import { useWatched } from "./state";
import { WorkList } from "./worklist";

/** The same page serves the documentation of the API. */
const DOCS = location.pathname.startsWith(at("/docs"));

function Page() {
  const { view, volume, result } = useWatched(route);
  const asked = useWatched(wanted);
  const answers = useWatched(reachable);
  const signedIn = useWatched(key);
  return (
    <>
      <a
        class="skip"
        href="#main"
        onClick={event => {
          event.preventDefault();
          document.getElementById("main")?.focus();
        }}>
        Skip to the content
      </a>
      <header class="top">
        <a class="brand" href={at("/#/")}>
          <svg viewBox="0 0 32 32" aria-hidden="true">
            <path d="M8 6c-1.500 11 2 20 8 20s9.500-9 8-20" />
            <path class="inner" d="M12.500 7c-.7 6 .8 11 3.500 11s4.200-5 3.500-11" />
          </svg>
          ventriform
        </a>
        <nav aria-label="Pages">
          <a href={at("/#/")} aria-current={view === "list" && !DOCS ? "page" : undefined}>
            Scans
          </a>
          <a href={at("/#/limits")} aria-current={view === "limits" && !DOCS ? "page" : undefined}>
            Normal limits
          </a>
          <a href={at("/#/glossary")} aria-current={view === "glossary" && !DOCS ? "page" : undefined}>
            Glossary
          </a>
          <a href={at("/docs")} aria-current={DOCS ? "page" : undefined}>
            API
          </a>
        </nav>
        <span class="research">Research software, not a medical device</span>
        {signedIn && (
          <button type="button" class="plain" onClick={() => signIn("")}>
            Forget the key
          </button>
        )}
      </header>
      {!answers && (
        <p class="banner" role="alert">
          The service does not answer. This page tries again by itself; what you chose is kept.
          <button type="button" onClick={() => void refresh()}>
            Try now
          </button>
        </p>
      )}
      {asked && <SignIn reason={asked} />}
      <main id="main" tabIndex={-1}>
        {DOCS ? (
          <Chunk load={docs} name="documentation" />
        ) : volume ? (
          <Chunk key={volume} load={viewer} name="viewer" volume={volume} />
        ) : view === "comparison" && result ? (
          <Chunk key="comparison" load={comparison} name="comparison" volume={result} />
        ) : view === "serial" && result ? (
          <Chunk key="serial" load={serial} name="serial comparison" volume={result} />
        ) : view === "limits" ? (
          <Chunk key="limits" load={limits} name="normal limits" />
        ) : view === "evaluation" ? (
          <Chunk key="evaluation" load={evaluation} name="evaluation" />
        ) : view === "glossary" ? (
          <Chunk key="glossary" load={glossary} name="glossary" />
        ) : (
          <>
            <WorkList />
            <p class="pad quiet">
              For researchers: <a href={at("/#/evaluation")}>Evaluation of a cohort</a>
            </p>
          </>
        )}
      </main>
    </>
  );
}

/** Asks for a key without leaving the view: requests that were refused go on with the new one. */
function SignIn({ reason }: { reason: string }) {
  const [text, setText] = useState("");
  return (
    <form
      class="banner sign-in"
      aria-label="Sign in"
      onSubmit={event => {
        event.preventDefault();
        if (text.trim()) signIn(text);
      }}>
      <label>
        {reason} API key
        <input
          type="password"
          value={text}
          autocomplete="off"
          autofocus
          onInput={event => setText(event.currentTarget.value)}
        />
      </label>
      <button class="main">Use this key</button>
      <span class="quiet">Kept in this tab until it is closed.</span>
    </form>
  );
}

const viewer = () => import("./viewer/viewer").then(module => module.Viewer as ComponentType<{ volume?: string }>);
const comparison = () =>
  import("./viewer/comparisonview").then(
    ({ ComparisonView }) =>
      (({ volume }) => <ComparisonView key={volume} id={volume ?? ""} />) as ComponentType<{ volume?: string }>,
  );
const serial = () =>
  import("./viewer/serialview").then(
    ({ SerialView }) =>
      (({ volume }) => <SerialView key={volume} id={volume ?? ""} />) as ComponentType<{ volume?: string }>,
  );
const limits = () => import("./limits").then(module => module.LimitsView as ComponentType<{ volume?: string }>);
const evaluation = () =>
  import("./evaluationview").then(module => module.EvaluationView as ComponentType<{ volume?: string }>);
const glossary = () => import("./glossary").then(module => module.Glossary as ComponentType<{ volume?: string }>);
const docs = () => import("./docs").then(module => module.Docs as ComponentType<{ volume?: string }>);

/** Viewer and documentation are fetched when they are opened first. */
function Chunk({
  load,
  name,
  ...rest
}: {
  load: () => Promise<ComponentType<{ volume?: string }>>;
  name: string;
  volume?: string;
}) {
  const [View, setView] = useState<ComponentType<{ volume?: string }> | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    load().then(
      view => setView(() => view),
      () => setFailed(true),
    );
  }, []);
  if (failed) return <p class="error pad">The {name} could not be loaded. Reload the page.</p>;
  return View ? <View {...rest} /> : <p class="quiet pad">Loading the {name} …</p>;
}

const root = document.getElementById("app");
if (root) render(<Page />, root);
if (!DOCS) void refresh();
