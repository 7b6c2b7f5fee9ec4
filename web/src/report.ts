// The script of the self-contained report: its model is turned by drag or arrow keys, drawn as the page draws it without
// WebGL. The report is whole without it.

import { boundsOf, turn } from "./viewer/camera";
import { handleEvents } from "./viewer/events";
import { FlatView } from "./viewer/flatview";
import type { Mesh } from "./viewer/mesh";
import { type Vec, add, cross, sub, unit } from "./viewer/vector";

/** What the report embeds: three numbers for each vertex (mm) and, if it has one, its colour (0 to 1), and for each triangle. */
interface Embedded {
  vertices: number[];
  triangles: number[];
  colours: number[] | null;
}

const MYOCARDIUM: Vec = [0.9, 0.42, 0.36];

function triples(flat: number[]): Vec[] {
  return Array.from({ length: flat.length / 3 }, (_, n): Vec => [flat[3 * n]!, flat[3 * n + 1]!, flat[3 * n + 2]!]);
}

function meshOf({ vertices: places, triangles: corners }: Embedded): Mesh {
  const vertices = triples(places);
  const triangles = triples(corners) as unknown as Mesh["triangles"];
  const normals = vertices.map((): Vec => [0, 0, 0]);
  for (const [a, b, c] of triangles) {
    const normal = cross(sub(vertices[b]!, vertices[a]!), sub(vertices[c]!, vertices[a]!));
    for (const at of [a, b, c]) normals[at] = add(normals[at]!, normal);
  }
  return { vertices, triangles, normals: normals.map(unit) };
}

const data = document.getElementById("mesh");
const canvas = document.getElementById("turn") as HTMLCanvasElement | null;
const figure = document.getElementById("turnable");
if (data && canvas && figure) {
  const embedded = JSON.parse(data.textContent ?? "") as Embedded;
  const mesh = meshOf(embedded);
  const { middle, reach } = boundsOf(mesh);
  const view = new FlatView(canvas, "");
  view.camera = { ...view.camera, target: middle, height: 2.05 * reach };
  const colours = embedded.colours ?? mesh.vertices.flatMap(() => [...MYOCARDIUM]);
  view.setSurface("model", mesh, Float32Array.from(colours));
  view.setWire("edges", mesh, [0.38, 0.18, 0.15]);
  const draw = () => {
    const side = Math.round(canvas.clientWidth * (devicePixelRatio || 1));
    if (canvas.width !== side) canvas.width = canvas.height = side;
    view.draw();
  };
  const by = (dx: number, dy: number) => {
    turn(view.camera, dx, dy);
    requestAnimationFrame(draw);
  };
  let last: PointerEvent | null = null;
  const end = () => (last = null);
  handleEvents(canvas, {
    pointerdown: event => {
      last = event;
      canvas.setPointerCapture(event.pointerId);
    },
    pointermove: event => {
      if (!last) return;
      by(event.clientX - last.clientX, event.clientY - last.clientY);
      last = event;
    },
    pointerup: end,
    pointercancel: end,
    keydown: event => {
      const step = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] }[event.key];
      if (!step) return;
      event.preventDefault();
      by(step[0]!, step[1]!);
    },
  });
  figure.hidden = false;
  addEventListener("resize", draw);
  draw();
}
