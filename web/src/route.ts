// The address of the view: #/ is the list, #/evaluation the results of an evaluation, #/limits the normal limits,
// #/glossary what each figure is,
// #/scan/VOLUME/RESULT/OTHER a scan, what was made of it and what it is shown beside, #/comparison/ID the comparison of
// rest and stress with that id, or the job that makes it, #/serial/ID a serial comparison likewise.

import { Watched } from "./state";
import { isComparison } from "./words";

export interface Route {
  view: "list" | "scan" | "evaluation" | "limits" | "glossary" | "comparison" | "serial";
  volume: string | null;
  result: string | null;
  other: string | null;
}

function read(): Route {
  const [, view, volume, result, other] = location.hash.split("/");
  if (view === "scan" && volume) return { view, volume, result: result || null, other: other || null };
  if ((view === "comparison" || view === "serial") && volume)
    return { view, volume: null, result: volume, other: null };
  const named = view === "evaluation" || view === "limits" || view === "glossary" ? view : "list";
  return { view: named, volume: null, result: null, other: null };
}

export const route = new Watched<Route>(read());
addEventListener("hashchange", () => (route.value = read()));

export function open(volume: string, result?: string | null, other?: string | null): void {
  location.hash = ["#", "scan", volume, result ?? "", other ?? ""].join("/").replace(/\/+$/, "");
}

/** Shows a comparison, or the job that makes it. */
export function openComparison(id: string): void {
  location.hash = `#/comparison/${id}`;
}

/** Shows a serial comparison, or the job that makes it. */
export function openSerial(id: string): void {
  location.hash = `#/serial/${id}`;
}

/** Shows a result of a scan: a comparison in its own view. */
export function openResult(volume: string, id: string): void {
  if (isComparison(id)) openComparison(id);
  else open(volume, id);
}

/** Whether this scan is what the address names: the views follow a change of it a moment later. */
export function isAt(volume: string): boolean {
  return read().volume === volume;
}

export function home(): void {
  location.hash = "#/";
}
