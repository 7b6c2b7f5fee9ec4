// Meshes in three dimensions on a plain canvas, for browsers without WebGL, for paper and for the self-contained
// report: triangles are drawn from the farthest to the nearest.

import { type Camera, type MeshPainter, heightOf, light, rightOf, usualCamera } from "./camera";
import type { Mesh } from "./mesh";
import { type Vec, add, cross, dot, mix, scale, sub, unit } from "./vector";

interface Corner {
  place: Vec;
  normal: Vec;
  colour: Vec;
}

/** Triangles are divided until there are about so many, so that colours run smoothly. */
const SMOOTH = 8000;

export class FlatView implements MeshPainter {
  private readonly surfaces = new Map<string, [Corner, Corner, Corner][]>();
  private readonly wires = new Map<string, { mesh: Mesh; colour: Vec }>();
  private readonly points = new Map<string, { place: Vec; colour: Vec }>();
  camera: Camera = usualCamera();

  /** `ground` is the colour behind the meshes; none if it is empty. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly ground = "#090d0f",
  ) {}

  setSurface(name: string, mesh: Mesh, colours: Float32Array): void {
    const corner = (at: number): Corner => ({
      place: mesh.vertices[at]!,
      normal: mesh.normals[at]!,
      colour: [colours[3 * at]!, colours[3 * at + 1]!, colours[3 * at + 2]!],
    });
    let facets = mesh.triangles.map(([a, b, c]): [Corner, Corner, Corner] => [corner(a), corner(b), corner(c)]);
    while (facets.length * 4 <= SMOOTH) facets = facets.flatMap(quartered);
    this.surfaces.set(name, facets);
  }

  setWire(name: string, mesh: Mesh, colour: Vec): void {
    this.wires.set(name, { mesh, colour });
  }

  setPoint(name: string, place: Vec, colour: Vec): void {
    this.points.set(name, { place, colour });
  }

  remove(name: string): void {
    for (const all of [this.surfaces, this.wires, this.points]) all.delete(name);
  }

  end(): void {
    this.surfaces.clear();
  }

  draw(): void {
    const { canvas, camera } = this;
    const context = canvas.getContext("2d");
    if (!context || canvas.width < 2) return;
    const { width, height } = canvas;
    const right = rightOf(camera);
    const factor = height / heightOf(camera, width / height);
    const flat = (place: Vec): [number, number] => {
      const r = sub(place, camera.target);
      return [width / 2 + dot(r, right) * factor, height / 2 - dot(r, camera.up) * factor];
    };
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    if (this.ground) {
      context.fillStyle = this.ground;
      context.fillRect(0, 0, width, height);
    }
    context.lineJoin = "round";
    const depth = (place: Vec) => dot(place, camera.toward);
    const strokes: [number, () => void][] = [];
    for (const corners of [...this.surfaces.values()].flat()) {
      strokes.push([
        corners.reduce((sum, { place }) => sum + depth(place), 0) / 3,
        () => {
          const normal = unit(corners.reduce<Vec>((sum, corner) => add(sum, corner.normal), [0, 0, 0]));
          const colour = corners.reduce<Vec>((sum, corner) => add(sum, corner.colour), [0, 0, 0]);
          context.fillStyle = rgb(scale(colour, light(camera, normal) / 3));
          // A thin line of the same colour closes the seams between neighbours.
          context.strokeStyle = context.fillStyle;
          context.lineWidth = 1;
          outline(
            context,
            corners.map(({ place }) => flat(place)),
          );
          context.fill();
          context.stroke();
        },
      ]);
    }
    for (const { mesh, colour } of this.wires.values()) {
      for (const triangle of mesh.triangles) {
        const corners = triangle.map(at => mesh.vertices[at]!);
        const [p, q, r] = corners as [Vec, Vec, Vec];
        if (depth(cross(sub(q, p), sub(r, p))) <= 0) continue;
        // After every part of its own triangle, before what hides it.
        strokes.push([
          Math.max(...corners.map(depth)),
          () => {
            context.strokeStyle = rgb(colour);
            context.lineWidth = Math.max(0.5, Math.min(1.5, height / 300));
            outline(context, corners.map(flat));
            context.stroke();
          },
        ]);
      }
    }
    strokes.sort((a, b) => a[0] - b[0]);
    for (const [, stroke] of strokes) stroke();
    for (const { place, colour } of this.points.values()) {
      context.fillStyle = rgb(colour);
      context.beginPath();
      context.arc(...flat(place), 4.5 * (width / Math.max(1, canvas.clientWidth || width)), 0, 2 * Math.PI);
      context.fill();
    }
  }
}

function outline(context: CanvasRenderingContext2D, corners: [number, number][]): void {
  context.beginPath();
  for (const corner of corners) context.lineTo(...corner);
  context.closePath();
}

function rgb(colour: Vec): string {
  return `rgb(${colour.map(part => Math.round(255 * Math.max(0, Math.min(1, part)))).join(" ")})`;
}

function quartered([a, b, c]: [Corner, Corner, Corner]): [Corner, Corner, Corner][] {
  const between = (p: Corner, q: Corner): Corner => ({
    place: mix(p.place, q.place, 0.5),
    normal: unit(add(p.normal, q.normal)),
    colour: mix(p.colour, q.colour, 0.5),
  });
  const [ab, bc, ca] = [between(a, b), between(b, c), between(c, a)];
  return [
    [a, ab, ca],
    [ab, b, bc],
    [ca, bc, c],
    [ab, bc, ca],
  ];
}
