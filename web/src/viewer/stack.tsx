// One axis of the heart as a row of small slices, such as the short axis from apex to base; a click takes the cursor there.

import { useCanvas } from "./canvas";
import { type SliceStyle, contours, label, paint } from "./drawing";
import { type Plane, frameOf } from "./plane";
import type { Scene } from "./scene";
import { type Vec, add, dot, scale, sub } from "./vector";

interface Props {
  scene: Scene;
  plane: Plane;
}

/** Half of the way across the heart that rows of long-axis slices show, as a share of its length. */
const LONG_ENDS_SHARE = 0.4;

/** Places in the middle of as many slices as fit: of the short axis from the apex on. */
function places(scene: Scene, plane: Plane, width: number, height: number): Vec[] {
  const heart = scene.heart.value;
  if (!heart) return [];
  const { axis, length, middle } = frameOf(heart);
  const count = Math.max(4, Math.min(14, Math.round(width / height)));
  const isShort = plane.short === "SA";
  return Array.from({ length: count }, (_, n) => {
    const share = n / (count - 1);
    return isShort
      ? add(heart.apex, scale(axis, -length * (0.04 + 0.98 * share)))
      : add(middle, scale(plane.normal, length * LONG_ENDS_SHARE * (2 * share - 1)));
  });
}

/** What lies before the first slice of a row, and beyond the last one; nothing where the sides are unknown. */
function endsOf({ short, sides }: Plane): [string, string] {
  if (short === "SA") return ["Apex", "Base"];
  if (!sides) return ["", ""];
  return short === "HLA" ? ["Inf", "Ant"] : ["Sept", "Lat"];
}

export function Stack({ scene, plane }: Props) {
  const draw = (element: HTMLCanvasElement) => {
    const [width, height] = [element.clientWidth, element.clientHeight];
    const count = drawStack(element, scene, plane, { width, height, ratio: element.width / width, cursor: true });
    element.setAttribute("aria-valuemin", "1");
    element.setAttribute("aria-valuemax", String(count));
    element.setAttribute("aria-valuenow", String(nearest(scene, places(scene, plane, width, height), plane) + 1));
  };
  const { canvas } = useCanvas(draw, act => scene.watch(act), scene);
  const go = (by: number) => {
    const element = canvas.current;
    if (!element) return;
    const all = places(scene, plane, element.clientWidth, element.clientHeight);
    const now = nearest(scene, all, plane);
    const to = all[Math.max(0, Math.min(all.length - 1, now + by))];
    if (to) moveTo(scene, to, plane);
  };
  return (
    <canvas
      ref={canvas}
      class="stack"
      tabIndex={0}
      role="slider"
      aria-label={`Slices of the ${plane.name.toLowerCase()}`}
      aria-valuenow={0}
      onClick={event => {
        const element = event.currentTarget;
        const all = places(scene, plane, element.clientWidth, element.clientHeight);
        const to = all[Math.floor((event.offsetX / element.clientWidth) * all.length)];
        if (to) moveTo(scene, to, plane);
      }}
      onKeyDown={event => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (!by) return;
        event.preventDefault();
        go(by);
      }}
    />
  );
}

function moveTo(scene: Scene, to: Vec, plane: Plane): void {
  const way = dot(sub(to, scene.cursor.value), plane.normal);
  scene.cursor.value = add(scene.cursor.value, scale(plane.normal, way));
}

function nearest(scene: Scene, all: Vec[], plane: Plane): number {
  const distance = (place: Vec) => Math.abs(dot(sub(place, scene.cursor.value), plane.normal));
  return all.reduce((best, place, n) => (distance(place) < distance(all[best]!) ? n : best), 0);
}

/** Draws the row of slices; the answer is their number. */
export function drawStack(
  element: HTMLCanvasElement,
  scene: Scene,
  plane: Plane,
  { width, height, ratio, cursor }: Omit<SliceStyle, "letters">,
): number {
  const context = element.getContext("2d");
  const all = places(scene, plane, width, height);
  if (!context || all.length === 0) return 0;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = "#0a0e11";
  context.fillRect(0, 0, width, height);
  const cell = width / all.length;
  const size = Math.min(cell - 2, height);
  const factor = size / 110;
  const now = cursor ? nearest(scene, all, plane) : -1;
  all.forEach((origin, n) => {
    const box = { x: n * cell + 1, y: 0, width: cell - 2, height };
    context.save();
    context.beginPath();
    context.rect(box.x, box.y, box.width, box.height);
    context.clip();
    paint(context, scene, plane, origin, box, factor);
    context.translate(box.x + box.width / 2, height / 2);
    contours(context, scene.layersNow, plane, origin, factor, 70);
    context.restore();
    if (n === now) {
      context.strokeStyle = "#4de3ff";
      context.lineWidth = 2;
      context.strokeRect(box.x + 1, 1, box.width - 2, height - 2);
    }
  });
  const [first, last] = endsOf(plane);
  label(context, first, 6, 10, "left", 11);
  label(context, last, width - 6, 10, "right", 11);
  return all.length;
}
