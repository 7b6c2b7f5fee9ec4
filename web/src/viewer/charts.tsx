// The volume curve of a beat, or of two on one chart, and the histogram of its phases.

import type { ComponentChildren } from "preact";
import type { BeatReport } from "../generated/openapi";
import { useWatched } from "../state";
import { number } from "../words";
import type { Beating } from "./beating";

const [WIDTH, HEIGHT] = [320, 190];
const AREA = { left: 32, right: 308, top: 20, bottom: 158 };

/** A step of 1, 2 or 5 times a power of ten that is not below `least`. */
function roundStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(factor => factor * power).find(step => step >= least * 0.999) ?? 10 * power;
}

/** The place of a moment across, in degrees of the cycle. */
function across(degrees: number): number {
  return AREA.left + ((AREA.right - AREA.left) * degrees) / 360;
}

interface FrameProps {
  name: string;
  /** The highest value; the axis ends at the next round one. */
  highest: number;
  unit: string;
  below: string;
  onPick?: (degrees: number) => void;
  children: (up: (value: number) => number) => ComponentChildren;
}

function Frame({ name, highest, unit, below, onPick, children }: FrameProps) {
  const step = roundStep(Math.max(highest, 1e-6) / 4);
  const count = Math.ceil(highest / step - 1e-9);
  const up = (value: number) => AREA.bottom - ((AREA.bottom - AREA.top) * value) / (count * step);
  return (
    <svg
      class="chart beat-chart"
      viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
      role="img"
      aria-label={name}
      onPointerDown={event => {
        const box = event.currentTarget.getBoundingClientRect();
        const degrees =
          ((((event.clientX - box.left) / box.width) * WIDTH - AREA.left) / (AREA.right - AREA.left)) * 360;
        if (degrees >= 0 && degrees < 360) onPick?.(degrees);
      }}>
      {Array.from({ length: count + 1 }, (_, n) => n * step).map(value => (
        <g key={value}>
          <line class="grid-line" x1={AREA.left} x2={AREA.right} y1={up(value)} y2={up(value)} />
          <text x={AREA.left - 5} y={up(value) + 4} text-anchor="end">
            {value}
          </text>
        </g>
      ))}
      <text x={4} y={10}>
        {unit}
      </text>
      <text x={(AREA.left + AREA.right) / 2} y={HEIGHT - 4} text-anchor="middle">
        {below}
      </text>
      {children(up)}
    </svg>
  );
}

/** The volume at a moment, between the points of the curve. */
function volumeAt({ curve }: BeatReport, turns: number): number {
  const place = turns * curve.length;
  const [from, to] = [curve[Math.floor(place) % curve.length]!, curve[Math.ceil(place) % curve.length]!];
  return from.cavity_ml + (place % 1) * (to.cavity_ml - from.cavity_ml);
}

/** The curve with the gates, the marks of end diastole and end systole, and where `scene` is in the beat. */
export function VolumeCurve({ report, scene }: { report: BeatReport; scene: Beating | null }) {
  const { curve, gates } = report;
  const width = 360 / gates.length;
  const marks = [
    ["ED", report.end_diastole_degrees, report.edv_ml],
    ["ES", report.end_systole_degrees, report.esv_ml],
  ] as const;
  const points = [...curve, { degrees: 360, cavity_ml: curve[0]?.cavity_ml ?? 0 }];
  const few = gates.length <= 16;
  return (
    <Frame
      name={`Volume of the cavity over the beat: largest ${number(report.edv_ml, 0, "ml")}, smallest ${number(report.esv_ml, 0, "ml")}`}
      highest={Math.max(...points.map(point => point.cavity_ml), ...gates.map(gate => gate.cavity_ml))}
      unit="ml"
      below="gate"
      onPick={degrees => scene?.hold(degrees / 360, gates.length)}>
      {up => (
        <>
          {gates.map(({ gate, cavity_ml }) => (
            <g key={gate}>
              <line
                class="gate-line"
                x1={across(width * (gate - 1)) + 1.5}
                x2={across(width * gate) - 1.5}
                y1={up(cavity_ml)}
                y2={up(cavity_ml)}
              />
              {(few || gate % 4 === 1) && (
                <text x={across(width * (gate - 0.5))} y={AREA.bottom + 14} text-anchor="middle">
                  {gate}
                </text>
              )}
            </g>
          ))}
          <polyline
            points={points
              .map(point => `${across(point.degrees).toFixed(1)},${up(point.cavity_ml).toFixed(1)}`)
              .join(" ")}
          />
          {marks.map(([name, degrees, ml]) => (
            <g key={name}>
              <circle cx={across(degrees)} cy={up(ml)} r={3.5} />
              <text
                class="mark"
                x={Math.max(AREA.left + 10, Math.min(AREA.right - 10, across(degrees)))}
                y={name === "ED" ? up(ml) - 8 : Math.min(AREA.bottom - 3, up(ml) + 15)}
                text-anchor="middle">
                {name}
              </text>
            </g>
          ))}
          {scene && <Now scene={scene} report={report} up={up} />}
        </>
      )}
    </Frame>
  );
}

/** The moving mark. */
function Now({ scene, report, up }: { scene: Beating; report: BeatReport; up: (value: number) => number }) {
  const turns = useWatched(scene.moment);
  if (turns === null) return null;
  const x = across(360 * turns);
  return (
    <g class="now">
      <line x1={x} x2={x} y1={AREA.top} y2={AREA.bottom} />
      <circle cx={x} cy={up(volumeAt(report, turns))} r={4.5} />
    </g>
  );
}

interface CurvesProps {
  /** Whose curves, each with the name by which its colour is known. */
  of: [string, BeatReport][];
  scene: Beating;
  /** Gates of one cycle of what beats. */
  gates: number;
}

/** The curves of several beats at the same moments of their cycles. */
export function VolumeCurves({ of, scene, gates }: CurvesProps) {
  return (
    <Frame
      name={`Volumes of the cavity over the cycle: ${of.map(([name, { edv_ml, esv_ml }]) => `at ${name} largest ${number(edv_ml, 0, "ml")}, smallest ${number(esv_ml, 0, "ml")}`).join("; ")}`}
      highest={Math.max(...of.flatMap(([, { curve }]) => curve.map(point => point.cavity_ml)))}
      unit="ml"
      below="per cent of the cycle"
      onPick={degrees => scene.hold(degrees / 360, gates)}>
      {up => (
        <>
          {[0, 25, 50, 75, 100].map(share => (
            <text key={share} x={across(3.6 * share)} y={AREA.bottom + 14} text-anchor="middle">
              {share}
            </text>
          ))}
          {of.map(([name, report]) => (
            <g key={name} class={name}>
              <polyline
                points={[...report.curve, { degrees: 360, cavity_ml: report.curve[0]?.cavity_ml ?? 0 }]
                  .map(point => `${across(point.degrees).toFixed(1)},${up(point.cavity_ml).toFixed(1)}`)
                  .join(" ")}
              />
              {(
                [
                  [report.end_diastole_degrees, report.edv_ml],
                  [report.end_systole_degrees, report.esv_ml],
                ] as const
              ).map(([degrees, ml]) => (
                <circle key={degrees} cx={across(degrees)} cy={up(ml)} r={3.5} />
              ))}
              <Now scene={scene} report={report} up={up} />
            </g>
          ))}
        </>
      )}
    </Frame>
  );
}

interface HistogramProps {
  report: BeatReport;
  /** What stands before its name, where there are several. */
  of?: string;
  /** The share of the wall at which the axis ends, where several have the same. */
  highest?: number;
}

/** The greatest share of the wall in one bin. */
export function highestOf({ phase }: BeatReport): number {
  return Math.max(0.01, ...phase.histogram);
}

export function PhaseHistogram({ report, of = "", highest = highestOf(report) }: HistogramProps) {
  const { phase } = report;
  const width = across(phase.bin_degrees) - across(0);
  return (
    <Frame
      name={`${of && `${of}: `}Phases of the wall: mean ${number(phase.mean_degrees, 0, "°")}, standard deviation ${number(phase.sd_degrees, 0, "°")}, bandwidth ${number(phase.bandwidth_degrees, 0, "°")}${phase.reliable ? "" : "; not reliable"}`}
      highest={100 * highest}
      unit="% of the wall"
      below="degrees of the cycle">
      {up => (
        <>
          {phase.histogram.map(
            (share, bin) =>
              share > 0 && (
                <rect
                  key={bin}
                  x={across(phase.bin_degrees * bin) + 0.3}
                  width={width - 0.6}
                  y={up(100 * share)}
                  height={AREA.bottom - up(100 * share)}
                />
              ),
          )}
          {[0, 90, 180, 270, 360].map(degrees => (
            <text key={degrees} x={across(degrees)} y={AREA.bottom + 14} text-anchor="middle">
              {degrees}
            </text>
          ))}
        </>
      )}
    </Frame>
  );
}
