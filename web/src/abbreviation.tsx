// An abbreviation at the head of a figure, spelled out by the table of figures when pointed to.

import { useEffect } from "preact/hooks";
import { Watched, useWatched } from "./state";

/** What the abbreviations mean; read when one is shown first, for the list is small without the table. */
const meanings = new Watched<Map<string, string>>(new Map());
let isAsked = false;

function read(): void {
  if (isAsked) return;
  isAsked = true;
  import("./figures").then(
    ({ abbreviations }) => (meanings.value = abbreviations()),
    () => (isAsked = false),
  );
}

export function Abbreviation({ children }: { children: string }) {
  const known = useWatched(meanings);
  useEffect(read, []);
  const meaning = known.get(children);
  return meaning ? <abbr title={meaning}>{children}</abbr> : children;
}
