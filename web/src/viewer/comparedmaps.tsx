// Polar maps of a comparison beside each other, with one cursor on all of them; with the beats of both scans a row for
// each figure.

import { useMemo } from "preact/hooks";
import type { ComparisonReport } from "../generated/openapi";
import { useWatched } from "../state";
import { number } from "../words";
import { type Compared, type NamedMap, beatRowsOf, mapsOf } from "./compared";
import { type ComparedScene, type Written, usePlace } from "./comparedscene";
import type { Lut } from "./colours";
import { Readout, Scale, SharedMap, UptakeColours, lutOf, valueThere, LabelChoice } from "./mapsrow";
import { type DrawnMap, FIGURES, drawPolar, middleOfSegment, onMap, placeOnMap, segmentAt } from "./polar";

/** A map of uptake with the scores of its segments written on it. */
function withScores({ scan, map, figure }: NamedMap, { segments }: ComparisonReport): DrawnMap {
  if (figure !== "uptake") return map;
  return {
    ...map,
    segments: map.segments.map(one => {
      const found = segments.find(other => other.segment === one.number);
      return { ...one, mean: (scan === "stress" ? found?.stress_score : found?.rest_score) ?? null };
    }),
  };
}

/** What is drawn of a map, and what is written on it. */
export function drawMap(
  context: CanvasRenderingContext2D,
  named: NamedMap,
  report: ComparisonReport,
  written: Written,
  lut: Lut,
  size: number,
  ratio: number,
  cursor: [number, number] | null,
): void {
  const map = written === "scores" ? withScores(named, report) : named.map;
  drawPolar(context, map, size, ratio, {
    lut: lutOf(named, lut),
    segments: false,
    threshold: true,
    territories: false,
    cursor,
    labels: written === "scores" ? "means" : written,
  });
}

export function ComparedMaps({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const maps = useMemo(() => mapsOf(compared), [compared]);
  const { stress, rest } = useWatched(scene.beats);
  const beatRows = useMemo(() => (stress && rest ? beatRowsOf(compared, stress, rest) : []), [compared, stress, rest]);
  const written = useWatched(scene.written);
  const hasScores = compared.report.sss != null;
  const choices: [Written, string][] = [
    ["means", "per cent"],
    ...(hasScores ? [["scores", "scores"] as [Written, string]] : []),
    ["numbers", "segments"],
    ["nothing", "nothing"],
  ];
  return (
    <section class="compared-maps" aria-label="Polar maps">
      <div class="toolbar" role="toolbar" aria-label="Polar maps">
        <LabelChoice choices={choices} value={written} choose={value => (scene.written.value = value)} />
        <UptakeColours lut={scene.lut} />
      </div>
      {beatRows.length > 0 ? (
        <>
          <TableAtCursor compared={compared} scene={scene} rows={[maps.slice(0, 3), ...beatRows]} />
          {[maps.slice(0, 3), ...beatRows, ...pairsOf(maps.slice(3))].map(row => (
            <RowOfMaps key={row[0]!.name} row={row} compared={compared} scene={scene} />
          ))}
        </>
      ) : (
        <div class={`maps${maps.length > 3 ? "" : " few"}`}>
          {maps.slice(0, 3).map(named => (
            <OneMap key={named.name} named={named} compared={compared} scene={scene} />
          ))}
          <Readout
            maps={maps}
            by={maps.find(({ scan }) => scan === "rest")}
            cursor={scene.cursor}
            pointed={scene.pointed}
            hint="Press on a map or a slice to read all of them there."
            more={segment => {
              const found = compared.report.segments.find(one => one.segment === segment);
              return found ? [["Reversible part", number(found.reversible_percent, 0, "%")]] : [];
            }}
          />
          {maps.slice(3).map(named => (
            <OneMap key={named.name} named={named} compared={compared} scene={scene} />
          ))}
        </div>
      )}
      {!(compared.stress.oriented && compared.rest.oriented) && (
        <p class="warning">
          The anterior side is unknown: segments have no names, and both hearts may be turned against each other.
        </p>
      )}
    </section>
  );
}

/** The maps of one figure at stress and at rest. */
function pairsOf(maps: NamedMap[]): NamedMap[][] {
  return [...new Set(maps.map(({ figure }) => figure))].map(figure => maps.filter(map => map.figure === figure));
}

const rowName = ({ figure }: NamedMap) => (figure === "uptake" ? "Uptake" : FIGURES[figure].name);

/** One figure at stress and at rest in one scale, and the difference. */
function RowOfMaps({ row, compared, scene }: { row: NamedMap[]; compared: Compared; scene: ComparedScene }) {
  const lut = useWatched(scene.lut);
  const [first, , less] = row;
  return (
    <section class="map-row" aria-label={rowName(first!)}>
      <p>
        <b>{rowName(first!)}</b>
        <Scale named={first!} lut={lut} />
        {less && (
          <span class="less">
            {less.short}
            <Scale named={less} lut={lut} />
          </span>
        )}
      </p>
      {row.map(named => (
        <OneMap key={named.name} named={named} compared={compared} scene={scene} bare />
      ))}
    </section>
  );
}

interface OneMapProps {
  named: NamedMap;
  compared: Compared;
  scene: ComparedScene;
  /** Whether its scale stands elsewhere. */
  bare?: boolean;
}

function OneMap({ named, compared, scene, bare = false }: OneMapProps) {
  const lut = useWatched(scene.lut);
  const written = useWatched(scene.written);
  return (
    <SharedMap
      named={named}
      lut={lut}
      cursor={scene.cursor}
      pointed={scene.pointed}
      draw={(context, size, ratio, place) =>
        drawMap(context, named, compared.report, written, lut, size, ratio, place)
      }>
      {bare ? named.short : undefined}
    </SharedMap>
  );
}

/** The segment at the place that all views mark, by the map of rest. */
export function useSegment(compared: Compared, scene: ComparedScene) {
  const place = usePlace(scene);
  const polar = compared.rest.polar ?? compared.stress.polar;
  const found = place && polar && placeOnMap(polar, place[0], place[1], 1);
  return found ? segmentAt(polar, ...found) : undefined;
}

/** How a table of segments and the other views show one place: the middle of the segment that is pointed to. */
export function useSegmentMarks<Part extends { segment: number }>(compared: Compared, scene: ComparedScene) {
  const marked = useSegment(compared, scene)?.number;
  const polar = compared.rest.polar ?? compared.stress.polar;
  const middle = ({ segment }: Part) => polar && onMap(polar, ...middleOfSegment(polar, segment));
  return {
    isMarked: (part: Part) => part.segment === marked,
    onPoint: (part: Part | null) => (scene.pointed.value = part && middle(part)),
    onPress: (part: Part) => (scene.cursor.value = middle(part)),
  };
}

/** What all maps say of the place of the cursor, a line for each figure. */
function TableAtCursor({ compared, scene, rows }: { compared: Compared; scene: ComparedScene; rows: NamedMap[][] }) {
  const place = usePlace(scene);
  const segment = useSegment(compared, scene);
  return (
    <div class="readout" role="status" aria-label="At the cursor">
      {segment ? (
        <table>
          <caption>
            <b>
              {segment.number} {segment.name}
            </b>
          </caption>
          <thead>
            <tr>
              <td />
              <th scope="col">stress</th>
              <th scope="col">rest</th>
              <th scope="col">stress less rest</th>
            </tr>
          </thead>
          <tbody>
            {rows.map(row => (
              <tr key={row[0]!.name}>
                <th scope="row">{rowName(row[0]!)}</th>
                {row.map(named => (
                  <td key={named.name}>{valueThere(named, place, named.scan === null)}</td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      ) : (
        <p class="quiet">Point to a map, a slice or a segment to read all of them there; a press stays.</p>
      )}
    </div>
  );
}
