// A button that asks once before it does what cannot be undone.

import { useState } from "preact/hooks";
import { words } from "./api";

interface Props {
  children: string;
  question: string;
  act: () => Promise<void>;
  label?: string;
}

export function Confirm({ children, question, act, label }: Props) {
  const [asked, setAsked] = useState(false);
  const [problem, setProblem] = useState("");
  if (!asked)
    return (
      <button type="button" class="plain" aria-label={label} onClick={() => setAsked(true)}>
        {children}
      </button>
    );
  return (
    <span class="ask" role="alertdialog" aria-label={question}>
      {problem || question}{" "}
      <button
        type="button"
        class="danger"
        autofocus
        onClick={() =>
          act().then(
            () => setAsked(false),
            error => setProblem(words(error)),
          )
        }>
        {children}
      </button>
      <button
        type="button"
        class="plain"
        onClick={() => {
          setAsked(false);
          setProblem("");
        }}>
        Keep
      </button>
    </span>
  );
}
