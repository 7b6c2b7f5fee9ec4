// Every figure of a result in words, from the table that reports, pages and DICOM objects have them from.

import { useState } from "preact/hooks";
import { type Figure, flatName, rowsOf } from "./figures";

type Schema = Parameters<typeof rowsOf>[0];

const PARTS: [string, Schema[]][] = [
  ["A fitted ventricle", ["SegmentationReport", "PolarSegment"]],
  ["The beat", ["BeatReport", "SegmentMotionReport"]],
  ["Rest and stress", ["ComparisonReport", "ComparedScan", "ComparedTerritory", "ComparedSegment"]],
  ["Over the years", ["SerialScan", "SerialPair", "SerialSegment"]],
  ["Beside normal limits", ["Perfusion", "SegmentScore", "TerritoryScore"]],
  ["A surface model", ["ModelReport"]],
];

/** The rows of a part that have `text` in name or meaning, each meaning once. */
function found(schemas: Schema[], text: string): Figure[] {
  const seen = new Set<string>();
  return schemas.flatMap(rowsOf).filter(row => {
    const key = `${row.label} ${row.about}`;
    if (seen.has(key) || !`${key} ${row.short ?? ""}`.toLowerCase().includes(text)) return false;
    seen.add(key);
    return true;
  });
}

export function Glossary() {
  const [text, setText] = useState("");
  const parts = PARTS.map(([name, schemas]) => [name, found(schemas, text.trim().toLowerCase())] as const);
  return (
    <div class="pad glossary">
      <h1>Glossary</h1>
      <p>What each figure is. An interval beside a figure holds the true one of nine in ten hearts.</p>
      <input
        type="search"
        aria-label="Search the glossary"
        placeholder="Search"
        value={text}
        onInput={event => setText(event.currentTarget.value)}
      />
      {parts.every(([, rows]) => rows.length === 0) && <p class="quiet">No figure has this in its name or meaning.</p>}
      {parts.map(
        ([name, rows]) =>
          rows.length > 0 && (
            <section key={name} aria-label={name}>
              <h2>{name}</h2>
              <dl>
                {rows.map(row => (
                  <div key={flatName(row) + row.about}>
                    <dt>
                      {row.label}
                      {row.short && !row.label.startsWith(row.short) && ` (${row.short})`}
                      {row.unit && <span class="quiet">, {row.unit}</span>}
                    </dt>
                    <dd>{row.about}</dd>
                  </div>
                ))}
              </dl>
            </section>
          ),
      )}
    </div>
  );
}
