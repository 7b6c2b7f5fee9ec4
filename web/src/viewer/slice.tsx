// One slice: picture, contours, letters, scale bar and cursor on a canvas, moved by mouse, touch and keys.

import { useEffect, useRef } from "preact/hooks";
import { useCanvas } from "./canvas";
import { type SliceStyle, drawSlice, sliceOrigin } from "./drawing";
import { handleEvents } from "./events";
import { type Held, draggedTo, heldAt, isOnlyPressed } from "./handles";
import { type Plane, letters, point } from "./plane";
import { counts } from "../words";
import { NEAR_SLICE } from "./pulls";
import type { Scene } from "./scene";
import { type Vec, add, dot, scale } from "./vector";

interface Props {
  scene: Scene;
  plane: Plane;
  onBig?: () => void;
}

export function Slice({ scene, plane, onBig }: Props) {
  const latest = useRef(plane);
  latest.current = plane;
  const draw = (element: HTMLCanvasElement) => {
    drawSlice(element, scene, plane, style(element));
    describe(element, scene, plane);
  };
  const { canvas } = useCanvas(draw, act => scene.watch(act), scene);
  useEffect(() => (canvas.current ? listen(canvas.current, scene, () => latest.current) : undefined), [scene]);
  return (
    <figure class="slice">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="slider"
        aria-label={`${plane.name} slice`}
        aria-valuenow={0}
        onDblClick={onBig}
      />
    </figure>
  );
}

function style(element: HTMLCanvasElement): SliceStyle {
  return {
    width: element.clientWidth,
    height: element.clientHeight,
    ratio: element.width / Math.max(1, element.clientWidth),
    letters: true,
    cursor: true,
  };
}

function describe(element: HTMLCanvasElement, scene: Scene, plane: Plane): void {
  const [low, high] = scene.voxels.extent(plane.normal);
  const now = dot(scene.cursor.value, plane.normal);
  const value = scene.voxels.at(scene.cursor.value);
  const set = (name: string, text: string) => element.setAttribute(name, text);
  set("aria-valuemin", low.toFixed(0));
  set("aria-valuemax", high.toFixed(0));
  set("aria-valuenow", now.toFixed(0));
  set(
    "aria-valuetext",
    `${now.toFixed(0)} mm towards ${letters(plane.normal)}, value ${Number.isNaN(value) ? "none" : counts(value)}`,
  );
}

const STEP_OF_WHEEL = 40;

/** CSS pixels from a handle within which a press takes it, and from the contour: of a finger as from a handle. */
const [HANDLE_REACH, CONTOUR_REACH] = [14, 6];

function listen(element: HTMLCanvasElement, scene: Scene, plane: () => Plane): () => void {
  const pointers = new Map<number, PointerEvent>();
  let held: Held | null = null;
  let rest = 0;

  /** The place under a position on the screen. */
  const placeAt = (event: { clientX: number; clientY: number }): Vec => {
    const box = element.getBoundingClientRect();
    const { origin, scale: factor } = sliceOrigin(scene, plane(), box.width, box.height);
    return point(
      plane(),
      origin,
      (event.clientX - box.left - box.width / 2) / factor,
      (event.clientY - box.top - box.height / 2) / factor,
    );
  };
  const factor = () => {
    const box = element.getBoundingClientRect();
    return sliceOrigin(scene, plane(), box.width, box.height).scale;
  };
  const scroll = (steps: number) => {
    const next = add(scene.cursor.value, scale(plane().normal, steps * Math.max(1, scene.voxels.spacing)));
    const [low, high] = scene.voxels.extent(plane().normal);
    const along = dot(next, plane().normal);
    if (along >= low && along <= high) scene.cursor.value = next;
  };
  const zoom = (by: number) => {
    const { width, middle } = scene.view.value;
    scene.view.value = { width: Math.max(20, Math.min(800, width * by)), middle };
  };
  const pan = (dx: number, dy: number) => {
    const { width } = scene.view.value;
    const by = add(scale(plane().right, -dx / factor()), scale(plane().down, -dy / factor()));
    scene.view.value = { width, middle: add(scene.middle, by) };
  };
  const window_ = (dx: number, dy: number) => {
    const { low, high } = scene.window.value;
    const range = scene.still.highest - scene.still.lowest || 1;
    const width = Math.max(range / 500, high - low + (dx / 300) * range);
    const middle = (low + high) / 2 + (dy / 300) * range;
    scene.window.value = { low: middle - width / 2, high: middle + width / 2 };
  };

  const down = (event: PointerEvent) => {
    element.focus({ preventScroll: true });
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
    if (pointers.size > 1) return;
    held = heldBy(event);
    if (held) element.style.cursor = "grabbing";
    if (!held && kind(event) === "cursor") scene.cursor.value = placeAt(event);
  };
  /** What of a correction a press would take. */
  const heldBy = (event: PointerEvent): Held | null => {
    const edit = scene.edit.value;
    if (!edit || scene.tool.value !== "correct") return null;
    return heldAt(edit, plane(), placeAt(event), {
      handle: HANDLE_REACH / factor(),
      contour: (event.pointerType === "touch" ? HANDLE_REACH : CONTOUR_REACH) / factor(),
      near: NEAR_SLICE,
      knows: scene.heart.value !== null,
      outlined: scene.layers.value.some(layer => layer.shown && layer.mesh === edit.wall?.mesh),
    });
  };
  const kind = (event: PointerEvent) => {
    if (event.buttons === 2 || event.shiftKey) return "window";
    if (event.buttons === 4) return "move";
    return scene.tool.value === "correct" ? "cursor" : scene.tool.value;
  };
  const move = (event: PointerEvent) => {
    const before = pointers.get(event.pointerId);
    if (!before) {
      element.style.cursor = heldBy(event) ? "grab" : "";
      return;
    }
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        const span = (e: PointerEvent) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY) || 1;
        zoom(span(before) / span(event));
        pan(dx / 2, dy / 2);
      }
    } else if (held) scene.edit.value = scene.edit.value && draggedTo(scene.edit.value, plane(), held, placeAt(event));
    else if (kind(event) === "window") window_(dx, dy);
    else if (kind(event) === "move") pan(dx, dy);
    else scene.cursor.value = placeAt(event);
    pointers.set(event.pointerId, event);
  };
  const up = (event: PointerEvent) => {
    pointers.delete(event.pointerId);
    const edit = scene.edit.value;
    if (held && edit && isOnlyPressed(held, edit)) scene.cursor.value = placeAt(event);
    else if (held) scene.edit.value = edit && { ...edit };
    held = null;
    element.style.cursor = "";
  };
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    if (event.ctrlKey || event.metaKey) return zoom(Math.exp(event.deltaY / 300));
    rest += event.deltaY * (event.deltaMode === 1 ? 20 : 1);
    const steps = Math.trunc(rest / STEP_OF_WHEEL);
    rest -= steps * STEP_OF_WHEEL;
    if (steps) scroll(-steps);
  };
  const press = (event: KeyboardEvent) => {
    const size = event.shiftKey ? 5 : 1;
    const shift = (way: Vec, by: number) =>
      (scene.cursor.value = add(scene.cursor.value, scale(way, by * Math.max(1, scene.voxels.spacing))));
    const keys: Record<string, () => void> = {
      ArrowLeft: () => shift(plane().right, -size),
      ArrowRight: () => shift(plane().right, size),
      ArrowUp: () => shift(plane().down, -size),
      ArrowDown: () => shift(plane().down, size),
      PageUp: () => scroll(size),
      PageDown: () => scroll(-size),
      Home: () => (scene.cursor.value = scene.middle),
      "+": () => zoom(1 / 1.15),
      "=": () => zoom(1 / 1.15),
      "-": () => zoom(1.15),
      "[": () => window_(0, -10),
      "]": () => window_(0, 10),
      "0": () => (scene.view.value = { ...scene.view.value, middle: null }),
    };
    const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  };
  const quiet = (event: Event) => event.preventDefault();
  return handleEvents(element, {
    pointerdown: down,
    pointermove: move,
    pointerup: up,
    pointercancel: up,
    wheel,
    keydown: press,
    contextmenu: quiet,
  });
}
