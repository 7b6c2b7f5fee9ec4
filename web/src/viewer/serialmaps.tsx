// Polar maps of all scans in a row, and below them what pairs of scans differ by, in one scale and with one cursor.

import { useMemo, useState } from "preact/hooks";
import { Watched, useWatched } from "../state";
import { number } from "../words";
import { LUTS, type Lut, UPTAKE, WALL_LUT, kept } from "./colours";
import { Readout, Scale, SharedMap, type TitledMap, UptakeColours, lutOf, LabelChoice } from "./mapsrow";
import { type PolarLabels, drawPolar } from "./polar";
import { type Pair, type Series, oddScans, uptakeOf, verdictWords } from "./serial";

const WRITTEN: [PolarLabels, string][] = [
  ["means", "per cent"],
  ["numbers", "segments"],
  ["nothing", "nothing"],
];

/** Which pairs of scans are shown: every scan is compared with the first one and with the one before it. */
const AGAINST: [string, (pair: Pair) => boolean][] = [
  ["the first scan", ({ earlier }) => earlier === 1],
  ["the scan before", ({ earlier, later }) => later === earlier + 1],
];

export function SerialMaps({ series, pair }: { series: Series; pair: Pair }) {
  const scene = useMemo(
    () => ({
      lut: new Watched<Lut>(kept(WALL_LUT, UPTAKE) ?? LUTS[UPTAKE]!),
      cursor: new Watched<[number, number] | null>(null),
    }),
    [series],
  );
  const [written, setWritten] = useState<PolarLabels>("means");
  const [against, setAgainst] = useState(0);
  const lut = useWatched(scene.lut);
  const { report, uptake } = series;
  const isShown = AGAINST[against]![1];
  const changes = series.changes.filter(isShown).map(({ named }) => named);
  const odd = oddScans(report).map(scan => `Scan ${scan}`);
  const map = (named: TitledMap) => (
    <SharedMap
      key={named.name}
      named={named}
      lut={lut}
      cursor={scene.cursor}
      draw={(context, size, ratio, cursor) =>
        drawPolar(context, named.map, size, ratio, {
          lut: lutOf(named, lut),
          segments: false,
          threshold: true,
          territories: false,
          cursor,
          labels: written,
        })
      }>
      <b>{named.short}</b>
      {named.figure === "uptake" && odd.some(one => named.short.startsWith(`${one},`) || named.short === one) && (
        <span class="warning">may be the odd one</span>
      )}
    </SharedMap>
  );
  if (uptake.length === 0) return null;
  const isTurned = uptake.some(({ map: { orientation } }) => orientation === "unknown");
  return (
    <section class="pictures compared-maps serial-maps" aria-label="Polar maps">
      <div class="toolbar" role="toolbar" aria-label="Polar maps">
        <LabelChoice choices={WRITTEN} value={written} choose={value => setWritten(value)} />
        <UptakeColours lut={scene.lut} />
        {report.scans.length > 2 && (
          <label class="inline">
            Compared with
            <select value={against} onChange={event => setAgainst(Number(event.currentTarget.value))}>
              {AGAINST.map(([text], at) => (
                <option key={text} value={at}>
                  {text}
                </option>
              ))}
            </select>
          </label>
        )}
      </div>
      <div class="scale">
        <b>Uptake</b> <Scale named={uptake[0]!} lut={lut} />
      </div>
      <div class="maps">{uptake.map(map)}</div>
      {changes[0] && (
        <div class="scale">
          <b>Earlier less later</b> <Scale named={changes[0]} lut={lut} />
          <span class="quiet">Above 0: uptake was lost. Counts are matched where nothing changed.</span>
        </div>
      )}
      <div class="maps">
        {changes.map(map)}
        <Readout
          maps={[...uptake, ...changes]}
          cursor={scene.cursor}
          hint="Press on a map to read all of them there."
          more={segment => {
            const found = uptakeOf(report, pair)?.segments.find(one => one.segment === segment);
            if (found?.change_points == null) return [];
            const points = `${number(found.change_points, 0, "points")}, changed: ${verdictWords(found.change_verdict)}`;
            return [[`Segment, scan ${pair.earlier} to ${pair.later}`, points]];
          }}
        />
      </div>
      {isTurned && (
        <p class="warning">
          The anterior side is unknown: segments have no names, and the hearts may be turned against each other.
        </p>
      )}
    </section>
  );
}
