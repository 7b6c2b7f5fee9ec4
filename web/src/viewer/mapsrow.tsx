// Polar maps beside each other: one cursor on all of them, and what they say of its place.

import type { ComponentChildren } from "preact";
import { type Watched, useWatched } from "../state";
import { number } from "../words";
import { useCanvas } from "./canvas";
import { LUTS, type Lut, WALL_LUT, keep } from "./colours";
import type { NamedMap } from "./compared";
import { figureLut, isInValvePlane, placeOnMap, segmentAt, valueAt } from "./polar";
import { ColourBar } from "./wall";

/** A map, its name and what it shows. */
export type TitledMap = Pick<NamedMap, "name" | "short" | "map" | "figure">;

/** The place on all maps: shares of width and height of a drawn one. */
export type Cursor = Watched<[number, number] | null>;

/** Share of a map that an arrow key moves the cursor by. */
const STEP = 0.03;

/** The colours of a map: those that were chosen, of uptake; else the figure's own. */
export function lutOf({ figure }: Pick<TitledMap, "figure">, chosen: Lut): Lut {
  return figure === "uptake" ? chosen : figureLut(figure);
}

/** The places of a colour bar's ends in words. */
export function endsOf({ map }: Pick<TitledMap, "map">): [string, string] {
  const [low, high] = map.range;
  return [String(low), `${high}${map.unit && `\u2009${map.unit}`}`];
}

/** The colour bar of a map. */
export function Scale({ named, lut }: { named: TitledMap; lut: Lut }) {
  return <ColourBar lut={lutOf(named, lut)} low={endsOf(named)[0]} high={endsOf(named)[1]} />;
}

/** Which colours maps and walls show uptake in. */
export function UptakeColours({ lut: watched }: { lut: Watched<Lut> }) {
  const lut = useWatched(watched);
  return (
    <label class="inline">
      <select
        aria-label="Colours of uptake"
        value={Object.keys(LUTS).find(name => LUTS[name] === lut)}
        onChange={event => {
          watched.value = LUTS[event.currentTarget.value]!;
          keep(WALL_LUT, event.currentTarget.value);
        }}>
        {Object.keys(LUTS).map(name => (
          <option key={name}>{name}</option>
        ))}
      </select>
    </label>
  );
}

interface MapProps {
  named: TitledMap;
  lut: Lut;
  cursor: Cursor;
  /** Draws the map, with the cursor at a place of the wall. */
  draw: (context: CanvasRenderingContext2D, size: number, ratio: number, place: [number, number] | null) => void;
  /** What stands below the map; else its name and its scale. */
  children?: ComponentChildren;
}

export function SharedMap({ named, lut, cursor: watched, draw: drawn, children }: MapProps) {
  const { name, short, map } = named;
  const cursor = useWatched(watched);
  const place = cursor && placeOnMap(map, cursor[0], cursor[1], 1);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    const size = element.clientWidth;
    if (context) drawn(context, size, element.width / size, place || null);
  };
  const { canvas } = useCanvas(draw, () => () => undefined, map);
  const go = (event: { offsetX: number; offsetY: number; currentTarget: HTMLCanvasElement }) => {
    const size = event.currentTarget.clientWidth;
    if (placeOnMap(map, event.offsetX, event.offsetY, size))
      watched.value = [event.offsetX / size, event.offsetY / size];
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
          if (placeOnMap(map, next[0], next[1], 1)) watched.value = next;
        }}
      />
      <figcaption>
        {children ?? (
          <>
            <b>{short}</b>
            <Scale named={named} lut={lut} />
          </>
        )}
      </figcaption>
    </figure>
  );
}

interface ReadoutProps {
  maps: TitledMap[];
  cursor: Cursor;
  /** What is said while nothing is chosen. */
  hint: string;
  /** Further rows of a segment. */
  more?: (segment: number) => [string, string][];
}

/** What all maps say of the place of the cursor. */
export function Readout({ maps, cursor: watched, hint, more }: ReadoutProps) {
  const cursor = useWatched(watched);
  const rows = maps.flatMap((named): [string, string][] => {
    const { short, map, figure } = named;
    const place = cursor && placeOnMap(map, cursor[0], cursor[1], 1);
    if (!place) return [];
    const here = isInValvePlane(map, ...place)
      ? "valve plane"
      : number(valueAt(map, ...place), figure === "uptake" || figure === "difference" ? 0 : 1, map.unit);
    return [[short, here]];
  });
  const first = maps[0];
  const place = first && cursor && placeOnMap(first.map, cursor[0], cursor[1], 1);
  const segment = place ? segmentAt(first.map, ...place) : undefined;
  return (
    <div class="readout" role="status" aria-label="At the cursor">
      {segment ? (
        <>
          <b>
            {segment.number} {segment.name}
          </b>
          <dl>
            {[...rows, ...(more?.(segment.number) ?? [])].map(([name, here]) => (
              <div key={name}>
                <dt>{name}</dt>
                <dd>{here}</dd>
              </div>
            ))}
          </dl>
        </>
      ) : (
        <p class="quiet">{hint}</p>
      )}
    </div>
  );
}
