// Links to results, with their leading figures.

import { Abbreviation } from "./abbreviation";
import type { Result } from "./api";
import { newerCorrections } from "./corrections";
import { ReadMark } from "./readmark";
import { nameAmong, resultName } from "./resultnames";
import { isBeat, isComparison, isFit, isSerial, number } from "./words";

export function ComparisonLink({ made }: { made: Result }) {
  return (
    <a class="result" href={`#/comparison/${made.id}`}>
      <b>{resultName(made)}</b> <ReadMark of={made.id} /> {figures(made)}
      {newerCorrections(made).length > 0 && <span class="quiet"> older than a correction</span>}
    </a>
  );
}

export function SerialLink({ made }: { made: Result }) {
  return (
    <a class="result" href={`#/serial/${made.id}`}>
      <b>{resultName(made)}</b> {figures(made)}
    </a>
  );
}

/** A link to a result of a scan, named apart from the others. */
export function ResultLink({ result, among }: { result: Result; among: Result[] }) {
  return (
    <a class="result" href={`#/scan/${result.volume}/${result.id}`}>
      <b>{nameAmong(result, among)}</b> <ReadMark of={result.id} /> {figures(result)}
    </a>
  );
}

function figures(result: Result) {
  const { summary } = result;
  if (isComparison(result.id)) {
    const { sss, sds, ef_change_points: change } = summary;
    return (
      <>
        <span>
          <Abbreviation>TID</Abbreviation> {number(summary.tid, 2)}, reversible{" "}
          {number(summary.reversible_percent, 0, "%")}
          {sss != null && (
            <>
              , <Abbreviation>SSS</Abbreviation> {sss}, <Abbreviation>SDS</Abbreviation> {sds}
            </>
          )}
          {change != null && (
            <>
              , <Abbreviation>EF</Abbreviation> {change > 0 && "+"}
              {number(change, 0, "points")}
            </>
          )}
        </span>
        <Doubts count={summary.flags?.length ?? 0} />
      </>
    );
  }
  if (isSerial(result.id)) {
    const { worse_percent: worse, better_percent: better, ef_change_points: change } = summary;
    const said = (verdict: string | null | undefined) => (verdict ? ` (${verdict.replaceAll("_", " ")})` : "");
    return (
      <>
        <span>
          worse {number(worse, 0, "%")}
          {said(summary.worse_verdict)}, better {number(better, 0, "%")}
          {said(summary.better_verdict)}
          {change != null &&
            `, EF ${change > 0 ? "+" : ""}${number(change, 0, "points")}${said(summary.ef_change_verdict)}`}
        </span>
        <Doubts count={summary.flags?.length ?? 0} />
      </>
    );
  }
  if (isBeat(result.id))
    return (
      <>
        <span>
          <Abbreviation>EF</Abbreviation> {number(summary.ef_percent, 0, "%")}, <Abbreviation>EDV</Abbreviation>{" "}
          {number(summary.edv_ml, 0, "ml")}, <Abbreviation>ESV</Abbreviation> {number(summary.esv_ml, 0, "ml")}
        </span>
        <Doubts count={summary.flags?.length ?? 0} />
      </>
    );
  if (!isFit(result.id)) return <span>distance {number(summary.distance_mean_mm, 2, "mm")}</span>;
  const given = summary.volumes_ml;
  const volumesMl = given?.anatomical ?? given;
  return (
    <>
      <span>
        cavity {number(volumesMl?.cavity, 0, "ml")}, wall {number(volumesMl?.wall, 0, "ml")}
      </span>
      <Doubts count={summary.flags?.length ?? 0} />
    </>
  );
}

function Doubts({ count }: { count: number }) {
  return count > 0 ? (
    <>
      <span>{" · "}</span>
      <span class="warning">
        {count} {count === 1 ? "doubt" : "doubts"}
      </span>
    </>
  ) : null;
}
