// Voxels with their place in the patient. In go the bytes of a NIfTI-1 file as the service writes it.

import type { Vec } from "./vector";

type Row = readonly [number, number, number, number];

export class Voxels {
  readonly lowest: number;
  readonly highest: number;
  /** Millimetres to voxel indices. */
  private readonly inverse: readonly [Row, Row, Row];

  constructor(
    readonly shape: readonly [number, number, number],
    /** Voxel indices to millimetres, LPS. */
    readonly affine: readonly [Row, Row, Row],
    readonly values: Float32Array,
  ) {
    this.inverse = inverted(affine);
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    this.lowest = low;
    this.highest = high;
  }

  get spacing(): number {
    const length = (axis: number) => Math.hypot(...this.affine.map(row => row[axis]!));
    return Math.min(length(0), length(1), length(2));
  }

  toIndex([x, y, z]: Vec): Vec {
    const [a, b, c] = this.inverse;
    return [
      a[0] * x + a[1] * y + a[2] * z + a[3],
      b[0] * x + b[1] * y + b[2] * z + b[3],
      c[0] * x + c[1] * y + c[2] * z + c[3],
    ];
  }

  toPlace([i, j, k]: Vec): Vec {
    const [a, b, c] = this.affine;
    return [
      a[0] * i + a[1] * j + a[2] * k + a[3],
      b[0] * i + b[1] * j + b[2] * k + b[3],
      c[0] * i + c[1] * j + c[2] * k + c[3],
    ];
  }

  get middle(): Vec {
    const [x, y, z] = this.shape;
    return this.toPlace([(x - 1) / 2, (y - 1) / 2, (z - 1) / 2]);
  }

  /** Lowest and highest coordinate along `direction` of the whole array. */
  extent(direction: Vec): [number, number] {
    let [low, high] = [Infinity, -Infinity];
    for (let corner = 0; corner < 8; corner++) {
      const index = this.shape.map((n, axis) => ((corner >> axis) & 1 ? n - 1 : 0)) as unknown as Vec;
      const [x, y, z] = this.toPlace(index);
      const along = x * direction[0] + y * direction[1] + z * direction[2];
      low = Math.min(low, along);
      high = Math.max(high, along);
    }
    return [low, high];
  }

  /** The value at a place by trilinear interpolation; NaN outside. */
  at(place: Vec): number {
    const out = new Float32Array(1);
    this.line(place, [0, 0, 0], 1, out, 0);
    return out[0]!;
  }

  /** `count` values from `start` on, `step` apart, into `out` from `offset` on. */
  line(start: Vec, step: Vec, count: number, out: Float32Array, offset: number): void {
    const [nx, ny, nz] = this.shape;
    const values = this.values;
    let [x, y, z] = this.toIndex(start);
    const [ex, ey, ez] = this.toIndex([start[0] + step[0], start[1] + step[1], start[2] + step[2]]);
    const [dx, dy, dz] = [ex - x, ey - y, ez - z];
    const [sj, sk] = [nx, nx * ny];
    for (let n = 0; n < count; n++, x += dx, y += dy, z += dz) {
      if (x < -0.5 || y < -0.5 || z < -0.5 || x > nx - 0.5 || y > ny - 0.5 || z > nz - 0.5) {
        out[offset + n] = NaN;
        continue;
      }
      const cx = x < 0 ? 0 : x > nx - 1 ? nx - 1 : x;
      const cy = y < 0 ? 0 : y > ny - 1 ? ny - 1 : y;
      const cz = z < 0 ? 0 : z > nz - 1 ? nz - 1 : z;
      const i = cx | 0,
        j = cy | 0,
        k = cz | 0;
      const fx = cx - i,
        fy = cy - j,
        fz = cz - k;
      const a = i + sj * j + sk * k;
      const ix = i + 1 < nx ? 1 : 0,
        jy = j + 1 < ny ? sj : 0,
        kz = k + 1 < nz ? sk : 0;
      const v00 = values[a]! + fx * (values[a + ix]! - values[a]!);
      const v10 = values[a + jy]! + fx * (values[a + jy + ix]! - values[a + jy]!);
      const v01 = values[a + kz]! + fx * (values[a + kz + ix]! - values[a + kz]!);
      const v11 = values[a + kz + jy]! + fx * (values[a + kz + jy + ix]! - values[a + kz + jy]!);
      const low = v00 + fy * (v10 - v00),
        high = v01 + fy * (v11 - v01);
      out[offset + n] = low + fz * (high - low);
    }
  }

  /** The value that `share` of a sample of the voxels do not exceed. */
  percentile(share: number): number {
    const step = Math.max(1, Math.floor(this.values.length / 40_000));
    const sample: number[] = [];
    for (let n = 0; n < this.values.length; n += step)
      if (Number.isFinite(this.values[n])) sample.push(this.values[n]!);
    sample.sort((a, b) => a - b);
    return sample[Math.min(sample.length - 1, Math.floor(share * sample.length))] ?? 0;
  }
}

function inverted([a, b, c]: readonly [Row, Row, Row]): [Row, Row, Row] {
  const minor = (p: Row, q: Row, i: number, j: number) => p[i]! * q[j]! - p[j]! * q[i]!;
  const determinant = a[0] * minor(b, c, 1, 2) - a[1] * minor(b, c, 0, 2) + a[2] * minor(b, c, 0, 1);
  const linear = [
    [minor(b, c, 1, 2), -minor(a, c, 1, 2), minor(a, b, 1, 2)],
    [-minor(b, c, 0, 2), minor(a, c, 0, 2), -minor(a, b, 0, 2)],
    [minor(b, c, 0, 1), -minor(a, c, 0, 1), minor(a, b, 0, 1)],
  ];
  return linear.map(row => {
    const [x, y, z] = row.map(value => value / determinant) as [number, number, number];
    return [x, y, z, -(x * a[3] + y * b[3] + z * c[3])] as const;
  }) as [Row, Row, Row];
}

type Reader = (view: DataView, at: number) => number;
const TYPES: Record<number, [number, Reader]> = {
  2: [1, (view, at) => view.getUint8(at)],
  4: [2, (view, at) => view.getInt16(at, true)],
  16: [4, (view, at) => view.getFloat32(at, true)],
};

/** Millimetres per unit of length, by the code in `xyzt_units`. */
const UNITS: Record<number, number> = { 1: 1000, 3: 0.001 };

/**
 * From voxel to patient, LPS mm, as the header states it: by the sform, else the qform, else the spacing
 * (`nifti1.h`, methods 3, 2 and 1, and nibabel's origin in the middle of the array).
 */
function placeOf(view: DataView, shape: [number, number, number]): [Row, Row, Row] {
  const real = (at: number): number => view.getFloat32(at, true);
  const unit = UNITS[view.getUint8(123) & 7] ?? 1;
  // NIfTI states x to the right and y to anterior.
  const row = (axis: number, ras: number[]): Row => ras.map(part => (axis < 2 ? -unit : unit) * part) as unknown as Row;
  if (view.getInt16(254, true) > 0) {
    const stated = (axis: number): Row =>
      row(
        axis,
        [0, 1, 2, 3].map(column => real(280 + 16 * axis + 4 * column)),
      );
    return [stated(0), stated(1), stated(2)];
  }
  const [dx, dy, dz] = [80, 84, 88].map(at => Math.abs(real(at))) as [number, number, number];
  if (view.getInt16(252, true) > 0) {
    const [b, c, d] = [256, 260, 264].map(real) as [number, number, number];
    const a = Math.sqrt(Math.max(0, 1 - b * b - c * c - d * d));
    const k = real(76) < 0 ? -dz : dz;
    return [
      row(0, [(a * a + b * b - c * c - d * d) * dx, 2 * (b * c - a * d) * dy, 2 * (b * d + a * c) * k, real(268)]),
      row(1, [2 * (b * c + a * d) * dx, (a * a + c * c - b * b - d * d) * dy, 2 * (c * d - a * b) * k, real(272)]),
      row(2, [2 * (b * d - a * c) * dx, 2 * (c * d + a * b) * dy, (a * a + d * d - b * b - c * c) * k, real(276)]),
    ];
  }
  const middle = (axis: number, step: number): number => (-step * (shape[axis]! - 1)) / 2;
  return [row(0, [-dx, 0, 0, middle(0, -dx)]), row(1, [0, dy, 0, middle(1, dy)]), row(2, [0, 0, dz, middle(2, dz)])];
}

/** Reads a NIfTI-1 file of one frame in little-endian order. */
function parseNifti(bytes: ArrayBuffer): Voxels {
  const view = new DataView(bytes);
  if (view.byteLength < 352 || view.getInt32(0, true) !== 348) throw new Error("The voxels are not a NIfTI-1 file.");
  const shape = [1, 2, 3].map(axis => view.getInt16(40 + 2 * axis, true)) as [number, number, number];
  const type = TYPES[view.getInt16(70, true)];
  if (!type) throw new Error("The voxels are of an unknown type.");
  const [size, read] = type;
  const start = view.getFloat32(108, true);
  const slope = view.getFloat32(112, true) || 1;
  const intercept = view.getFloat32(116, true);
  const rows = placeOf(view, shape);
  const values = new Float32Array(shape[0] * shape[1] * shape[2]);
  for (let n = 0; n < values.length; n++) values[n] = slope * read(view, start + n * size) + intercept;
  return new Voxels(shape, rows, values);
}

/** Reads such a file, packed by gzip or not. */
export async function unpackNifti(packed: ArrayBuffer): Promise<Voxels> {
  const head = new Uint8Array(packed, 0, 2);
  if (head[0] !== 0x1f || head[1] !== 0x8b) return parseNifti(packed);
  const unpacked = new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
  return parseNifti(await unpacked.arrayBuffer());
}
