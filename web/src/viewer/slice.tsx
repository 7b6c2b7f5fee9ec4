// One slice: picture, contours, letters, scale bar and cursor on a canvas, moved by mouse, touch and keys.

import { useEffect, useRef } from "preact/hooks";
import { useCanvas } from "./canvas";
import { type SliceStyle, drawSlice, rollKnob, sliceOrigin } from "./drawing";
import { handleEvents } from "./events";
import { type Plane, letters, point } from "./plane";
import { counts } from "../words";
import type { Scene } from "./scene";
import { type Vec, add, dot, norm, scale, sub, unit } from "./vector";

interface Props {
  scene: Scene;
  plane: Plane;
  onBig?: () => void;
}

type Handle = "base" | "apex" | "center" | "roll";

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

function listen(element: HTMLCanvasElement, scene: Scene, plane: () => Plane): () => void {
  const pointers = new Map<number, PointerEvent>();
  let handle: Handle | null = null;
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
    handle = scene.tool.value === "correct" ? handleAt(scene, plane(), placeAt(event), 14 / factor()) : null;
    if (!handle && kind(event) === "cursor") scene.cursor.value = placeAt(event);
  };
  const kind = (event: PointerEvent) => {
    if (event.buttons === 2 || event.shiftKey) return "window";
    if (event.buttons === 4) return "move";
    return scene.tool.value === "correct" ? "cursor" : scene.tool.value;
  };
  const move = (event: PointerEvent) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        const span = (e: PointerEvent) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY) || 1;
        zoom(span(before) / span(event));
        pan(dx / 2, dy / 2);
      }
    } else if (handle) drag(scene, plane(), handle, placeAt(event));
    else if (kind(event) === "window") window_(dx, dy);
    else if (kind(event) === "move") pan(dx, dy);
    else scene.cursor.value = placeAt(event);
    pointers.set(event.pointerId, event);
  };
  const up = (event: PointerEvent) => {
    pointers.delete(event.pointerId);
    if (handle) scene.edit.value = scene.edit.value && { ...scene.edit.value };
    handle = null;
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

/** The handle of the correction near a place, as seen in this plane. */
function handleAt(scene: Scene, plane: Plane, place: Vec, reach: number): Handle | null {
  const edit = scene.edit.value;
  if (!edit) return null;
  const flat = (v: Vec) => Math.hypot(dot(sub(v, place), plane.right), dot(sub(v, place), plane.down));
  const candidates: [Handle, Vec][] = [
    ["apex", edit.apex],
    ["base", edit.base],
    ["center", edit.center],
  ];
  const knob = rollKnob(scene, plane);
  if (knob) candidates.unshift(["roll", knob]);
  const near = candidates
    .map(([name, at]): [Handle, number] => [name, flat(at)])
    .filter(([, distance]) => distance < reach);
  return near.sort((a, b) => a[1] - b[1])[0]?.[0] ?? null;
}

/** The cosine of the angle at which an axis counts as another one: 3 degrees. */
const TILTED = 0.9986;

function drag(scene: Scene, plane: Plane, handle: Handle, place: Vec): void {
  const edit = scene.edit.value;
  if (!edit) return;
  const inPlane = (from: Vec) => {
    const way = sub(place, from);
    return add(from, add(scale(plane.right, dot(way, plane.right)), scale(plane.down, dot(way, plane.down))));
  };
  const next = { ...edit, changed: new Set(edit.changed) };
  if (handle === "center") {
    const to = inPlane(edit.center);
    const way = sub(to, edit.center);
    Object.assign(next, { center: to, base: add(edit.base, way), apex: add(edit.apex, way) });
    next.changed.add("center");
  } else if (handle === "roll") {
    const axis = unit(sub(edit.apex, edit.base));
    const way = sub(inPlane(edit.center), edit.center);
    const top = scale(plane.down, -1);
    const side = [
      axis[1] * top[2] - axis[2] * top[1],
      axis[2] * top[0] - axis[0] * top[2],
      axis[0] * top[1] - axis[1] * top[0],
    ] as Vec;
    next.roll = Math.round((Math.atan2(dot(way, side), dot(way, top)) * 180) / Math.PI);
    next.changed.add("roll");
  } else {
    const to = inPlane(edit[handle]);
    const other = handle === "apex" ? edit.base : edit.apex;
    if (norm(sub(to, other)) < 20) return;
    next[handle] = to;
    const [base, apex] = handle === "apex" ? [other, to] : [to, other];
    if (handle === "base") next.changed.add("base");
    // Along the axis, the base is only put elsewhere; aside, the axis is tilted with it.
    if (handle === "apex" || dot(unit(sub(apex, base)), unit(sub(edit.apex, edit.base))) < TILTED) {
      next.center = [0, 1, 2].map(n => base[n]! + 0.45 * (apex[n]! - base[n]!)) as unknown as Vec;
      next.changed.add("axis").add("center");
    }
  }
  scene.edit.value = next;
}
