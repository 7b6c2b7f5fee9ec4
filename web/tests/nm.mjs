// DICOM files (explicit little endian) of an axis-aligned 16-bit NIfTI-1 scan: one NM file of many frames (RECON TOMO),
// or a PET series of one file for each slice. The same scan as header and image, as gates of a beat, and small volumes
// for a long list. A scan without a heart.

import { gunzipSync, gzipSync } from "node:zlib";

const LONG = new Set(["OB", "OW", "SQ", "UN", "UT"]);

/** One data element: tag, value representation, value as text, bytes or numbers. */
function element(tag, vr, value) {
  let body;
  if (Buffer.isBuffer(value)) body = value;
  else if (vr === "US") body = Buffer.concat([value].flat().map(n => Buffer.from(Uint16Array.of(n).buffer)));
  else if (vr === "AT")
    body = Buffer.concat([value].flat().map(tag => Buffer.from(Uint16Array.of(tag >>> 16, tag & 0xffff).buffer)));
  else body = Buffer.from([value].flat().join("\\"), "utf8");
  if (body.length % 2) body = Buffer.concat([body, Buffer.from(vr === "UI" ? "\0" : " ")]);
  const head = Buffer.alloc(LONG.has(vr) ? 12 : 8);
  head.writeUInt16LE(tag >>> 16, 0);
  head.writeUInt16LE(tag & 0xffff, 2);
  head.write(vr, 4, "latin1");
  if (LONG.has(vr)) head.writeUInt32LE(body.length, 8);
  else head.writeUInt16LE(body.length, 6);
  return Buffer.concat([head, body]);
}

function item(...elements) {
  const body = Buffer.concat(elements);
  const head = Buffer.from(Uint16Array.of(0xfffe, 0xe000, body.length & 0xffff, body.length >>> 16).buffer);
  return Buffer.concat([head, body]);
}

/** Voxels, and where they lie, of a packed NIfTI-1 file. */
function scanOf(nifti) {
  const file = gunzipSync(nifti);
  const shape = [42, 44, 46].map(at => file.readInt16LE(at));
  const place = row => [0, 1, 2, 3].map(column => file.readFloatLE(280 + 16 * row + 4 * column));
  const [x, y, z] = [place(0), place(1), place(2)];
  const start = file.readFloatLE(108);
  const pixels = Buffer.alloc(2 * shape[0] * shape[1] * shape[2]);
  for (let n = 0; n < pixels.length / 2; n++) pixels.writeUInt16LE(file.readInt16LE(start + 2 * n) + 32768, 2 * n);
  // NIfTI counts to the right and to anterior, DICOM to the left and to posterior.
  return { shape, pixels, steps: [-x[0], -y[1], z[2]], origin: [-x[3], -y[3], z[3]] };
}

const ROOT = "1.2.826.0.1.3680043.10.998";
const number = value => value.toFixed(6);

/** The head of a file with one object. */
function head(kind, instance) {
  const meta = [
    element(0x00020001, "OB", Buffer.from([0, 1])),
    element(0x00020002, "UI", kind),
    element(0x00020003, "UI", instance),
    element(0x00020010, "UI", "1.2.840.10008.1.2.1"),
    element(0x00020012, "UI", `${ROOT}.9`),
  ];
  const length = Buffer.alloc(4);
  length.writeUInt32LE(Buffer.concat(meta).length);
  return [Buffer.alloc(128), Buffer.from("DICM"), element(0x00020000, "UL", length), ...meta];
}

function image([nx, ny], steps, corrected = null) {
  return [
    element(0x00280010, "US", ny),
    element(0x00280011, "US", nx),
    element(0x00280030, "DS", [number(Math.abs(steps[1])), number(Math.abs(steps[0]))]),
    ...(corrected ? [element(0x00280051, "CS", corrected)] : []),
    element(0x00280100, "US", 16),
    element(0x00280101, "US", 16),
    element(0x00280102, "US", 15),
    element(0x00280103, "US", 0),
  ];
}

/**
 * `series`: number, description and tracer of one series of several in a study; also its corrections, the position of the
 * patient, and the number and the day of another study.
 */
export function nm(nifti, patient, id = "PH7", series = null) {
  const scan = scanOf(nifti);
  return nmFile(
    { ...scan, id, series },
    patient,
    "RECON TOMO",
    [element(0x00280008, "IS", scan.shape[2]), element(0x00280009, "AT", 0x00540080)],
    [
      element(
        0x00540080,
        "US",
        Array.from({ length: scan.shape[2] }, (_, n) => n + 1),
      ),
    ],
  );
}

/** An NM file with the elements that say how its frames are counted, and those of each frame. */
function nmFile({ shape, pixels, steps, origin, id = "PH7", series = null }, patient, type, counted, vectors) {
  const kind = "1.2.840.10008.5.1.4.1.1.20";
  const study = series?.study ?? 1;
  const of = series ? `.${study}.${series.number}` : "";
  const sides = [Math.sign(steps[0]), 0, 0, 0, Math.sign(steps[1]), 0];
  return Buffer.concat([
    ...head(kind, `${ROOT}.7.3${of}`),
    element(0x00080005, "CS", "ISO_IR 192"),
    element(0x00080008, "CS", ["DERIVED", "PRIMARY", type, "EMISSION"]),
    element(0x00080016, "UI", kind),
    element(0x00080018, "UI", `${ROOT}.7.3${of}`),
    element(0x00080020, "DA", series?.day ?? "20250115"),
    element(0x00080050, "SH", "ACC7"),
    element(0x00080060, "CS", "NM"),
    ...(series ? [element(0x0008103e, "LO", series.description)] : []),
    element(0x00100010, "PN", patient),
    element(0x00100020, "LO", id),
    element(0x00180050, "DS", number(Math.abs(steps[2]))),
    element(0x00180088, "DS", number(steps[2] * Math.sign(steps[0] * steps[1]))),
    ...(series?.position ? [element(0x00185100, "CS", series.position)] : []),
    element(0x0020000d, "UI", `${ROOT}.7.${study}`),
    element(0x0020000e, "UI", `${ROOT}.7.2${of}`),
    element(0x00200052, "UI", `${ROOT}.7.4`),
    element(0x00280002, "US", 1),
    element(0x00280004, "CS", "MONOCHROME2"),
    ...counted,
    ...image(shape, steps, series?.corrected),
    ...(series ? [element(0x00540016, "SQ", item(element(0x00180031, "LO", series.tracer)))] : []),
    element(
      0x00540022,
      "SQ",
      item(element(0x00200032, "DS", origin.map(number)), element(0x00200037, "DS", sides.map(number))),
    ),
    ...vectors,
    element(0x7fe00010, "OW", pixels),
  ]);
}

/** One file for each slice. */
export function series(nifti, patient) {
  const { shape, pixels, steps, origin } = scanOf(nifti);
  const kind = "1.2.840.10008.5.1.4.1.1.128";
  const size = 2 * shape[0] * shape[1];
  const sides = [Math.sign(steps[0]), 0, 0, 0, Math.sign(steps[1]), 0];
  return Array.from({ length: shape[2] }, (_, n) =>
    Buffer.concat([
      ...head(kind, `${ROOT}.8.3.${n + 1}`),
      element(0x00080005, "CS", "ISO_IR 192"),
      element(0x00080008, "CS", ["ORIGINAL", "PRIMARY"]),
      element(0x00080016, "UI", kind),
      element(0x00080018, "UI", `${ROOT}.8.3.${n + 1}`),
      element(0x00080020, "DA", "20250116"),
      element(0x00080060, "CS", "PT"),
      element(0x00100010, "PN", patient),
      element(0x00100020, "LO", "PH8"),
      element(0x00180050, "DS", number(Math.abs(steps[2]))),
      element(0x0020000d, "UI", `${ROOT}.8.1`),
      element(0x0020000e, "UI", `${ROOT}.8.2`),
      element(0x00200013, "IS", n + 1),
      element(0x00200032, "DS", [origin[0], origin[1], origin[2] + n * steps[2]].map(number)),
      element(0x00200037, "DS", sides.map(number)),
      element(0x00200052, "UI", `${ROOT}.8.4`),
      element(0x00280002, "US", 1),
      element(0x00280004, "CS", "MONOCHROME2"),
      ...image(shape, steps),
      element(0x00281052, "DS", 0),
      element(0x00281053, "DS", 1),
      element(0x7fe00010, "OW", pixels.subarray(n * size, (n + 1) * size)),
    ]),
  );
}

/** The same scan as a pair of a header and an image. */
export function pair(nifti) {
  const file = gunzipSync(nifti);
  const header = Buffer.from(file.subarray(0, 348));
  header.write("ni1\0", 344, "latin1");
  const start = header.readFloatLE(108);
  header.writeFloatLE(0, 108);
  return { header, image: file.subarray(start) };
}

/** How much shorter every length about the heart is at end systole, and when that is, in turns of the cycle. */
const [SHRINKAGE, SYSTOLE] = [0.1, 0.375];

/**
 * The gates of a beat as `scripts/lib/gated_phantom.py` makes them: the scan drawn together about the heart and let go
 * again.
 */
function beat(nifti, truth, gates) {
  const file = gunzipSync(nifti);
  const [nx, ny, nz] = [42, 44, 46].map(at => file.readInt16LE(at));
  const count = nx * ny * nz;
  const start = file.readFloatLE(108);
  const [slope, intercept] = [112, 116].map(at => file.readFloatLE(at));
  const voxels = Float32Array.from({ length: count }, (_, n) =>
    Math.max(0, slope * file.readInt16LE(start + 2 * n) + intercept),
  );
  const mask = gunzipSync(truth);
  const first = mask.readFloatLE(108);
  const size = mask.readInt16LE(72) / 8;
  const [sum, middle] = [[0, 0, 0], []];
  let inside = 0;
  for (let n = 0; n < count; n++) {
    if (mask[first + size * n] === 0) continue;
    inside++;
    [n % nx, Math.floor(n / nx) % ny, Math.floor(n / (nx * ny))].forEach((at, axis) => (sum[axis] += at));
  }
  sum.forEach((total, axis) => (middle[axis] = total / inside));
  return Array.from({ length: gates }, (_, gate) => {
    const turns = (gate + 0.5) / gates;
    const way = turns < SYSTOLE ? turns / SYSTOLE : (1 - turns) / (1 - SYSTOLE);
    const scale = 1 - (SHRINKAGE * (1 - Math.cos(Math.PI * way))) / 2;
    // For each axis, the voxel before a place and the share of the next.
    const places = [nx, ny, nz].map((length, axis) =>
      Array.from({ length }, (_, at) => {
        const place = Math.max(0, Math.min(length - 1, middle[axis] + (at - middle[axis]) / scale));
        const before = Math.min(length - 2, Math.floor(place));
        return [before, place - before];
      }),
    );
    const out = new Int16Array(count);
    for (let k = 0, n = 0; k < nz; k++) {
      const [c, w] = places[2][k];
      for (let j = 0; j < ny; j++) {
        const [b, v] = places[1][j];
        const row = (c * ny + b) * nx;
        for (let i = 0; i < nx; i++, n++) {
          const [a, u] = places[0][i];
          const along = at => voxels[at] + u * (voxels[at + 1] - voxels[at]);
          const across = at => along(at) + v * (along(at + nx) - along(at));
          const low = across(row + a);
          out[n] = Math.round((low + w * (across(row + nx * ny + a) - low)) / scale ** 3);
        }
      }
    }
    return out;
  });
}

/** A 4-D NIfTI-1 file of the gates of a beat, which lasts `rr` ms; the header says nothing of gates. */
export function gated(nifti, truth, gates, rr = 900) {
  const header = Buffer.from(gunzipSync(nifti).subarray(0, 352));
  header.writeInt16LE(4, 40);
  header.writeInt16LE(gates, 48);
  header.writeFloatLE(rr / 1000 / gates, 92);
  [352, 1, 0].forEach((value, n) => header.writeFloatLE(value, 108 + 4 * n)); // start, slope and intercept
  header[123] = 2 | 8; // mm and s
  return gzipSync(Buffer.concat([header, ...beat(nifti, truth, gates).map(voxels => Buffer.from(voxels.buffer))]));
}

/** The same beat as a gated NM file; `series` as of `nm`. */
export function gatedNm(nifti, truth, gates, patient, { rr = 900, id, series } = {}) {
  const scan = scanOf(nifti);
  const frames = Array.from({ length: gates * scan.shape[2] }, (_, n) => [
    Math.floor(n / scan.shape[2]) + 1,
    (n % scan.shape[2]) + 1,
  ]);
  const pixels = Buffer.concat(beat(nifti, truth, gates).map(voxels => Buffer.from(Uint16Array.from(voxels).buffer)));
  const timing = item(
    element(0x00181062, "IS", rr),
    element(0x00181063, "DS", number(rr / gates)),
    element(0x00181083, "IS", 400),
    element(0x00181084, "IS", 12),
  );
  return nmFile(
    { ...scan, pixels, id, series },
    patient,
    "RECON GATED TOMO",
    [element(0x00280008, "IS", frames.length), element(0x00280009, "AT", [0x00540060, 0x00540070, 0x00540080])],
    [
      element(
        0x00540060,
        "US",
        frames.map(() => 1),
      ),
      element(0x00540061, "US", 1),
      element(0x00540062, "SQ", item(element(0x00540063, "SQ", timing))),
      element(
        0x00540070,
        "US",
        frames.map(([gate]) => gate),
      ),
      element(0x00540071, "US", gates),
      element(
        0x00540080,
        "US",
        frames.map(([, slice]) => slice),
      ),
      element(0x00540081, "US", scan.shape[2]),
    ],
  );
}

/** A NIfTI-1 volume of 8 x 8 x (7 + n) voxels of 1 mm, which count up from n. */
export function small(n) {
  const shape = [8, 8, 7 + n];
  const file = Buffer.alloc(352 + 2 * 64 * shape[2]);
  file.writeInt32LE(348, 0);
  [3, ...shape, 1, 1, 1, 1].forEach((size, at) => file.writeInt16LE(size, 40 + 2 * at));
  file.writeInt16LE(4, 70); // 16-bit whole numbers
  file.writeInt16LE(16, 72);
  for (let at = 76; at < 92; at += 4) file.writeFloatLE(1, at);
  file.writeFloatLE(352, 108);
  file.write("n+1\0", 344, "latin1");
  for (let at = 0; at < 64 * shape[2]; at++) file.writeInt16LE(n + at, 352 + 2 * at);
  return file;
}

/** A NIfTI-1 file of a scan that shows no heart: a warm chest with one hot ball. */
export function heartless() {
  const [shape, spacing] = [[48, 48, 40], 6.4];
  const file = Buffer.alloc(352 + 2 * shape[0] * shape[1] * shape[2]);
  file.writeInt32LE(348, 0);
  [3, ...shape, 1, 1, 1, 1].forEach((size, at) => file.writeInt16LE(size, 40 + 2 * at));
  file.writeInt16LE(4, 70);
  file.writeInt16LE(16, 72);
  [1, spacing, spacing, spacing].forEach((mm, at) => file.writeFloatLE(mm, 76 + 4 * at));
  file.writeFloatLE(352, 108);
  file[123] = 2;
  file.writeInt16LE(1, 254);
  [0, 1, 2].forEach(row => file.writeFloatLE(spacing, 280 + 20 * row));
  file.write("n+1\0", 344, "latin1");
  const [nx, ny] = shape;
  for (let at = 0; 352 + 2 * at < file.length; at++) {
    const [x, y, z] = [at % nx, Math.floor(at / nx) % ny, Math.floor(at / nx / ny)];
    const chest = ((x - 24) / 22) ** 2 + ((y - 24) / 17) ** 2 < 1 ? 40 : 0;
    const ball = 400 * Math.exp(-((x - 16) ** 2 + (y - 26) ** 2 + (z - 10) ** 2) / 40);
    // Counts differ from voxel to voxel.
    file.writeInt16LE(Math.round((chest + ball) * (1 + 0.3 * Math.sin(7 * at * at))), 352 + 2 * at);
  }
  return file;
}
