// What is printed of a comparison: one page.

import type { Volume } from "../api";
import { moment, nameOf, number } from "../words";
import { type Compared, type ComparedHeart, type NamedMap, mapsOf } from "./compared";
import { correctedWords } from "./comparedcorrection";
import {
  BothMeasures,
  Headlines,
  Outdated,
  LimitsUsed,
  PerfusionTable,
  Reasons,
  SimulatedNote,
  TerritoryTable,
  attenuationNotes,
  madeWith,
} from "./comparedfacts";
import { drawMap } from "./comparedmaps";
import type { ComparedScene } from "./comparedscene";
import { shownAs } from "./comparedlook";
import { drawSlices } from "./comparedslices";
import { drawWall } from "./heartwall";
import { Scale } from "./mapsrow";
import { Drawn, Foot, Head, RATIO } from "./sheetparts";
import { byMap, coloursOf } from "./wall";

/** CSS pixels of the slices, of a map and of a wall on paper before they are brought to the width of their place. */
const [WIDTH, HEIGHT, MAP, WALL] = [700, 500, 190, 160];

interface Props {
  compared: Compared;
  scene: ComparedScene;
  scans: { stress: Volume; rest: Volume };
}

export function ComparisonSheet({ compared, scene, scans }: Props) {
  const { report, result, stress, rest } = compared;
  const maps = mapsOf(compared);
  const lut = scene.lut.value;
  const beside = (["stress", "rest"] as const).flatMap(scan => {
    const { perfusion } = report[scan];
    return perfusion ? [[scan, perfusion] as [string, typeof perfusion]] : [];
  });
  const uptake = maps.filter(map => map.figure === "uptake");
  const wall = (one: ComparedHeart, n: number) => {
    const named = uptake[n];
    if (!one.heart || !named) return null;
    const colours = coloursOf(byMap(one.mesh, named.map, one.heart), {
      lut,
      range: named.map.range,
      below: named.map.below,
    });
    return (
      <Drawn
        width={WALL}
        height={WALL}
        name={`The wall at ${one.scan}`}
        draw={element => drawWall(element, one, colours, scene.seen.value, WALL, RATIO)}
      />
    );
  };
  const map = (named: NamedMap) => (
    <figure key={named.name}>
      <Drawn
        width={MAP}
        height={MAP}
        name={named.name}
        draw={element => {
          const context = element.getContext("2d");
          if (context) drawMap(context, named, report, scene.written.value, lut, MAP, RATIO, null);
        }}
      />
      <figcaption>
        <span>{named.short}</span>
        <Scale named={named} lut={lut} />
      </figcaption>
    </figure>
  );
  return (
    <section class="paper comparison-paper">
      <Head volume={scans.stress} title="Left ventricle: rest and stress">
        Compared {moment(result.created_at)}
      </Head>
      <div class="scans-line">
        {(["stress", "rest"] as const).map(scan => (
          <span key={scan}>
            <b>{scan === "stress" ? "Stress" : "Rest"}</b> {nameOf(scans[scan])}
            {madeWith(report[scan]) && ` · ${madeWith(report[scan])}`}
            {correctedWords(result, scan) && ` · corrected by hand: ${correctedWords(result, scan)}`}
          </span>
        ))}
        <SimulatedNote report={report} />
      </div>
      <Outdated made={result} />
      <Headlines report={report} />
      <BothMeasures report={report} />
      <Drawn
        width={WIDTH}
        height={HEIGHT}
        name="Slices of stress above those of rest"
        draw={element =>
          drawSlices(element, compared, scene, { width: WIDTH, height: HEIGHT, ratio: RATIO, moment: null })
        }
      />
      <div class={beside.length > 0 ? "sheet-lower" : ""}>
        <div class={`sheet-maps${maps.length > 3 ? " many" : ""}`}>
          {maps.slice(0, 3).map(map)}
          {[stress, rest].slice(0, maps.length > 3 ? 1 : 2).map((one, n) => (
            <figure key={one.scan}>
              {wall(one, n)}
              <figcaption>{one.scan === "stress" ? "Stress" : "Rest"}, wall</figcaption>
            </figure>
          ))}
          {maps.slice(3).map(map)}
        </div>
        {beside.length > 0 && (
          <div class="figures">
            <PerfusionTable of={beside} />
            {beside.slice(0, 1).map(([scan, perfusion]) => (
              <LimitsUsed key={scan} perfusion={{ ...perfusion, flags: [] }} />
            ))}
          </div>
        )}
      </div>
      <div class={beside.length > 0 ? "sheet-reasons" : "sheet-words"}>
        <Reasons report={report} />
        {beside.length === 0 && (
          <div class="figures">
            <TerritoryTable report={report} />
          </div>
        )}
      </div>
      <p class="quiet">
        Slices: {shownAs(scene)}. Maps: uptake in per cent of the hottest quarter of each scan’s own wall; where stress
        is compared with rest, it was scaled by {number(1 / report.scale, 2)} over{" "}
        {number(report.matched_percent, 0, "%")} of the wall. {attenuationNotes(report)} Comparison{" "}
        <code>{result.id}</code>; stress <code>{scans.stress.id}</code>, rest <code>{scans.rest.id}</code>.
      </p>
      <Foot page={1} of={1} />
    </section>
  );
}
