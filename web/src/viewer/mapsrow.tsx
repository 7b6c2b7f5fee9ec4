// Polar maps beside each other: one cursor on all of them, and what they say of its place.

import type { ComponentChildren } from "preact";
import { type Watched, useWatched } from "../state";
import { number } from "../words";
import { useCanvas } from "./canvas";
import { type Lut, WALL_LUT } from "./colours";
import type { NamedMap } from "./compared";
import { figureLut, isInValvePlane, placeOnMap, segmentAt, valueAt } from "./polar";
import { ColourBar, LutChoice } from "./wall";

/** A map, its name and what it shows. */
export type TitledMap = Pick<NamedMap, "name" | "short" | "map" | "figure" | "lut">;

/** The place on all maps: shares of width and height of a drawn one. */
export type Cursor = Watched<[number, number] | null>;

/** Share of a map that an arrow key moves the cursor by. */
const STEP = 0.03;

/** The colours of a map: those that were chosen, of uptake; else the figure's own. */
export function lutOf({ figure, lut }: Pick<TitledMap, "figure" | "lut">, chosen: Lut): Lut {
  return lut ?? (figure === "uptake" ? chosen : figureLut(figure));
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
export function UptakeColours({ lut }: { lut: Watched<Lut> }) {
  return (
    <label class="inline">
      <LutChoice label="Colours of uptake" lut={lut} keptAs={WALL_LUT} />
    </label>
  );
}

interface LabelProps<T extends string> {
  choices: [T, string][];
  value: T;
  choose(value: T): void;
}

/** The choice of what is written on the maps. */
export function LabelChoice<T extends string>({ choices, value, choose }: LabelProps<T>) {
  return (
    <label class="inline">
      On the maps
      <select value={value} onChange={event => choose(event.currentTarget.value as T)}>
        {choices.map(([choice, text]) => (
          <option key={choice} value={choice}>
            {text}
          </option>
        ))}
      </select>
    </label>
  );
}

interface Places {
  cursor: Cursor;
  /** The place under the mouse, where views mark that: it goes before the cursor as long as it is there. */
  pointed?: Cursor | undefined;
}

/** The place that is marked; the component is drawn again when it changes. */
function useMarked({ cursor, pointed }: Places): [number, number] | null {
  const pressed = useWatched(cursor);
  return useWatched(pointed ?? cursor) ?? pressed;
}

interface MapProps extends Places {
  named: TitledMap;
  lut: Lut;
  /** Draws the map, with the cursor at a place of the wall. */
  draw: (context: CanvasRenderingContext2D, size: number, ratio: number, place: [number, number] | null) => void;
  /** What stands below the map; else its name and its scale. */
  children?: ComponentChildren;
}

export function SharedMap({ named, lut, cursor, pointed, draw: drawn, children }: MapProps) {
  const { name, short, map } = named;
  const marked = useMarked({ cursor, pointed });
  const place = marked && placeOnMap(map, marked[0], marked[1], 1);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    const size = element.clientWidth;
    if (context) drawn(context, size, element.width / size, place || null);
  };
  const { canvas } = useCanvas(draw, () => () => undefined, map);
  const placeOf = (event: { offsetX: number; offsetY: number; currentTarget: HTMLCanvasElement }) => {
    const size = event.currentTarget.clientWidth;
    const found = placeOnMap(map, event.offsetX, event.offsetY, size);
    return found && ([event.offsetX / size, event.offsetY / size] as [number, number]);
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
          cursor.value = placeOf(event) ?? cursor.value;
        }}
        onPointerMove={event => {
          if (event.buttons) cursor.value = placeOf(event) ?? cursor.value;
          if (pointed && event.pointerType !== "touch") pointed.value = placeOf(event);
        }}
        onPointerLeave={() => pointed && (pointed.value = null)}
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
          if (pointed) pointed.value = null;
          const from = cursor.value;
          const [x, y] = from ?? [0.5, 0.5];
          const next: [number, number] = from ? [x + STEP * way[0], y + STEP * way[1]] : [x, y];
          if (placeOnMap(map, next[0], next[1], 1)) cursor.value = next;
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

/** What a map says of a place; `signed`: of a difference what stress has more. */
export function valueThere({ map, figure }: TitledMap, place: [number, number] | null, signed = false): string {
  const found = place && placeOnMap(map, place[0], place[1], 1);
  if (!found) return "";
  if (isInValvePlane(map, ...found)) return "valve plane";
  const digits = ["uptake", "difference", "phase", "thickening"].includes(figure) ? 0 : 1;
  if (!signed) return number(valueAt(map, ...found), digits, map.unit);
  // That of the uptake is the service's, of rest less stress.
  const value = (figure === "difference" ? -1 : 1) * valueAt(map, ...found);
  return `${Number(value.toFixed(digits)) > 0 ? "+" : ""}${number(value, digits, map.unit)}`;
}

interface ReadoutProps extends Places {
  maps: TitledMap[];
  /** The map that says which segment a place is in; else the first one. */
  by?: TitledMap | undefined;
  /** What is said while nothing is chosen. */
  hint: string;
  /** Further rows of a segment. */
  more?: (segment: number) => [string, string][];
}

/** What all maps say of the place of the cursor. */
export function Readout({ maps, by = maps[0], cursor, pointed, hint, more }: ReadoutProps) {
  const marked = useMarked({ cursor, pointed });
  const rows = maps
    .map((named): [string, string] => [named.short, valueThere(named, marked)])
    .filter(([, here]) => here !== "");
  const place = by && marked && placeOnMap(by.map, marked[0], marked[1], 1);
  const segment = place ? segmentAt(by.map, ...place) : undefined;
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
