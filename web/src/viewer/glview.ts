// Meshes in three dimensions, by WebGL: a coloured wall, another one as a wire, and the cursor.

import { type Camera, type MeshPainter, heightOf, rightOf, usualCamera } from "./camera";
import type { Mesh } from "./mesh";
import { type Vec, dot } from "./vector";

const VERTEX = `
attribute vec3 place; attribute vec3 normal; attribute vec3 colour;
uniform mat4 view; uniform float size;
varying vec3 n; varying vec3 c;
void main() { n = normal; c = colour; gl_Position = view * vec4(place, 1.0); gl_PointSize = size; }`;

const FRAGMENT = `
precision mediump float;
varying vec3 n; varying vec3 c;
uniform vec3 toward; uniform vec3 up; uniform float flat_;
void main() {
  if (flat_ > 1.5 && distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
  float facing = abs(dot(normalize(n), toward));
  float top = 0.5 + 0.5 * dot(normalize(n), up);
  float light = mix(0.35 + 0.55 * facing + 0.18 * top, 1.0, min(flat_, 1.0));
  gl_FragColor = vec4(c * light, 1.0);
}`;

interface Part {
  mode: "triangles" | "lines" | "points";
  count: number;
  place: WebGLBuffer;
  normal: WebGLBuffer;
  colour: WebGLBuffer;
}

export class MeshView implements MeshPainter {
  private readonly gl: WebGLRenderingContext;
  private readonly program: WebGLProgram;
  private parts = new Map<string, Part>();
  camera: Camera = usualCamera();

  /** Throws if the browser has no WebGL. */
  constructor(readonly canvas: HTMLCanvasElement) {
    const gl = canvas.getContext("webgl", { antialias: true, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL");
    this.gl = gl;
    const program = gl.createProgram();
    for (const [type, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ] as const) {
      const shader = gl.createShader(type);
      if (!shader || !program) throw new Error("no WebGL");
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error("no WebGL");
    this.program = program;
  }

  setSurface(name: string, mesh: Mesh, colours: Float32Array): void {
    const corners = mesh.triangles.flat();
    const gather = (value: (at: number) => ArrayLike<number>) =>
      Float32Array.from(corners.flatMap(at => Array.from(value(at))));
    this.put(
      name,
      "triangles",
      gather(at => mesh.vertices[at]!),
      gather(at => mesh.normals[at]!),
      gather(at => colours.subarray(3 * at, 3 * at + 3)),
    );
  }

  setWire(name: string, mesh: Mesh, colour: Vec): void {
    const ends = mesh.triangles.flatMap(([a, b, c]) => [a, b, b, c, c, a]);
    const places = Float32Array.from(ends.flatMap(at => [...mesh.vertices[at]!]));
    const count = ends.length;
    this.put(name, "lines", places, filled(count, [0, 0, 1]), filled(count, colour));
  }

  setPoint(name: string, place: Vec, colour: Vec): void {
    this.put(name, "points", Float32Array.from(place), filled(1, [0, 0, 1]), filled(1, colour));
  }

  remove(name: string): void {
    const part = this.parts.get(name);
    if (!part) return;
    for (const buffer of [part.place, part.normal, part.colour]) this.gl.deleteBuffer(buffer);
    this.parts.delete(name);
  }

  private put(name: string, mode: Part["mode"], place: Float32Array, normal: Float32Array, colour: Float32Array): void {
    this.remove(name);
    const buffer = (data: Float32Array): WebGLBuffer => {
      const made = this.gl.createBuffer();
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, made);
      this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.STATIC_DRAW);
      return made as WebGLBuffer;
    };
    this.parts.set(name, {
      mode,
      count: place.length / 3,
      place: buffer(place),
      normal: buffer(normal),
      colour: buffer(colour),
    });
  }

  draw(): void {
    const { gl, canvas } = this;
    const { toward, up, target } = this.camera;
    const right = rightOf(this.camera);
    const ratio = canvas.width / canvas.height;
    const height = heightOf(this.camera, ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.035, 0.05, 0.06, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.program);
    const rows: [Vec, number][] = [
      [right, 2 / (height * ratio)],
      [up, 2 / height],
      [toward, -1 / 400],
    ];
    const view = new Float32Array(16);
    rows.forEach(([axis, factor], row) => {
      for (let column = 0; column < 3; column++) view[4 * column + row] = axis[column]! * factor;
      view[12 + row] = -dot(axis, target) * factor;
    });
    view[15] = 1;
    const uniform = (name: string) => gl.getUniformLocation(this.program, name);
    gl.uniformMatrix4fv(uniform("view"), false, view);
    gl.uniform3fv(uniform("toward"), toward);
    gl.uniform3fv(uniform("up"), up);
    gl.uniform1f(uniform("size"), 9 * devicePixelRatio);
    for (const part of this.parts.values()) {
      gl.uniform1f(uniform("flat_"), part.mode === "triangles" ? 0 : part.mode === "lines" ? 1 : 2);
      for (const name of ["place", "normal", "colour"] as const) {
        const at = gl.getAttribLocation(this.program, name);
        gl.bindBuffer(gl.ARRAY_BUFFER, part[name]);
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 0, 0);
      }
      if (part.mode === "points") gl.disable(gl.DEPTH_TEST);
      gl.drawArrays(
        part.mode === "triangles" ? gl.TRIANGLES : part.mode === "lines" ? gl.LINES : gl.POINTS,
        0,
        part.count,
      );
      gl.enable(gl.DEPTH_TEST);
    }
  }

  /** Gives the context back; browsers allow few of them. */
  end(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

function filled(count: number, value: Vec): Float32Array {
  const out = new Float32Array(3 * count);
  for (let n = 0; n < count; n++) out.set(value, 3 * n);
  return out;
}
