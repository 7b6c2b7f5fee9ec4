// The wall of a compared heart in three dimensions with the letters that readers know: its sides, and the territories
// of the arteries. Both hearts are seen from the same side of the heart, wherever they lie in the scanner.

import { useEffect, useRef, useState } from "preact/hooks";
import { type Camera, type MeshPainter, boundsOf, project, turn, usualCamera } from "./camera";
import { useCanvas } from "./canvas";
import type { ComparedHeart } from "./compared";
import { type ComparedScene, FROM_FRONT } from "./comparedscene";
import { label } from "./drawing";
import { handleEvents } from "./events";
import { FlatView } from "./flatview";
import { MeshView } from "./glview";
import { type Frame, frameOf } from "./plane";
import { middleOfSegment } from "./polar";
import { wallFrameOf } from "./compared";
import { type Vec, add, dot, scale, sub } from "./vector";

/** The side of the picture by the diameter of the sphere that holds the wall: letters stand beside it. */
const MARGIN = 1.22;
/** A segment in the middle of each artery's territory. */
const TERRITORIES = [
  ["LAD", 7],
  ["LCX", 12],
  ["RCA", 10],
] as const;

/** The cosine of the angle to the eye from which a side counts as the far one. */
const FAR_SIDE = -0.35;

interface Letter {
  text: string;
  place: Vec;
  /** The direction out of the wall there. */
  outward: Vec;
  size: number;
}

/** The letters of a heart whose sides are known. */
function lettersOf(one: ComparedHeart): Letter[] {
  const frame = wallFrameOf(one);
  if (!one.heart || !one.oriented || !frame || !one.polar) return [];
  const { axis, anterior, lateral } = frameOf(one.heart);
  const base = frame.base;
  const widest = Math.max(
    ...one.mesh.vertices.map(vertex => {
      const from = sub(vertex, base);
      return Math.hypot(...sub(from, scale(axis, dot(from, axis))));
    }),
  );
  const sides: [string, Vec][] = [
    ["A", anterior],
    ["S", scale(lateral, -1)],
    ["L", lateral],
    ["I", scale(anterior, -1)],
  ];
  const letters = sides.map(
    ([text, side]): Letter => ({ text, place: add(base, scale(side, widest + 7)), outward: side, size: 14 }),
  );
  for (const [text, segment] of TERRITORIES) {
    const [rows, columns] = middleOfSegment(one.polar, segment);
    const place = frame.at(rows, columns);
    const angle = (columns / one.polar.columns) * 2 * Math.PI;
    const outward = add(scale(lateral, Math.cos(angle)), scale(anterior, Math.sin(angle)));
    letters.push({ text, place: add(place, scale(outward, 6)), outward, size: 11 });
  }
  return letters;
}

/** The camera in the patient for what is seen in directions of the heart. */
export function cameraOf({ mesh, heart }: ComparedHeart, seen: { toward: Vec; up: Vec }): Camera {
  const { middle: target, reach } = boundsOf(mesh);
  const span = 2 * reach * MARGIN;
  if (!heart) return { ...usualCamera(), target, span };
  const frame: Frame = frameOf(heart);
  const inPatient = ([x, y, z]: Vec): Vec =>
    add(add(scale(frame.lateral, x), scale(frame.anterior, y)), scale(frame.axis, z));
  return { toward: inPatient(seen.toward), up: inPatient(seen.up), target, span };
}

/** Writes the letters over a drawn wall; those of the far side are hidden with it. */
function write(
  context: CanvasRenderingContext2D,
  one: ComparedHeart,
  camera: Camera,
  width: number,
  height: number,
): void {
  for (const { text, place, outward, size } of lettersOf(one)) {
    const facing = dot(outward, camera.toward);
    // A territory's name lies on the wall, a side's letter beside it.
    if (facing < (size < 14 ? 0.1 : FAR_SIDE)) continue;
    const [x, y] = project(camera, place, width / height);
    label(context, text, x * width, y * height, "center", size);
  }
}

/** Draws wall and letters on paper. */
export function drawWall(
  element: HTMLCanvasElement,
  one: ComparedHeart,
  colours: Float32Array,
  seen: { toward: Vec; up: Vec },
  size: number,
  ratio: number,
): void {
  const view = new FlatView(element, "#0a0e11");
  view.camera = cameraOf(one, seen);
  view.setSurface("wall", one.mesh, colours);
  view.draw();
  const context = element.getContext("2d");
  if (!context) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  write(context, one, view.camera, size, size);
}

interface Props {
  one: ComparedHeart;
  scene: ComparedScene;
  colours: Float32Array;
  title: string;
}

export function HeartWall({ one, scene, colours, title }: Props) {
  const view = useRef<MeshPainter | null>(null);
  const over = useRef<HTMLCanvasElement>(null);
  // Whether the browser has no WebGL, or lost it.
  const [plain, setPlain] = useState(false);
  const draw = (element: HTMLCanvasElement) => {
    const made = view.current;
    const letters = over.current;
    if (!made || !letters) return;
    made.camera = cameraOf(one, scene.seen.value);
    made.draw();
    if (letters.width !== element.width || letters.height !== element.height)
      Object.assign(letters, { width: element.width, height: element.height });
    const context = letters.getContext("2d");
    if (!context) return;
    const ratio = element.width / element.clientWidth;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, letters.width, letters.height);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    write(context, one, made.camera, element.clientWidth, element.clientHeight);
  };
  const { canvas, ask } = useCanvas(draw, act => scene.seen.watch(act), plain);
  useEffect(() => {
    const element = canvas.current;
    if (!element) return;
    try {
      view.current = plain ? new FlatView(element, "#0a0e11") : new MeshView(element);
    } catch {
      setPlain(true);
      return;
    }
    const by = (dx: number, dy: number) => {
      const camera: Camera = { ...usualCamera(), ...scene.seen.value };
      turn(camera, dx, dy);
      scene.seen.value = { toward: camera.toward, up: camera.up };
    };
    let before: PointerEvent | null = null;
    const end = handleEvents(element, {
      pointerdown: event => {
        element.setPointerCapture(event.pointerId);
        element.focus({ preventScroll: true });
        before = event;
      },
      pointermove: event => {
        if (!before || before.pointerId !== event.pointerId) return;
        by(event.clientX - before.clientX, event.clientY - before.clientY);
        before = event;
      },
      pointerup: () => (before = null),
      pointercancel: () => (before = null),
      dblclick: () => (scene.seen.value = FROM_FRONT),
      keydown: event => {
        const ways: Record<string, [number, number]> = {
          ArrowLeft: [-12, 0],
          ArrowRight: [12, 0],
          ArrowUp: [0, -12],
          ArrowDown: [0, 12],
        };
        const way = ways[event.key];
        if (!way) return;
        event.preventDefault();
        by(...way);
      },
      webglcontextlost: () => setPlain(true),
    });
    return () => {
      end();
      view.current?.end();
      view.current = null;
    };
  }, [scene, plain]);
  useEffect(() => {
    view.current?.setSurface("wall", one.mesh, colours);
    ask();
  }, [one, colours, plain]);
  return (
    <figure class="wall heart-wall">
      <canvas
        key={plain}
        ref={canvas}
        tabIndex={0}
        role="slider"
        aria-label={`The wall in three dimensions, ${title}; arrow keys turn both`}
        aria-valuenow={0}
        aria-valuetext="turned with the other"
      />
      <canvas ref={over} class="letters" aria-hidden="true" />
      <p class="tag">{title}</p>
    </figure>
  );
}
