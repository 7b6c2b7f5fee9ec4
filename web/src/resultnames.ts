// How results are called, so that those of one scan are told apart.

import type { Result } from "./api";
import { CORRECTIONS } from "./corrections";
import { models, templates } from "./library";
import { cut, exactMoment, isBeat, isComparison, isFit, isSerial, moment } from "./words";

/** What the model of a fit is called: a template by its name, where the page knows it. */
function modelName(id: string): string {
  const template = (templates.value as (Result & { name?: string })[]).find(one => one.id === id);
  if (template?.name) return cut(template.name);
  const model = models.value.find(one => one.id === id);
  if (model) return `a model of ${String(model.summary["vertices"])} points`;
  return isFit(id) || isBeat(id) ? "an earlier fit" : `${id.slice(0, 10)}…`;
}

/** What distinguishes a result from others of the same scan. */
export function resultName(result: Result): string {
  if (isFit(result.id) || isBeat(result.id)) {
    const changed = [...CORRECTIONS, "roll"].filter(
      name => result.parameters[name] != null && result.parameters[name] !== 0,
    );
    const model = result.parameters["model"];
    const by = typeof model === "string" && model !== "auto" ? ` of ${modelName(model)}` : "";
    const what = isBeat(result.id) ? `beat of ${result.summary.gates} gates` : "fit";
    return `${changed.length ? "Corrected " : ""}${what}${by}`.replace(/^./, letter => letter.toUpperCase());
  }
  if (isComparison(result.id)) return "Rest and stress";
  if (isSerial(result.id)) return `Over the years, ${String(result.summary.scans)} scans`;
  return `Model, ${String(result.summary["vertices"])} points`;
}

const namesakes = (result: Result, among: Result[]) =>
  among.filter(other => other.id !== result.id && resultName(other) === resultName(result));

/** When a result was made: to the second if another of its name was made in the same minute. */
export function timeOf(result: Result, among: Result[]): string {
  const minute = moment(result.created_at);
  const same = namesakes(result, among).some(other => moment(other.created_at) === minute);
  return same ? exactMoment(result.created_at) : minute;
}

/** The name of a result among others of its scan: with its time if another has the same name. */
export function nameAmong(result: Result, among: Result[]): string {
  const name = resultName(result);
  return namesakes(result, among).length > 0 ? `${name} of ${timeOf(result, among)}` : name;
}
