// What is printed of a comparison: one page.

import type { Volume } from "../api";
import { moment, nameOf, number } from "../words";
import { type Compared, type ComparedHeart, mapsOf } from "./compared";
import { Headlines, LimitsUsed, PerfusionTable, Reasons, SimulatedNote, TerritoryTable, madeWith } from "./comparedfacts";
import { drawMap, endsOf, lutOf } from "./comparedmaps";
import { type ComparedScene, FROM_BEHIND, FROM_FRONT } from "./comparedscene";
import { drawSlices } from "./comparedslices";
import { drawWall } from "./heartwall";
import { Drawn, Foot, Head } from "./sheet";
import { ColourBar, byMap, coloursOf } from "./wall";

/** CSS pixels of the slices, of a map and of a wall on paper before they are brought to the width of their place. */
const [WIDTH, HEIGHT, MAP, WALL] = [700, 500, 220, 160];
const RATIO = 3;

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
  const wall = (one: ComparedHeart, n: number, seen: typeof FROM_FRONT, from: string) => {
    const named = uptake[n];
    if (!one.heart || !named) return null;
    const colours = coloursOf(byMap(one.mesh, named.map, one.heart), { lut, range: named.map.range, below: named.map.below });
    return <Drawn key={one.scan + from} width={WALL} height={WALL} name={`The wall at ${one.scan}, ${from}`} draw={element => drawWall(element, one, colours, seen, WALL, RATIO)} />;
  };
  return (
    <section class="paper comparison-paper">
      <Head volume={scans.stress} title="Left ventricle: rest and stress">Compared {moment(result.created_at)}</Head>
      <p class="scans-line">{(["stress", "rest"] as const).map(scan => <span key={scan}><b>{scan === "stress" ? "Stress" : "Rest"}</b> {nameOf(scans[scan])}{madeWith(report[scan]) && ` · ${madeWith(report[scan])}`}</span>)}</p>
      <Headlines report={report} />
      <SimulatedNote report={report} />
      <Drawn width={WIDTH} height={HEIGHT} name="Slices of stress above those of rest" draw={element => drawSlices(element, compared, scene, { width: WIDTH, height: HEIGHT, ratio: RATIO, marks: false })} />
      <div class={`sheet-maps${maps.length > 3 ? " many" : ""}`}>
        {maps.map(named => (
          <figure key={named.name}>
            <Drawn width={MAP} height={MAP} name={named.name} draw={element => {
              const context = element.getContext("2d");
              if (context) drawMap(context, named, report, scene.written.value, lut, MAP, RATIO, null);
            }} />
            <figcaption><span>{named.short}</span><ColourBar lut={lutOf(named, lut)} low={endsOf(named)[0]} high={endsOf(named)[1]} /></figcaption>
          </figure>
        ))}
        {maps.length <= 3 && [stress, rest].map((one, n) => <figure key={one.scan}>{wall(one, n, FROM_FRONT, "from anterior and lateral")}<figcaption>{one.scan === "stress" ? "Stress" : "Rest"}, wall</figcaption></figure>)}
      </div>
      <div class="sheet-words">
        <Reasons report={report} />
        <div class="figures">
          {beside.length > 0 ? <PerfusionTable of={beside} /> : <TerritoryTable report={report} />}
          {beside.slice(0, 1).map(([scan, perfusion]) => <LimitsUsed key={scan} perfusion={{ ...perfusion, flags: [] }} />)}
        </div>
        {maps.length > 3 && <div class="sheet-walls">{wall(stress, 0, FROM_FRONT, "from anterior and lateral")}{wall(rest, 1, FROM_FRONT, "from anterior and lateral")}{wall(stress, 0, FROM_BEHIND, "from inferior and septal")}{wall(rest, 1, FROM_BEHIND, "from inferior and septal")}</div>}
      </div>
      <p class="quiet">
        Uptake in per cent of the hottest quarter of each scan’s own wall; where stress is compared with rest, it was scaled by {number(1 / report.scale, 2)} over {number(report.matched_percent, 0, "%")} of the wall.{" "}
        Comparison <code>{result.id}</code>; stress <code>{scans.stress.id}</code>, rest <code>{scans.rest.id}</code>.
      </p>
      <Foot page={1} of={1} />
    </section>
  );
}
