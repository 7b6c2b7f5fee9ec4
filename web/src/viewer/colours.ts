// Colour maps: 256 colours each, from a few anchors.

import figures from "../../../crates/ventriform/assets/figures.json";
import uptake from "../../../crates/ventriform/assets/uptake.json";

export type Lut = Uint8Array;

function ramp(anchors: [number, string][]): Lut {
  const lut = new Uint8Array(256 * 3);
  const rgb = (hex: string) => [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16));
  for (let n = 0; n < 256; n++) {
    const share = n / 255;
    const next = Math.max(
      1,
      anchors.findIndex(([at]) => at >= share),
    );
    const [from, low] = anchors[next - 1]!;
    const [to, high] = anchors[next]!;
    const t = (share - from) / (to - from || 1);
    rgb(low).forEach(
      (value, channel) => (lut[3 * n + channel] = Math.round(value + t * (rgb(high)[channel]! - value))),
    );
  }
  return lut;
}

function stepped(lut: Lut, steps: number): Lut {
  const out = new Uint8Array(lut.length);
  for (let n = 0; n < 256; n++) {
    const step = Math.min(steps - 1, Math.floor((n / 256) * steps));
    const from = Math.round((step / (steps - 1)) * 255);
    for (let channel = 0; channel < 3; channel++) out[3 * n + channel] = lut[3 * from + channel]!;
  }
  return out;
}

function hex(rgb: number[]): string {
  return `#${rgb.map(part => part.toString(16).padStart(2, "0")).join("")}`;
}

const RAINBOW: [number, string][] = [
  [0, "#05051a"],
  [0.2, "#1b2a9c"],
  [0.4, "#0090d0"],
  [0.55, "#00b050"],
  [0.7, "#c8d400"],
  [0.82, "#ffb800"],
  [0.92, "#ff6a00"],
  [1, "#d80c00"],
];

export const LUTS: Record<string, Lut> = {
  "Hot iron": ramp([
    [0, "#000000"],
    [0.4, "#c01000"],
    [0.75, "#ffb000"],
    [1, "#ffffff"],
  ]),
  Perfusion: ramp(RAINBOW),
  "Perfusion, 10 steps": stepped(ramp(RAINBOW), 10),
  Inferno: ramp(uptake.colours.map((rgb, n): [number, string] => [n / (uptake.colours.length - 1), hex(rgb)])),
  Grey: ramp([
    [0, "#000000"],
    [1, "#ffffff"],
  ]),
  "Inverse grey": ramp([
    [0, "#ffffff"],
    [1, "#000000"],
  ]),
  Viridis: ramp([
    [0, "#440154"],
    [0.25, "#3b528b"],
    [0.5, "#21918c"],
    [0.75, "#5ec962"],
    [1, "#fde725"],
  ]),
  Cool: ramp([
    [0, "#00161f"],
    [0.5, "#00798c"],
    [1, "#e8ffff"],
  ]),
};

/** For what has a middle: distances and differences. */
export const DIVERGING = ramp([
  [0, "#2166ac"],
  [0.25, "#92c5de"],
  [0.5, "#f7f7f7"],
  [0.75, "#f4a582"],
  [1, "#b2182b"],
]);

/** Round the cycle of a beat. */
export const CYCLE = ramp(
  [...figures.cycle, figures.cycle[0]!].map((rgb, n): [number, string] => [n / figures.cycle.length, hex(rgb)]),
);

/** More uptake at stress than at rest, as much, less. */
export const DIFFERENCE = ramp(figures.difference.map((rgb, n): [number, string] => [n / 2, hex(rgb)]));

/** The same colours for what stress has more than rest: those of less at stress come first. */
export const STRESS_LESS_REST = ramp(
  [...figures.difference].reverse().map((rgb, n): [number, string] => [n / 2, hex(rgb)]),
);

/** A wall that moves outward, or gets thinner. */
export const OUTWARD = figures.outward as [number, number, number];

export function colour(lut: Lut, share: number): [number, number, number] {
  const n = Math.max(0, Math.min(255, Math.round(share * 255))) * 3;
  return [lut[n]!, lut[n + 1]!, lut[n + 2]!];
}

export function css(lut: Lut, share: number): string {
  return `rgb(${colour(lut, share).join(",")})`;
}

/** Where a polar map shows no wall, and the line about what lies below its threshold. */
export const NO_WALL = uptake.no_wall as [number, number, number];
const THRESHOLD = hex(uptake.threshold);
/** The hatching of places beyond the muscle's end. */
export const VALVE_PLANE = hex(uptake.valve_plane);

/** The scale of the uptake in maps, on the wall, in reports and files. */
export const UPTAKE = "Inferno";

/** The line that is seen on a map of these colours: the service's own has one for itself. */
export function thresholdOn(lut: Lut): string {
  return lut === LUTS[UPTAKE] ? THRESHOLD : "#fff";
}

/** Where the browser keeps the colours that were chosen for slices, and for polar map and wall. */
export const LUT = "ventriform.lut";
export const WALL_LUT = "ventriform.wall-lut";

export function kept(key: string, standard: string): Lut {
  return LUTS[localStorage.getItem(key) ?? ""] ?? LUTS[standard]!;
}

export function keep(key: string, name: string): void {
  try {
    localStorage.setItem(key, name);
  } catch {
    // A report may be opened where nothing may be kept.
  }
}
