// Figures of reports by the rows that describe them: name, unit, digits, what they mean.

import { FIGURES } from "./generated/figures";
import { number } from "./words";

/** A figure of a report, as the service describes it. */
export interface Figure {
  /** The fields that lead to it, with `/` between them. */
  place: string;
  label: string;
  about: string;
  unit: string;
  digits: number;
  short?: string;
  section?: string;
  interval?: string;
  verdict?: string;
  needs?: string;
  unless?: string;
  flat_name?: string;
  signed?: boolean;
  headline?: boolean;
}

/** The rows of a report, or of a part of one, by the name of its schema. */
export const rowsOf = (schema: keyof typeof FIGURES): Figure[] => FIGURES[schema];

/** Whether the short name is made of initials. */
const isAbbreviated = ({ short }: Figure) => /^[A-Z]{2,}$/.test(short ?? "");

/** What a figure is, with its name where the head has only initials. */
export const meaningOf = (row: Figure): string => (isAbbreviated(row) ? `${row.label}. ${row.about}` : row.about);

/** What the initials mean by which figures are headed. */
export function abbreviations(): Map<string, string> {
  const rows = [...rowsOf("ComparisonReport"), ...rowsOf("BeatReport")].filter(isAbbreviated);
  return new Map(rows.map(row => [row.short!, meaningOf(row)]));
}

function at(report: unknown, place: string): unknown {
  return place.split("/").reduce<unknown>((part, name) => (part as Record<string, unknown> | null)?.[name], report);
}

const holds = (found: unknown) => found !== undefined && found !== null && found !== false;

/** The figure of `report`; nothing where it has none, or another one says more. */
export function figureOf(row: Figure, report: unknown): number | undefined {
  const value = at(report, row.place);
  const counts = (!row.needs || holds(at(report, row.needs))) && !(row.unless && holds(at(report, row.unless)));
  return counts && typeof value === "number" ? value : undefined;
}

/** The name of the figure in lists without nesting. */
export const flatName = (row: Figure): string => row.flat_name ?? row.place.replaceAll("/", "_");

/** `value` as the row has it written. */
export function written({ digits, signed, unit }: Figure, value: number | undefined, withUnit = true): string {
  const text = number(value, digits, withUnit ? unit : "");
  return signed && value !== undefined && Number(value.toFixed(digits)) > 0 ? `+${text}` : text;
}

/** The interval that holds the true figure of nine of ten hearts. */
export function intervalOf(row: Figure, report: unknown): string {
  const ends = row.interval ? at(report, row.interval) : null;
  return Array.isArray(ends) ? `${number(ends[0], row.digits)} to ${number(ends[1], row.digits)}` : "";
}

/** What may be said of the figure: yes, no or cannot tell. */
export function verdictOf(row: Figure, report: unknown): string {
  const verdict = row.verdict ? at(report, row.verdict) : null;
  return typeof verdict === "string" ? verdict.replaceAll("_", " ") : "";
}

/** How sure the figure of a part is, as the tooltip of its cell; what certainly changed stands out. */
function certaintyOf(row: Figure, part: unknown): { title?: string; class?: string } {
  const verdict = verdictOf(row, part);
  if (!verdict) return {};
  const interval = intervalOf(row, part);
  return {
    title: `${interval && `${interval}; `}changed: ${verdict}`,
    ...(verdict === "yes" ? { class: "changed" } : {}),
  };
}

const headOf = ({ label, short, unit }: Figure) => `${short ?? label}${unit && `, ${unit}`}`;

interface PartProps<Part> {
  caption: string;
  /** Head of the first column. */
  head: string;
  parts: Part[];
  nameOf: (part: Part) => string;
  rows: Figure[];
  /** Further columns: the head of each, and what stands in it. */
  more?: [string, (part: Part) => string][];
  /** The part that views mark, and what is done when the mouse points to one, or presses on it. */
  marks?: { isMarked: (part: Part) => boolean; onPoint: (part: Part | null) => void; onPress: (part: Part) => void };
}

/** Parts of the wall with those of their figures that one of them has. */
export function PartTable<Part>({ caption, head, parts, nameOf, rows, more = [], marks }: PartProps<Part>) {
  const columns = rows.filter(row => row.headline && parts.some(part => figureOf(row, part) !== undefined));
  return (
    <table class="segments">
      <caption class="hidden">{caption}</caption>
      <thead>
        <tr>
          <th scope="col">{head}</th>
          {columns.map(row => (
            <th key={row.place} scope="col" title={meaningOf(row)}>
              {headOf(row)}
            </th>
          ))}
          {more.map(([name]) => (
            <th key={name} scope="col">
              {name}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {parts.map(part => (
          <tr
            key={nameOf(part)}
            class={marks?.isMarked(part) ? "marked" : undefined}
            onMouseEnter={() => marks?.onPoint(part)}
            onMouseLeave={() => marks?.onPoint(null)}
            onClick={() => marks?.onPress(part)}>
            <th scope="row">{nameOf(part)}</th>
            {columns.map(row => (
              <td key={row.place} {...certaintyOf(row, part)}>
                {written(row, figureOf(row, part), false)}
              </td>
            ))}
            {more.map(([name, of]) => (
              <td key={name}>{of(part)}</td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

interface BesideProps {
  caption: string;
  /** What is shown beside each other, each with the head of its column; no heads for one alone. */
  of: [string, unknown][];
  rows: Figure[];
}

/** Figures of several things of one kind beside each other. */
export function BesideTable({ caption, of, rows }: BesideProps) {
  const filled = rows.filter(row => of.some(([, one]) => figureOf(row, one) !== undefined));
  return (
    <table>
      <caption class="hidden">{caption}</caption>
      <thead class={of.length > 1 ? "" : "hidden"}>
        <tr>
          <td />
          {of.map(([name]) => (
            <th key={name} scope="col">
              {name}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {filled.map(row => (
          <tr key={row.place}>
            <th scope="row" title={row.about}>
              {row.label}
            </th>
            {of.map(([name, one]) => (
              <td key={name}>{written(row, figureOf(row, one))}</td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
