// Simulated scans that the service has ready, for those who have none at hand.

import { useState } from "preact/hooks";
import { call, words } from "./api";
import { useWatched } from "./state";
import { add, isUnderWay, uploads } from "./upload";

/** What is offered, and the files of the service that it is made of. */
const EXAMPLES: [string, string[]][] = [
  ["A scan", ["scan"]],
  ["A gated scan", ["gated"]],
  ["Stress and rest", ["stress", "rest"]],
];

async function fileOf(name: string): Promise<File> {
  const answer = await call(`/examples/${name}.dcm`);
  return new File([await answer.blob()], `simulated-${name}.dcm`);
}

/** Buttons that send an example as if its files had been dropped. */
export function Examples() {
  const [isFetched, setFetched] = useState(false);
  const [problem, setProblem] = useState("");
  const isSent = useWatched(uploads).some(upload => upload.isExample && isUnderWay(upload));
  const send = (names: string[]) => {
    setProblem("");
    setFetched(true);
    Promise.all(names.map(fileOf))
      .then(files => add(files, true))
      .catch((error: unknown) => setProblem(words(error)))
      .finally(() => setFetched(false));
  };
  return (
    <>
      <span class="buttons">
        {EXAMPLES.map(([name, files]) => (
          <button key={name} type="button" disabled={isFetched || isSent} onClick={() => send(files)}>
            {name}
          </button>
        ))}
      </span>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}
