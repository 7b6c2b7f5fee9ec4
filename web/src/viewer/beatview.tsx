// What was measured of a beat beside its figures: curve, phases, and maps of the wall.

import { useMemo } from "preact/hooks";
import { PartTable, rowsOf } from "../figures";
import type { BeatReport, Perfusion, PolarFigure } from "../generated/openapi";
import { useWatched } from "../state";
import { number } from "../words";
import { useCanvas } from "./canvas";
import { PhaseHistogram, VolumeCurve } from "./charts";
import type { Lut } from "./colours";
import { FiguresBeside, LimitsUsed, PerfusionTable, SegmentScores } from "./comparedfacts";
import type { Loaded, LoadedBeat } from "./loaded";
import {
  type DrawnMap,
  FIGURES,
  WallFrame,
  drawPolar,
  figureLut,
  figureMap,
  placeOnMap,
  segmentAt,
  uptakeMap,
} from "./polar";
import type { Scene } from "./scene";
import { ColourBar } from "./wall";

export interface NamedMap {
  name: string;
  map: DrawnMap;
  /** Its colours; null: those chosen for the uptake. */
  lut: Lut | null;
}

/** Uptake of end diastole and end systole, motion, thickening and phase. */
export function mapsOf({ figures }: Loaded, { ends }: LoadedBeat): NamedMap[] {
  const uptake = ends
    ? ["Uptake, end diastole", "Uptake, end systole"].map(
        (name, n): NamedMap => ({ name, map: uptakeMap(ends[n]!), lut: null }),
      )
    : [];
  return [
    ...uptake,
    ...figures
      .filter(map => !ofLimits(map))
      .map((map): NamedMap => ({ name: FIGURES[map.figure].name, map: figureMap(map), lut: figureLut(map.figure) })),
  ];
}

/** Whether a map shows the uptake beside normal limits. */
function ofLimits({ figure }: PolarFigure): boolean {
  return figure === "z" || figure === "score";
}

/** The maps of the uptake beside normal limits; none without them. */
export function limitMapsOf({ figures }: Pick<Loaded, "figures">): NamedMap[] {
  return figures.filter(ofLimits).map(
    (map): NamedMap => ({
      name: map.figure === "z" ? "z" : "Score",
      map: figureMap(map),
      lut: figureLut(map.figure),
    }),
  );
}

/** What was measured against normal limits: figures, both maps, and of whom the limits are. */
export function PerfusionView({ scene, shown }: { scene: Scene; shown: Loaded }) {
  const perfusion = perfusionOf(shown);
  const maps = useMemo(() => limitMapsOf(shown), [shown]);
  const { heart, mesh } = shown;
  if (!perfusion) return null;
  return (
    <section class="perfusion figures" aria-label="Beside normal limits">
      <h2>Beside normal limits</h2>
      <PerfusionTable of={[["this scan", perfusion]]} />
      {heart && (
        <div class="maps">
          {maps.map(one => (
            <SmallMap
              key={one.name}
              scene={scene}
              named={one}
              frame={new WallFrame(mesh, heart, one.map.rows, one.map.columns)}
            />
          ))}
        </div>
      )}
      <LimitsUsed perfusion={perfusion} />
      <details>
        <summary>Scores of the segments</summary>
        <SegmentScores perfusion={perfusion} />
      </details>
      <FiguresBeside perfusion={perfusion} />
    </section>
  );
}

/** The uptake of a fit or beat beside normal limits. */
export function perfusionOf({ report, beat }: Loaded): Perfusion | null {
  return report?.perfusion ?? beat?.report.perfusion ?? null;
}

export function BeatCharts({ scene, report }: { scene: Scene; report: BeatReport }) {
  return (
    <section class="charts" aria-label="Curves">
      <h2>Volume</h2>
      <VolumeCurve report={report} scene={scene} />
      <h2>Phases of the wall</h2>
      <PhaseHistogram report={report} />
      {!report.phase.reliable && <p class="warning">The phases are not reliable: too little of the wall moves.</p>}
    </section>
  );
}

export function BeatMaps({ scene, shown, beat }: { scene: Scene; shown: Loaded; beat: LoadedBeat }) {
  const maps = useMemo(() => mapsOf(shown, beat), [shown, beat]);
  const { heart, mesh } = shown;
  return (
    <section class="beat-maps" aria-label="Maps of the beat">
      {heart && (
        <div class="maps">
          {maps.map(one => (
            <SmallMap
              key={one.name}
              scene={scene}
              named={one}
              frame={new WallFrame(mesh, heart, one.map.rows, one.map.columns)}
            />
          ))}
        </div>
      )}
      <details>
        <summary>Segments</summary>
        <SegmentTable report={beat.report} />
      </details>
    </section>
  );
}

export function SegmentTable({ report }: { report: BeatReport }) {
  return (
    <PartTable
      caption="Motion, thickening and phase of the segments"
      head="Segment"
      parts={report.segments}
      nameOf={one => `${one.segment} ${one.name}`}
      rows={rowsOf("SegmentMotionReport")}
    />
  );
}

/** A map that a press takes the cursor to; the place of the cursor is marked on it. */
function SmallMap({ scene, named: { name, map, lut }, frame }: { scene: Scene; named: NamedMap; frame: WallFrame }) {
  const chosen = useWatched(scene.wallLut);
  const cursor = useWatched(scene.cursor);
  const colours = lut ?? chosen;
  const [rows, columns] = frame.place(cursor);
  const onWall = rows >= 0 && rows <= map.rows + 1;
  const draw = (element: HTMLCanvasElement) => {
    const context = element.getContext("2d");
    if (context)
      drawPolar(context, map, element.clientWidth, element.width / element.clientWidth, {
        lut: colours,
        segments: false,
        threshold: true,
        territories: false,
        cursor: onWall ? [rows, columns] : null,
      });
  };
  const { canvas } = useCanvas(draw, () => () => undefined, map);
  const segment = onWall ? segmentAt(map, rows, columns) : undefined;
  return (
    <figure class="polar">
      <canvas
        ref={canvas}
        role="img"
        aria-label={`${name}: ${map.segments.map(one => `${one.name} ${number(one.mean, map.digits, map.unit)}`).join(", ")}`}
        onPointerDown={event => {
          const place = placeOnMap(map, event.offsetX, event.offsetY, event.currentTarget.clientWidth);
          if (place) scene.cursor.value = frame.at(...place);
        }}
      />
      <figcaption>
        <b>{name}</b>
        <ColourBar lut={colours} low={String(map.range[0])} high={`${map.range[1]} ${map.unit}`} />
        <span class="quiet">
          {segment ? `${segment.name} ${number(segment.mean, map.digits, map.unit)}` : "\u00a0"}
        </span>
      </figcaption>
    </figure>
  );
}
