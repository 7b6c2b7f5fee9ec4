// Polar maps of a comparison beside each other, with one cursor on all of them.

import { useMemo } from "preact/hooks";
import type { ComparisonReport } from "../generated/openapi";
import { useWatched } from "../state";
import { number } from "../words";
import { useCanvas } from "./canvas";
import { type Compared, type NamedMap, mapsOf } from "./compared";
import type { ComparedScene, Written } from "./comparedscene";
import { LUTS, type Lut, WALL_LUT, keep } from "./colours";
import { type DrawnMap, drawPolar, figureLut, isInValvePlane, placeOnMap, segmentAt, valueAt } from "./polar";
import { ColourBar } from "./wall";

/** Share of a map that an arrow key moves the cursor by. */
const STEP = 0.03;

/** The colours of a map: those that were chosen, of uptake; else the figure's own. */
export function lutOf({ figure }: NamedMap, chosen: Lut): Lut {
  return figure === "uptake" ? chosen : figureLut(figure);
}

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

/** The places of a colour bar's ends in words. */
export function endsOf({ map }: NamedMap): [string, string] {
  const [low, high] = map.range;
  return [String(low), `${high}${map.unit && `\u2009${map.unit}`}`];
}

export function ComparedMaps({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const maps = useMemo(() => mapsOf(compared), [compared]);
  const written = useWatched(scene.written);
  const lut = useWatched(scene.lut);
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
        <label class="inline">
          On the maps
          <select value={written} onChange={event => (scene.written.value = event.currentTarget.value as Written)}>
            {choices.map(([value, text]) => (
              <option key={value} value={value}>
                {text}
              </option>
            ))}
          </select>
        </label>
        <label class="inline">
          <select
            aria-label="Colours of uptake"
            value={Object.keys(LUTS).find(name => LUTS[name] === lut)}
            onChange={event => {
              scene.lut.value = LUTS[event.currentTarget.value]!;
              keep(WALL_LUT, event.currentTarget.value);
            }}>
            {Object.keys(LUTS).map(name => (
              <option key={name}>{name}</option>
            ))}
          </select>
        </label>
      </div>
      <div class={`maps${maps.length > 3 ? "" : " few"}`}>
        {maps.slice(0, 3).map(named => (
          <OneMap key={named.name} named={named} compared={compared} scene={scene} />
        ))}
        <Readout compared={compared} scene={scene} maps={maps} />
        {maps.slice(3).map(named => (
          <OneMap key={named.name} named={named} compared={compared} scene={scene} />
        ))}
      </div>
      {!(compared.stress.oriented && compared.rest.oriented) && (
        <p class="warning">
          The anterior side is unknown: segments have no names, and both hearts may be turned against each other.
        </p>
      )}
    </section>
  );
}

function OneMap({ named, compared, scene }: { named: NamedMap; compared: Compared; scene: ComparedScene }) {
  const { name, short, map } = named;
  const lut = useWatched(scene.lut);
  const written = useWatched(scene.written);
  const cursor = useWatched(scene.cursor);
  const place = cursor && placeOnMap(map, cursor[0], cursor[1], 1);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    const size = element.clientWidth;
    if (context) drawMap(context, named, compared.report, written, lut, size, element.width / size, place || null);
  };
  const { canvas } = useCanvas(draw, () => () => undefined, map);
  const go = (event: { offsetX: number; offsetY: number; currentTarget: HTMLCanvasElement }) => {
    const size = event.currentTarget.clientWidth;
    if (placeOnMap(map, event.offsetX, event.offsetY, size))
      scene.cursor.value = [event.offsetX / size, event.offsetY / size];
  };
  return (
    <figure class="polar">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        aria-label={`${name}: ${map.segments.map(one => `${one.name} ${number(one.mean, map.digits, map.unit)}`).join(", ")}`}
        onPointerDown={event => {
          event.currentTarget.setPointerCapture(event.pointerId);
          go(event);
        }}
        onPointerMove={event => event.buttons && go(event)}
        onKeyDown={event => {
          const ways: Record<string, [number, number]> = {
            ArrowUp: [0, -1],
            ArrowDown: [0, 1],
            ArrowLeft: [-1, 0],
            ArrowRight: [1, 0],
          };
          const way = ways[event.key];
          if (!way) return;
          event.preventDefault();
          const [x, y] = cursor ?? [0.5, 0.5];
          const next: [number, number] = cursor ? [x + STEP * way[0], y + STEP * way[1]] : [x, y];
          if (placeOnMap(map, next[0], next[1], 1)) scene.cursor.value = next;
        }}
      />
      <figcaption>
        <b>{short}</b>
        <ColourBar lut={lutOf(named, lut)} low={endsOf(named)[0]} high={endsOf(named)[1]} />
      </figcaption>
    </figure>
  );
}

/** What all maps say of the place of the cursor. */
function Readout({ compared, scene, maps }: { compared: Compared; scene: ComparedScene; maps: NamedMap[] }) {
  const cursor = useWatched(scene.cursor);
  const rows = maps.flatMap((named): [string, string][] => {
    const { short, map } = named;
    const place = cursor && placeOnMap(map, cursor[0], cursor[1], 1);
    if (!place) return [];
    const here = isInValvePlane(map, ...place)
      ? "valve plane"
      : number(valueAt(map, ...place), named.figure === "uptake" || named.figure === "difference" ? 0 : 1, map.unit);
    return [[short, here]];
  });
  const first = maps[0];
  const place = first && cursor && placeOnMap(first.map, cursor[0], cursor[1], 1);
  const segment = place ? segmentAt(first.map, ...place) : undefined;
  const found = compared.report.segments.find(one => one.segment === segment?.number);
  return (
    <div class="readout" role="status" aria-label="At the cursor">
      {segment ? (
        <>
          <b>
            {segment.number} {segment.name}
          </b>
          <dl>
            {rows.map(([name, here]) => (
              <div key={name}>
                <dt>{name}</dt>
                <dd>{here}</dd>
              </div>
            ))}
            {found && (
              <div>
                <dt>Reversible part</dt>
                <dd>{number(found.reversible_percent, 0, "%")}</dd>
              </div>
            )}
          </dl>
        </>
      ) : (
        <p class="quiet">Press on a map or a slice to read all of them there.</p>
      )}
    </div>
  );
}
