// Polar maps of a comparison beside each other, with one cursor on all of them.

import { useMemo } from "preact/hooks";
import type { ComparisonReport } from "../generated/openapi";
import { useWatched } from "../state";
import { number } from "../words";
import { type Compared, type NamedMap, mapsOf } from "./compared";
import type { ComparedScene, Written } from "./comparedscene";
import type { Lut } from "./colours";
import { Readout, SharedMap, UptakeColours, lutOf } from "./mapsrow";
import { type DrawnMap, drawPolar } from "./polar";

/** A map of uptake with the scores of its segments written on it. */
function withScores({ scan, map, figure }: NamedMap, { segments }: ComparisonReport): DrawnMap {
  if (figure !== "uptake") return map;
  return {
    ...map,
    segments: map.segments.map(one => {
      const found = segments.find(other => other.segment === one.number);
      return { ...one, mean: (scan === "stress" ? found?.stress_score : found?.rest_score) ?? null };
    }),
  };
}

/** What is drawn of a map, and what is written on it. */
export function drawMap(
  context: CanvasRenderingContext2D,
  named: NamedMap,
  report: ComparisonReport,
  written: Written,
  lut: Lut,
  size: number,
  ratio: number,
  cursor: [number, number] | null,
): void {
  const map = written === "scores" ? withScores(named, report) : named.map;
  drawPolar(context, map, size, ratio, {
    lut: lutOf(named, lut),
    segments: false,
    threshold: true,
    territories: false,
    cursor,
    labels: written === "scores" ? "means" : written,
  });
}

export function ComparedMaps({ compared, scene }: { compared: Compared; scene: ComparedScene }) {
  const maps = useMemo(() => mapsOf(compared), [compared]);
  const written = useWatched(scene.written);
  const hasScores = compared.report.sss != null;
  const choices: [Written, string][] = [
    ["means", "per cent"],
    ...(hasScores ? [["scores", "scores"] as [Written, string]] : []),
    ["numbers", "segments"],
    ["nothing", "nothing"],
  ];
  return (
    <section class="compared-maps" aria-label="Polar maps">
      <div class="toolbar" role="toolbar" aria-label="Polar maps">
        <label class="inline">
          On the maps
          <select value={written} onChange={event => (scene.written.value = event.currentTarget.value as Written)}>
            {choices.map(([value, text]) => (
              <option key={value} value={value}>
                {text}
              </option>
            ))}
          </select>
        </label>
        <UptakeColours lut={scene.lut} />
      </div>
      <div class={`maps${maps.length > 3 ? "" : " few"}`}>
        {maps.slice(0, 3).map(named => (
          <OneMap key={named.name} named={named} compared={compared} scene={scene} />
        ))}
        <Readout
          maps={maps}
          cursor={scene.cursor}
          hint="Press on a map or a slice to read all of them there."
          more={segment => {
            const found = compared.report.segments.find(one => one.segment === segment);
            return found ? [["Reversible part", number(found.reversible_percent, 0, "%")]] : [];
          }}
        />
        {maps.slice(3).map(named => (
          <OneMap key={named.name} named={named} compared={compared} scene={scene} />
        ))}
      </div>
      {!(compared.stress.oriented && compared.rest.oriented) && (
        <p class="warning">
          The anterior side is unknown: segments have no names, and both hearts may be turned against each other.
        </p>
      )}
    </section>
  );
}

function OneMap({ named, compared, scene }: { named: NamedMap; compared: Compared; scene: ComparedScene }) {
  const lut = useWatched(scene.lut);
  const written = useWatched(scene.written);
  return (
    <SharedMap
      named={named}
      lut={lut}
      cursor={scene.cursor}
      draw={(context, size, ratio, place) => drawMap(context, named, compared.report, written, lut, size, ratio, place)}
    />
  );
}
