// The polar map on the page: a click takes the cursor to that place of the wall.

import { useMemo, useState } from "preact/hooks";
import { useWatched } from "../state";
import { number } from "../words";
import { useCanvas } from "./canvas";
import { WALL_LUT } from "./colours";
import type { Mesh } from "./mesh";
import type { PolarMap } from "../generated/openapi";
import {
  WallFrame,
  drawPolar,
  hasValvePlane,
  isInValvePlane,
  placeOnMap,
  segmentAt,
  shown,
  uptakeMap,
  valueAt,
} from "./polar";
import type { Axis } from "./plane";
import type { Scene } from "./scene";
import { ColourBar, LutChoice } from "./wall";

interface Props {
  scene: Scene;
  map: PolarMap;
  mesh: Mesh;
  heart: Axis;
  title: string;
}

export function PolarView({ scene, map, mesh, heart, title }: Props) {
  const lut = useWatched(scene.wallLut);
  const cursor = useWatched(scene.cursor);
  const [segments, setSegments] = useState(false);
  const [threshold, setThreshold] = useState(true);
  const [territories, setTerritories] = useState(false);
  const frame = useMemo(() => new WallFrame(mesh, heart, map.rows, map.columns), [mesh, heart, map]);
  const drawnMap = useMemo(() => uptakeMap(map), [map]);
  const [rows, columns] = frame.place(cursor);
  const onWall = rows >= 0 && rows <= map.rows + 1;
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    if (context)
      drawPolar(context, drawnMap, element.clientWidth, element.width / element.clientWidth, {
        lut,
        segments,
        threshold,
        territories,
        cursor: onWall ? [rows, columns] : null,
      });
  };
  const { canvas } = useCanvas(draw, () => () => undefined, map);
  const segment = onWall ? segmentAt(map, rows, columns) : undefined;
  const go = (x: number, y: number, size: number) => {
    const place = placeOnMap(map, x, y, size);
    if (place) scene.cursor.value = frame.at(...place);
  };
  return (
    <figure class="polar">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        aria-label={`${title}: ${map.segments.map(one => `${one.name} ${number(one.mean_percent, 0, "%")}`).join(", ")}`}
        onPointerDown={event => {
          event.currentTarget.setPointerCapture(event.pointerId);
          go(event.offsetX, event.offsetY, event.currentTarget.clientWidth);
        }}
        onPointerMove={event => event.buttons && go(event.offsetX, event.offsetY, event.currentTarget.clientWidth)}
        onKeyDown={event => {
          const step: Record<string, [number, number]> = {
            ArrowUp: [-1, 0],
            ArrowDown: [1, 0],
            ArrowLeft: [0, 1],
            ArrowRight: [0, -1],
          };
          const by = step[event.key];
          if (!by) return;
          event.preventDefault();
          scene.cursor.value = frame.at(Math.max(0.5, Math.min(map.rows, rows + by[0])), columns + 2 * by[1]);
        }}
      />
      <figcaption>
        <p class="at">
          {segment ? (
            <>
              <b>{segment.name}</b> {number(shown(segment.mean_percent), 0, "%")}, here{" "}
              {isInValvePlane(map, rows, columns) ? "valve plane" : number(valueAt(drawnMap, rows, columns), 0, "%")}
            </>
          ) : (
            "Cursor off the wall"
          )}
        </p>
        <span class="inline">
          <ColourBar lut={lut} low="0" high="100 %" />
          <LutChoice label="Colours of polar map and wall" lut={scene.wallLut} keptAs={WALL_LUT} />
        </span>
        <div class="options">
          <label class="inline">
            <input type="checkbox" checked={threshold} onChange={event => setThreshold(event.currentTarget.checked)} />{" "}
            below {number(map.threshold_percent, 0, "%")}
          </label>
          <label class="inline">
            <input type="checkbox" checked={segments} onChange={event => setSegments(event.currentTarget.checked)} />{" "}
            segment means
          </label>
          {map.orientation !== "unknown" && (
            <label class="inline">
              <input
                type="checkbox"
                checked={territories}
                onChange={event => setTerritories(event.currentTarget.checked)}
              />{" "}
              territories
            </label>
          )}
        </div>
        {hasValvePlane(map) && <p class="quiet">Hatched: valve plane, in no figure.</p>}
        {territories && (
          <p class="quiet">
            {map.territories.map(one => `${one.name} ${number(one.mean_percent, 0, "%")}`).join(" · ")}
          </p>
        )}
        {map.orientation === "unknown" && <p class="warning">The anterior side is unknown: segments have no names.</p>}
      </figcaption>
    </figure>
  );
}
