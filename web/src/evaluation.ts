// The folder of an evaluation: its tables, figures and pictures.

export type Variant = "reference" | "retiled" | "flipped" | "fitted" | "optimised" | "auto";
export const VARIANTS: Variant[] = ["reference", "retiled", "flipped", "fitted", "optimised", "auto"];

interface Agreed {
  jaccard: number | null;
  contour_distance_voxels: number | null;
}

export interface FitOfCase {
  case: string;
  template: string;
  model: Variant;
  points: number;
  sample: string;
  state: string;
  reason: string;
  expert: Agreed;
  truth: Agreed;
}

/** `evaluation.json`, as far as the page reads it. */
export interface Evaluation {
  settings: Record<string, string>;
  templates: { case: string; source: string }[];
  problems: { case: string; problem: string }[];
  findings: { claim: string; verdict: string; figures: string; sample: string }[];
  figure3: {
    template: string;
    model: Variant;
    points: number;
    fitness: { raw: number; normalised: number };
    radius_ratio: { mean: number; least: number };
  }[];
  fits: FitOfCase[];
  pictures: { case: string; caption: string; file: string }[];
}

/** A line of `table1.csv`. */
export interface Line {
  gold: string;
  template: string;
  case: string;
  model: Variant;
  points: number;
  jaccard: number | null;
  contour: number | null;
  sample: string;
}

export interface Opened {
  name: string;
  evaluation: Evaluation;
  table: Line[];
  /** The files by their path in the folder. */
  files: Map<string, File>;
}

/** Reads the results among files, by their path. */
export async function openFolder(all: Map<string, File>): Promise<Opened> {
  const found = [...all.keys()]
    .filter(path => /(^|\/)evaluation\.json$/.test(path))
    .sort((a, b) => a.length - b.length)[0];
  if (found === undefined)
    throw new Error("There is no evaluation.json in it. Choose the folder that ventriform evaluate --output wrote.");
  const folder = found.slice(0, -"evaluation.json".length);
  const files = new Map(
    [...all].flatMap(([path, file]): [string, File][] =>
      path.startsWith(folder) ? [[path.slice(folder.length), file]] : [],
    ),
  );
  let evaluation: Evaluation;
  try {
    evaluation = {
      problems: [],
      findings: [],
      figure3: [],
      templates: [],
      settings: {},
      pictures: [],
      ...(JSON.parse(await files.get("evaluation.json")!.text()) as Partial<Evaluation>),
    } as Evaluation;
  } catch {
    throw new Error("evaluation.json cannot be read: it is not what the program writes.");
  }
  if (!Array.isArray(evaluation.fits))
    throw new Error("evaluation.json holds no fits: it is not what the program writes.");
  const csv = await files.get("table1.csv")?.text();
  return { name: folder.split("/").filter(Boolean).pop() ?? "", evaluation, table: csv ? table1(csv) : [], files };
}

function table1(text: string): Line[] {
  const [head, ...rows] = records(text);
  const field = (row: string[], name: string) => row[head!.indexOf(name)] ?? "";
  const figure = (word: string) => (word === "" ? null : Number(word));
  return rows.map(row => ({
    gold: field(row, "gold"),
    template: field(row, "template"),
    case: field(row, "case"),
    model: field(row, "model") as Variant,
    points: Number(field(row, "points")),
    jaccard: figure(field(row, "jaccard")),
    contour: figure(field(row, "contour_distance_voxels")),
    sample: field(row, "sample"),
  }));
}

/** The records of a CSV file (RFC 4180). */
export function records(text: string): string[][] {
  const out: string[][] = [];
  let row: string[] = [];
  for (const [, quoted, plain, end] of text.matchAll(/(?:"((?:[^"]|"")*)"|([^",\r\n]*))(,|\r?\n|$)/g)) {
    row.push(quoted === undefined ? (plain ?? "") : quoted.replaceAll('""', '"'));
    if (end === ",") continue;
    if (row.length > 1 || row[0] !== "") out.push(row);
    row = [];
    if (end === "") break;
  }
  return out;
}
