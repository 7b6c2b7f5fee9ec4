// The wall in three dimensions with a colour for what the files offer, and its colour bar.

import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Watched, useWatched } from "../state";
import { type Camera, type MeshPainter, boundsOf, project, turn, usualCamera } from "./camera";
import { useCanvas } from "./canvas";
import { DIVERGING, LUTS, type Lut, css, keep } from "./colours";
import { handleEvents } from "./events";
import { FlatView } from "./flatview";
import { MeshView } from "./glview";
import { type Mesh, apart, between, thickness, triangleShape } from "./mesh";
import { type Axis, frameOf, letters } from "./plane";
import type { PolarFigure, PolarMap } from "../generated/openapi";
import { type DrawnMap, FIGURES, WallFrame, colourOn, figureLut, figureMap, uptakeMap, valueAt } from "./polar";
import type { Scene } from "./scene";
import { type Vec, add, dot, scale, sub, unit } from "./vector";
import type { Voxels } from "./volume";

interface Paint {
  name: string;
  unit: string;
  lut: Lut;
  range: [number, number];
  /** The colour of values below the range; without it, the first colour. */
  below?: [number, number, number] | null;
  values: () => Float32Array;
}

interface Props {
  scene: Scene;
  mesh: Mesh;
  /** The same wall by the other edge, or what the result is compared with. */
  inner: Mesh | null;
  other: Mesh | null;
  polar: PolarMap | null;
  displacement: number[] | null;
  /** Distance of a model to the surface it was made of, at every vertex, mm. */
  surface: Float32Array | null;
  /** The wall in every gate of a beat, and figures of it. */
  gates: Mesh[] | null;
  figures: PolarFigure[];
  /** What is written over it, where there are two. */
  title?: string;
  /** Whether another wall says from where both are seen. */
  follows?: boolean;
}

/** The largest value within a wall's depth behind every vertex. */
export function uptake(voxels: Voxels, mesh: Mesh): Float32Array {
  const out = Float32Array.from(mesh.vertices, (vertex, at) => {
    let most = 0;
    for (let depth = 0; depth <= 12; depth += 1.5) {
      const value = voxels.at(sub(vertex, scale(mesh.normals[at]!, depth)));
      if (value > most) most = value;
    }
    return most;
  });
  return out;
}

function percent(values: Float32Array): Float32Array {
  const hottest = Math.max(...values) || 1;
  return values.map(value => (100 * value) / hottest);
}

/** The value of a map at every vertex. */
export function byMap(mesh: Mesh, map: DrawnMap, heart: Axis): Float32Array {
  const frame = new WallFrame(mesh, heart, map.rows, map.columns);
  return Float32Array.from(mesh.vertices, vertex => valueAt(map, ...frame.place(vertex)));
}

/** The uptake at every vertex, per cent: of the polar map, or else of the voxels under it. */
export function uptakeOf(
  scene: Scene,
  { mesh, polar, heart }: { mesh: Mesh; polar: PolarMap | null; heart: Axis | null },
): Float32Array {
  return polar && heart ? byMap(mesh, uptakeMap(polar), heart) : percent(uptake(scene.voxels, mesh));
}

function paints(
  { scene, mesh, inner, other, polar, displacement, surface, figures }: Props,
  lut: Lut,
  heart: Axis | null,
): Paint[] {
  const list: Paint[] = [];
  const viridis = LUTS["Viridis"]!;
  const seen = polar && heart ? true : scene.voxels.highest > scene.voxels.lowest;
  if (seen)
    list.push({
      name: "Uptake",
      unit: "%",
      lut,
      range: [0, 100],
      values: () => uptakeOf(scene, { mesh, polar, heart }),
    });
  if (heart) {
    for (const { figure, drawn } of figures.map(map => ({ figure: map.figure, drawn: figureMap(map) })))
      list.push({
        name: FIGURES[figure].name,
        unit: drawn.unit,
        lut: figureLut(figure),
        range: drawn.range,
        below: drawn.below,
        values: () => byMap(mesh, drawn, heart),
      });
  }
  if (surface)
    list.push({ name: "Distance to the surface", unit: "mm", lut: DIVERGING, range: [-2, 2], values: () => surface });
  list.push({ name: "Thickness", unit: "mm", lut: viridis, range: [4, 20], values: () => thickness(mesh) });
  if (inner)
    list.push({
      name: "Distance between the two walls",
      unit: "mm",
      lut: DIVERGING,
      range: [-6, 6],
      values: () => apart(mesh, inner),
    });
  if (other)
    list.push({
      name: "Distance to the compared wall",
      unit: "mm",
      lut: DIVERGING,
      range: [-8, 8],
      values: () => apart(mesh, other),
    });
  if (displacement?.length === mesh.vertices.length)
    list.push({
      name: "Moved by the fit",
      unit: "mm",
      lut: viridis,
      range: [0, 12],
      values: () => Float32Array.from(displacement),
    });
  const sigma = mesh.uncertainty_mm;
  if (sigma?.length === mesh.vertices.length)
    list.push({
      name: "Uncertainty (1 σ)",
      unit: "mm",
      lut: viridis,
      range: [0, 6],
      values: () => Float32Array.from(sigma),
    });
  list.push({
    name: "Triangle shape (2r/R)",
    unit: "",
    lut: viridis,
    range: [0.4, 1],
    values: () => triangleShape(mesh),
  });
  return list;
}

/** The colours of vertices with these values; grey where there is none. */
export function coloursOf(
  values: Float32Array,
  { lut, range, below = null }: Pick<Paint, "lut" | "range" | "below">,
): Float32Array {
  const colours = new Float32Array(3 * values.length);
  values.forEach((value, at) => {
    const rgb = colourOn({ range, below }, lut, value);
    colours.set(
      rgb.map(part => part / 255),
      3 * at,
    );
  });
  return colours;
}

/** The side of the picture by the diameter of the sphere that holds the wall. */
const MARGIN = 1.05;

/** A view of the anterior and lateral wall, apex down; without a known heart, from in front of the patient. */
export function wallCamera(mesh: Mesh, heart: Axis | null): Camera {
  const { middle: target, reach } = boundsOf(mesh);
  const span = 2 * reach * MARGIN;
  if (!heart) return { ...usualCamera(), target, span };
  const { anterior, lateral, axis } = frameOf(heart);
  const toward = unit(add(add(scale(lateral, 0.65), scale(anterior, 0.55)), scale(axis, 0.52)));
  return { toward, up: unit(sub(scale(toward, dot(axis, toward)), axis)), target, span };
}

export function Wall(props: Props) {
  const { scene, mesh, other, title, follows, gates } = props;
  const view = useRef<MeshPainter | null>(null);
  // Whether the browser has no WebGL, or lost it.
  const [plain, setPlain] = useState(false);
  const [chosen, setChosen] = useState("Uptake");
  const [edges, setEdges] = useState(false);
  const lut = useWatched(scene.wallLut);
  const heart = useWatched(scene.heart);
  const list = paints(props, lut, heart);
  const paint = list.find(one => one.name === chosen) ?? list[0]!;
  const values = useMemo(() => paint.values(), [mesh, paint.name, props.polar, props.other, props.inner, heart]);

  const colours = useMemo(() => coloursOf(values, paint), [values, paint.lut]);
  const put = (made: MeshPainter) => {
    const now = (plain ? scene.gate : scene.moment).value;
    const moved = gates && now !== null ? between(gates, now) : mesh;
    made.setSurface("wall", moved, colours);
    if (edges) made.setWire("edges", moved, [0.05, 0.07, 0.09]);
    else made.remove("edges");
  };

  const draw = (element: HTMLCanvasElement) => {
    const made = view.current;
    if (!made) return;
    if (gates) put(made);
    if (scene.camera) made.camera = scene.camera;
    made.setPoint("cursor", scene.cursor.value, [0.3, 0.89, 1]);
    made.draw();
    element.setAttribute("aria-valuetext", `seen from ${letters(made.camera.toward)}`);
  };
  const watch = (act: () => void) => {
    const ends = [scene.cursor.watch(act), scene.turned.watch(act), (plain ? scene.gate : scene.moment).watch(act)];
    return () => ends.forEach(end => end());
  };
  const { canvas, ask } = useCanvas(draw, watch, plain);
  useEffect(() => {
    const element = canvas.current;
    if (!element) return;
    try {
      view.current = plain ? new FlatView(element) : new MeshView(element);
    } catch {
      setPlain(true);
      return;
    }
    const made = view.current;
    const end = listen(
      element,
      made,
      () => (scene.turned.value += 1),
      scene,
      () => setPlain(true),
    );
    return () => {
      end();
      made.end();
      view.current = null;
    };
  }, [scene, plain]);

  // The camera starts where the anterior and lateral wall are seen, apex down to the left as in the patient.
  useEffect(() => {
    if (follows) return;
    scene.camera = wallCamera(mesh, heart);
    scene.turned.value += 1;
  }, [scene, mesh, plain, heart === null, follows]);

  useEffect(() => {
    const made = view.current;
    if (!made) return;
    put(made);
    if (other) made.setWire("other", other, [0.78, 0.55, 1]);
    else made.remove("other");
    ask();
  }, [scene, mesh, gates, colours, other, edges, plain]);

  const [low, high] = paint.range;
  return (
    <figure class="wall">
      <canvas
        key={plain}
        ref={canvas}
        tabIndex={0}
        role="slider"
        aria-label={`The wall in three dimensions${title ? `, ${title}` : ""}; arrow keys turn it`}
        aria-valuenow={0}
      />
      {title && <p class="tag">{title}</p>}
      {plain && <p class="off">This browser has no WebGL: the wall is drawn in a simple way and turns more slowly.</p>}
      <figcaption>
        <select
          aria-label="Colour of the wall"
          value={paint.name}
          onChange={event => setChosen(event.currentTarget.value)}>
          {list.map(one => (
            <option key={one.name}>{one.name}</option>
          ))}
        </select>
        <label class="inline">
          <input type="checkbox" checked={edges} onChange={event => setEdges(event.currentTarget.checked)} /> edges
        </label>
        <ColourBar lut={paint.lut} low={`${low}`} high={`${high}${paint.unit && ` ${paint.unit}`}`} />
      </figcaption>
    </figure>
  );
}

export function ColourBar({ lut, low, high }: { lut: Lut; low: string; high: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  // Before the next frame, as paper has none.
  useLayoutEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    for (let n = 0; n < 128; n++) {
      context.fillStyle = css(lut, n / 127);
      context.fillRect(n, 0, 1, 8);
    }
  }, [lut]);
  return (
    <span class="bar">
      <span>{low}</span>
      <canvas ref={canvas} width={128} height={8} aria-hidden="true" />
      <span>{high}</span>
    </span>
  );
}

function listen(
  element: HTMLCanvasElement,
  view: MeshPainter,
  draw: () => void,
  scene: Scene,
  lost: () => void,
): () => void {
  const pointers = new Map<number, PointerEvent>();
  let moved = 0;
  const down = (event: PointerEvent) => {
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    pointers.set(event.pointerId, event);
    moved = 0;
  };
  const zoom = (by: number) => {
    view.camera.span = Math.max(30, Math.min(500, view.camera.span * by));
    draw();
  };
  const move = (event: PointerEvent) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    moved += Math.abs(dx) + Math.abs(dy);
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const span = (e: PointerEvent) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY) || 1;
      zoom(span(before) / span(event));
    } else {
      turn(view.camera, dx, dy);
      draw();
    }
    pointers.set(event.pointerId, event);
  };
  const up = (event: PointerEvent) => {
    pointers.delete(event.pointerId);
    if (event.type === "pointerup" && moved < 4) pick(event);
  };
  // A click takes the cursor to the wall's nearest vertex in front.
  const pick = (event: PointerEvent) => {
    const box = element.getBoundingClientRect();
    const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    let [best, depth]: [Vec | null, number] = [null, -Infinity];
    for (const layer of scene.layersNow) {
      for (const vertex of layer.mesh?.vertices ?? []) {
        const [u, v] = project(view.camera, vertex, box.width / box.height);
        if (Math.hypot((u - x) * box.width, (v - y) * box.height) > 16) continue;
        const toward = dot(vertex, view.camera.toward);
        if (toward > depth) [best, depth] = [vertex, toward];
      }
    }
    if (best) scene.cursor.value = best;
  };
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY / 500));
  };
  const press = (event: KeyboardEvent) => {
    const ways: Record<string, [number, number]> = {
      ArrowLeft: [-12, 0],
      ArrowRight: [12, 0],
      ArrowUp: [0, -12],
      ArrowDown: [0, 12],
    };
    const by = ways[event.key];
    if (by) turn(view.camera, ...by);
    else if (event.key === "+" || event.key === "=") zoom(1 / 1.15);
    else if (event.key === "-") zoom(1.15);
    else return;
    event.preventDefault();
    draw();
  };
  return handleEvents(element, {
    pointerdown: down,
    pointermove: move,
    pointerup: up,
    pointercancel: up,
    wheel,
    keydown: press,
    webglcontextlost: lost,
  });
}

/** The choice of colours; it is kept under `keptAs`. */
export function LutChoice({ label, lut: watched, keptAs }: { label: string; lut: Watched<Lut>; keptAs: string }) {
  const lut = useWatched(watched);
  return (
    <select
      aria-label={label}
      value={Object.keys(LUTS).find(name => LUTS[name] === lut)}
      onChange={event => {
        watched.value = LUTS[event.currentTarget.value]!;
        keep(keptAs, event.currentTarget.value);
      }}>
      {Object.keys(LUTS).map(name => (
        <option key={name}>{name}</option>
      ))}
    </select>
  );
}
