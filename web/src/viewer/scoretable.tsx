// Scores of the 17 segments: a reader's beside the automatic ones, with sums and differences.

import { useRef } from "preact/hooks";
import { Abbreviation } from "../abbreviation";
import { type ReadingDraft, type Scored, type ScoredScan, exceeds, sumOf } from "../reading";

const HEADS: Record<ScoredScan, string> = { stress: "Stress", rest: "Rest", scan: "Score" };
const SUMS: Record<ScoredScan, string> = { stress: "SSS", rest: "SRS", scan: "Sum" };

/** Where an arrow key leads: rows, then columns. */
const WAYS: Record<string, [number, number]> = {
  ArrowUp: [-1, 0],
  ArrowDown: [1, 0],
  Enter: [1, 0],
  ArrowLeft: [0, -1],
  ArrowRight: [0, 1],
};

interface Props {
  scans: Scored[];
  segments: string[];
  scores: ReadingDraft["scores"];
  onScore: (scan: ScoredScan, segment: number, score: number) => void;
}

export function ScoreTable({ scans, segments, scores, onScore }: Props) {
  const table = useRef<HTMLTableElement>(null);
  const go = (row: number, column: number) => {
    const cell = table.current?.querySelector<HTMLInputElement>(`[data-cell="${row} ${column}"]`);
    cell?.focus();
    cell?.select();
  };
  const both = scans.length > 1;
  const sums = [...scans.map(({ scan }) => SUMS[scan]), ...(both ? ["SDS"] : [])];
  const readAt = (scan: ScoredScan, row: number) => scores[scan]?.[row] ?? 0;
  return (
    <table class="scores" ref={table}>
      <caption class="hidden">Scores of the segments</caption>
      <thead>
        <tr>
          <th scope="col">Segment</th>
          {scans.map(({ scan, automatic }) => [
            <th key={scan} scope="col">
              {HEADS[scan]}
            </th>,
            automatic && (
              <th key={`${scan} automatic`} scope="col" class="quiet">
                <span aria-hidden="true">auto</span>
                <span class="hidden">{HEADS[scan]}, automatic</span>
              </th>
            ),
          ])}
          {both && <th scope="col">Diff.</th>}
        </tr>
      </thead>
      <tbody>
        {segments.map((name, row) => (
          <tr key={row}>
            <th scope="row">
              {row + 1} {name}
            </th>
            {scans.map(({ scan, automatic }, column) => [
              <td key={scan}>
                <ScoreCell
                  label={`${HEADS[scan]}, segment ${row + 1} ${name}`.trim()}
                  at={[row, column]}
                  score={readAt(scan, row)}
                  automatic={automatic?.[row] ?? null}
                  onScore={score => onScore(scan, row, score)}
                  go={go}
                />
              </td>,
              automatic && (
                <td key={`${scan} automatic`} class="quiet">
                  {automatic[row] ?? "–"}
                </td>
              ),
            ])}
            {both && <td>{exceeds(readAt("stress", row), readAt("rest", row))}</td>}
          </tr>
        ))}
      </tbody>
      <tfoot>
        <tr>
          <th scope="row">
            {sums.map((name, at) => [at > 0 && ", ", <Abbreviation key={name}>{name}</Abbreviation>])}
          </th>
          {scans.map(({ scan, automatic }) => [
            <td key={scan}>
              <output>{sumOf(scores[scan])}</output>
            </td>,
            automatic && (
              <td key={`${scan} automatic`} class="quiet">
                {sumOf(automatic)}
              </td>
            ),
          ])}
          {both && (
            <td>
              <output>{sumOf(segments.map((_, row) => exceeds(readAt("stress", row), readAt("rest", row))))}</output>
            </td>
          )}
        </tr>
      </tfoot>
    </table>
  );
}

interface CellProps {
  label: string;
  /** Its row and column. */
  at: [number, number];
  score: number;
  automatic: number | null;
  onScore: (score: number) => void;
  go: (row: number, column: number) => void;
}

function ScoreCell({ label, at: [row, column], score, automatic, onScore, go }: CellProps) {
  return (
    <input
      inputMode="numeric"
      autocomplete="off"
      class={automatic !== null && score !== automatic ? "own" : ""}
      aria-label={label}
      data-cell={`${row} ${column}`}
      value={score}
      onFocus={event => event.currentTarget.select()}
      onInput={event => {
        const input = event.currentTarget;
        const typed = (event as unknown as InputEvent).data ?? input.value;
        const isScore = /^[0-4]$/.test(typed);
        input.value = isScore ? typed : String(score);
        if (!isScore) return input.select();
        onScore(Number(typed));
        go(row + 1, column);
      }}
      onKeyDown={event => {
        const way = WAYS[event.key];
        if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        go(row + way[0], column + way[1]);
      }}
    />
  );
}
