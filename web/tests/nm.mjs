// A DICOM NM file (RECON TOMO, explicit little endian) of an axis-aligned 16-bit NIfTI-1 scan.

import { gunzipSync } from "node:zlib";

const LONG = new Set(["OB", "OW", "SQ", "UN", "UT"]);

/** One data element: tag, value representation, value as text, bytes or numbers. */
function element(tag, vr, value) {
  let body;
  if (Buffer.isBuffer(value)) body = value;
  else if (vr === "US") body = Buffer.concat([value].flat().map(n => Buffer.from(Uint16Array.of(n).buffer)));
  else if (vr === "AT") body = Buffer.from(Uint16Array.of(value >>> 16, value & 0xffff).buffer);
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

export function nm(nifti, patient) {
  const file = gunzipSync(nifti);
  const [nx, ny, nz] = [42, 44, 46].map(at => file.readInt16LE(at));
  const place = row => [0, 1, 2, 3].map(column => file.readFloatLE(280 + 16 * row + 4 * column));
  const [x, y, z] = [place(0), place(1), place(2)];
  const start = file.readFloatLE(108);
  // NIfTI counts to the right and to anterior, DICOM to the left and to posterior.
  const steps = [-x[0], -y[1], z[2]];
  const origin = [-x[3], -y[3], z[3]];
  const pixels = Buffer.alloc(2 * nx * ny * nz);
  for (let n = 0; n < nx * ny * nz; n++) pixels.writeUInt16LE(file.readInt16LE(start + 2 * n) + 32768, 2 * n);
  const root = "1.2.826.0.1.3680043.10.998.7";
  const kind = "1.2.840.10008.5.1.4.1.1.20";
  const meta = [
    element(0x00020001, "OB", Buffer.from([0, 1])),
    element(0x00020002, "UI", kind),
    element(0x00020003, "UI", `${root}.3`),
    element(0x00020010, "UI", "1.2.840.10008.1.2.1"),
    element(0x00020012, "UI", `${root}.9`),
  ];
  const length = Buffer.alloc(4);
  length.writeUInt32LE(Buffer.concat(meta).length);
  const number = value => value.toFixed(6);
  const sides = [Math.sign(steps[0]), 0, 0, 0, Math.sign(steps[1]), 0];
  return Buffer.concat([
    Buffer.alloc(128),
    Buffer.from("DICM"),
    element(0x00020000, "UL", length),
    ...meta,
    element(0x00080005, "CS", "ISO_IR 192"),
    element(0x00080008, "CS", ["DERIVED", "PRIMARY", "RECON TOMO", "EMISSION"]),
    element(0x00080016, "UI", kind),
    element(0x00080018, "UI", `${root}.3`),
    element(0x00080020, "DA", "20250115"),
    element(0x00080050, "SH", "ACC7"),
    element(0x00080060, "CS", "NM"),
    element(0x00100010, "PN", patient),
    element(0x00100020, "LO", "PH7"),
    element(0x00180050, "DS", number(Math.abs(steps[2]))),
    element(0x00180088, "DS", number(steps[2] * Math.sign(steps[0] * steps[1]))),
    element(0x0020000d, "UI", `${root}.1`),
    element(0x0020000e, "UI", `${root}.2`),
    element(0x00200052, "UI", `${root}.4`),
    element(0x00280002, "US", 1),
    element(0x00280004, "CS", "MONOCHROME2"),
    element(0x00280008, "IS", nz),
    element(0x00280009, "AT", 0x00540080),
    element(0x00280010, "US", ny),
    element(0x00280011, "US", nx),
    element(0x00280030, "DS", [number(Math.abs(steps[1])), number(Math.abs(steps[0]))]),
    element(0x00280100, "US", 16),
    element(0x00280101, "US", 16),
    element(0x00280102, "US", 15),
    element(0x00280103, "US", 0),
    element(0x00540022, "SQ", item(element(0x00200032, "DS", origin.map(number)), element(0x00200037, "DS", sides.map(number)))),
    element(0x00540080, "US", Array.from({ length: nz }, (_, n) => n + 1)),
    element(0x7fe00010, "OW", pixels),
  ]);
}
