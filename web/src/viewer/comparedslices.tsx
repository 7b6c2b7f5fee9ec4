// Slices of stress above those of rest, at the same levels, in the same colours; one of them, chosen, is shown large.

import { useWatched } from "../state";
import { useCanvas } from "./canvas";
import { type Compared, type ComparedHeart, KINDS, type Row, sliceAt, spacingOf, wallFrameOf } from "./compared";
import type { ComparedScene } from "./comparedscene";
import { type Look, brightestOf, contours, label, paintVoxels } from "./drawing";
import { type Plane, point } from "./plane";
import { placeOnMap, onMap } from "./polar";
import { type Vec, dot, sub } from "./vector";

/** CSS pixels left of the slices for the name of the scan, and above each kind for its own. */
const [ASIDE, ABOVE] = [46, 19];
const GROUND = "#0a0e11";
const MARK = "#4de3ff";

export interface Laid {
  cell: number;
  left: number;
  top: (kind: number, row: number) => number;
  height: number;
}

/** Where the cells of `rows` lie in a picture of this size. */
export function laid(width: number, height: number, rows: Row[]): Laid {
  const aside = width < 500 ? 38 : ASIDE;
  const most = Math.max(...rows.map(row => row.count));
  const cell = Math.max(8, Math.min((width - aside) / most, (height - 3 * ABOVE) / 6));
  const left = aside + Math.max(0, (width - aside - most * cell) / 2);
  const top = (kind: number, row: number) => (kind + 1) * ABOVE + (2 * kind + row) * cell;
  return { cell, left, top, height: 3 * ABOVE + 6 * cell };
}

/** The place of the cursor on a heart's wall; null where there is none. */
function cursorPlace(one: ComparedHeart, cursor: [number, number] | null): Vec | null {
  const frame = cursor && wallFrameOf(one);
  const place = cursor && one.polar && placeOnMap(one.polar, cursor[0], cursor[1], 1);
  return frame && place ? frame.at(...place) : null;
}

/** How a slice of a scan is painted: `window` in per cent of its wall, its whole image, or the slice itself. */
function lookAt(one: ComparedHeart, scene: ComparedScene, plane: Plane, origin: Vec): Look {
  const voxels = one.region!;
  const full = {
    wall: () => one.polar?.reference ?? one.report.polar?.reference ?? voxels.highest,
    image: () => voxels.highest,
    slice: () => brightestOf(voxels, plane, origin, scene.across.value),
  }[scene.normalisation.value]();
  const [low, high] = scene.window.value.map(percent => (full * percent) / 100) as [number, number];
  return { voxels, lut: scene.lut.value, low, high, smooth: scene.smooth.value };
}

export interface SlicesStyle {
  width: number;
  height: number;
  ratio: number;
  /** Whether cursor and chosen slice are marked. */
  marks: boolean;
}

export function drawSlices(
  element: HTMLCanvasElement,
  compared: Compared,
  scene: ComparedScene,
  { width, height, ratio, marks }: SlicesStyle,
): void {
  const context = element.getContext("2d");
  if (!context) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = GROUND;
  context.fillRect(0, 0, width, height);
  const rows = scene.rows.value;
  const across = scene.across.value;
  const { cell, left, top } = laid(width, height, rows);
  const factor = cell / across;
  const small = width < 500;
  for (const [kind, { name, short, way }] of KINDS.entries()) {
    label(
      context,
      small ? `${short}: ${way}` : `${name}: ${way}`,
      left,
      top(kind, 0) - ABOVE / 2,
      "left",
      small ? 10 : 12,
    );
    for (const [row, one] of [compared.stress, compared.rest].entries()) {
      const { heart, region } = one;
      const y = top(kind, row);
      label(context, row === 0 ? "Stress" : "Rest", left - 5, y + cell / 2, "right", small ? 9 : 12);
      if (!heart || !region) continue;
      const place = marks ? cursorPlace(one, scene.cursor.value) : null;
      for (let n = 0; n < rows[kind]!.count; n++) {
        const { plane, origin } = sliceAt({ heart, scan: one.scan }, kind, n, rows);
        const box = { x: left + n * cell + 0.5, y: y + 0.5, width: cell - 1, height: cell - 1 };
        context.save();
        context.beginPath();
        context.rect(box.x, box.y, box.width, box.height);
        context.clip();
        paintVoxels(context, lookAt(one, scene, plane, origin), plane, origin, box, factor);
        context.translate(box.x + box.width / 2, box.y + box.height / 2);
        if (scene.contours.value)
          contours(
            context,
            [{ name: "wall", colour: "#3dffa8", shown: true, mesh: one.mesh }],
            plane,
            origin,
            factor,
            across / 2,
          );
        if (place && Math.abs(dot(sub(place, origin), plane.normal)) <= spacingOf(heart, kind, rows) / 2) {
          const from = sub(place, origin);
          ring(context, dot(from, plane.right) * factor, dot(from, plane.down) * factor, Math.max(3, cell / 22));
        }
        context.restore();
      }
    }
  }
  const { kind, number } = scene.chosen.value;
  if (!marks) return;
  context.strokeStyle = MARK;
  context.lineWidth = 1.5;
  context.strokeRect(left + number * cell + 1, top(kind, 0) + 1, cell - 2, 2 * cell - 2);
}

function ring(context: CanvasRenderingContext2D, x: number, y: number, radius: number): void {
  for (const [width, stroke] of [
    [3, "#000"],
    [1.5, MARK],
  ] as const) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }
}

/** Takes the cursor to the wall of a heart nearest to a place in one of its slices. */
function goTo(
  scene: ComparedScene,
  one: ComparedHeart,
  kind: number,
  number: number,
  right: number,
  down: number,
): void {
  const frame = wallFrameOf(one);
  if (!one.heart || !one.polar || !frame) return;
  const { plane, origin } = sliceAt({ heart: one.heart, scan: one.scan }, kind, number, scene.rows.value);
  scene.cursor.value = onMap(one.polar, ...frame.place(point(plane, origin, right, down)));
}

export function ComparedSlices({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { kind, number } = useWatched(scene.chosen);
  const rows = useWatched(scene.rows);
  const draw = (element: HTMLCanvasElement) =>
    drawSlices(element, compared, scene, {
      width: element.clientWidth,
      height: element.clientHeight,
      ratio: element.width / element.clientWidth,
      marks: true,
    });
  const { canvas } = useCanvas(draw, act => scene.watch(act), compared);
  const press = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    const { clientWidth: width, clientHeight: height } = event.currentTarget;
    const { cell, left, top } = laid(width, height, rows);
    const n = Math.floor((event.offsetX - left) / cell);
    for (const at of KINDS.keys()) {
      if (n < 0 || n >= rows[at]!.count) continue;
      for (const [row, one] of [compared.stress, compared.rest].entries()) {
        const [x, y] = [event.offsetX - left - (n + 0.5) * cell, event.offsetY - top(at, row) - cell / 2];
        if (Math.abs(y) > cell / 2) continue;
        scene.chosen.value = { kind: at, number: n };
        const mm = scene.across.value / cell;
        goTo(scene, one, at, n, x * mm, y * mm);
        return;
      }
    }
  };
  const move = (along: number, over: number) => {
    const next = Math.max(0, Math.min(KINDS.length - 1, kind + over));
    const last = rows[next]!.count - 1;
    scene.chosen.value = { kind: next, number: Math.max(0, Math.min(last, number + along)) };
  };
  return (
    <canvas
      ref={canvas}
      class="compared-slices"
      tabIndex={0}
      role="slider"
      aria-label="Slices of stress above those of rest; arrow keys choose a level"
      aria-valuemin={1}
      aria-valuemax={rows.reduce((sum, row) => sum + row.count, 0)}
      aria-valuenow={rows.slice(0, kind).reduce((sum, row) => sum + row.count, 0) + number + 1}
      aria-valuetext={`${KINDS[kind]!.name}, slice ${number + 1} of ${rows[kind]!.count}`}
      onPointerDown={press}
      onKeyDown={event => {
        const by: Record<string, [number, number]> = {
          ArrowLeft: [-1, 0],
          ArrowRight: [1, 0],
          ArrowUp: [0, -1],
          ArrowDown: [0, 1],
          PageUp: [1, 0],
          PageDown: [-1, 0],
        };
        const step = by[event.key];
        if (!step) return;
        event.preventDefault();
        move(...step);
      }}
    />
  );
}

/** The chosen slice of both scans, large. */
export function LargePair({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const { kind, number } = useWatched(scene.chosen);
  return (
    <div class="pair">
      {[compared.stress, compared.rest].map(one => (
        <Large key={one.scan} one={one} scene={scene} kind={kind} number={number} />
      ))}
    </div>
  );
}

function Large({
  one,
  scene,
  kind,
  number,
}: {
  one: ComparedHeart;
  scene: ComparedScene;
  kind: number;
  number: number;
}) {
  const title = one.scan === "stress" ? "Stress" : "Rest";
  const rows = useWatched(scene.rows);
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    const { clientWidth: width, clientHeight: height } = element;
    if (!context) return;
    const ratio = element.width / width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = GROUND;
    context.fillRect(0, 0, width, height);
    if (!one.heart || !one.region) return;
    const { plane, origin } = sliceAt({ heart: one.heart, scan: one.scan }, kind, number, rows);
    const factor = Math.min(width, height) / scene.across.value;
    paintVoxels(context, lookAt(one, scene, plane, origin), plane, origin, { x: 0, y: 0, width, height }, factor);
    context.save();
    context.translate(width / 2, height / 2);
    if (scene.contours.value)
      contours(
        context,
        [{ name: "wall", colour: "#3dffa8", shown: true, mesh: one.mesh }],
        plane,
        origin,
        factor,
        scene.across.value,
      );
    const place = cursorPlace(one, scene.cursor.value);
    if (place && Math.abs(dot(sub(place, origin), plane.normal)) <= spacingOf(one.heart, kind, rows) / 2) {
      const from = sub(place, origin);
      ring(context, dot(from, plane.right) * factor, dot(from, plane.down) * factor, 6);
    }
    context.restore();
    label(context, `${title}, ${KINDS[kind]!.short} ${number + 1}`, 8, 12, "left", 12);
    if (!one.oriented || !plane.sides) return;
    const [west, east, north, south] = plane.sides;
    label(context, west, 8, height / 2, "left", 11);
    label(context, east, width - 8, height / 2, "right", 11);
    label(context, north, width / 2, 11, "center", 11);
    label(context, south, width / 2, height - 11, "center", 11);
  };
  const { canvas } = useCanvas(draw, act => scene.watch(act), one);
  return (
    <figure class="slice">
      <canvas
        ref={canvas}
        role="img"
        aria-label={`${title}: ${KINDS[kind]!.name}, slice ${number + 1} of ${rows[kind]!.count}`}
        onPointerDown={event => {
          const { clientWidth: width, clientHeight: height } = event.currentTarget;
          const factor = Math.min(width, height) / scene.across.value;
          goTo(scene, one, kind, number, (event.offsetX - width / 2) / factor, (event.offsetY - height / 2) / factor);
        }}
      />
    </figure>
  );
}
