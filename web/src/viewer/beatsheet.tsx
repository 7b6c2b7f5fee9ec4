// What the viewer prints of a beat: one page.

import { resultName } from "../resultnames";
import { moment, number, shape } from "../words";
import { mapsOf } from "./beatview";
import { PhaseHistogram, VolumeCurve } from "./charts";
import { drawSlice } from "./drawing";
import { Verdict, headlines } from "./figures";
import type { LoadedBeat } from "./loaded";
import { PATIENT, heartPlanes } from "./plane";
import { drawPolar, uptakeMap } from "./polar";
import { BesideLimits, Drawn, Foot, Head, type Printed, RATIO } from "./sheetparts";
import { ColourBar } from "./wall";

/** CSS pixels of a map and of a slice on paper before they are brought to the width of their column. */
const [MAP, SLICE] = [220, 150];

export function BeatSheet({ scene, volume, shown, beat, parameters }: Printed & { beat: LoadedBeat }) {
  const { report } = beat;
  const heart = shown.heart ?? scene.heart.value;
  const planes = heart ? heartPlanes(heart) : PATIENT;
  const gates = report.gates.length;
  const ends = [
    ["End diastole", report.end_diastole_gate],
    ["End systole", report.end_systole_gate],
  ] as const;
  const maps = [
    ...(shown.polar ? [{ name: "Uptake, all gates", map: uptakeMap(shown.polar), lut: null }] : []),
    ...mapsOf(shown, beat),
  ];
  const { phase } = report;
  return (
    <section class="paper beat-paper">
      <Head volume={volume} title="Left ventricle: beat">
        {resultName(shown.result)} of {moment(shown.result.created_at)}
      </Head>
      <dl class="headlines">
        {headlines(shown).map(([name, value, interval]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>
              {value}
              {interval && <span class="interval">90 %: {interval}</span>}
            </dd>
          </div>
        ))}
      </dl>
      <div class="beside">
        <figure>
          <VolumeCurve report={report} scene={null} />
          <figcaption>Volume of the cavity, ml</figcaption>
        </figure>
        <figure>
          <PhaseHistogram report={report} />
          <figcaption>
            Phases of the wall: SD {number(phase.sd_degrees, 0, "°")}, bandwidth{" "}
            {number(phase.bandwidth_degrees, 0, "°")}
            {phase.reliable ? "" : "; not reliable"}
          </figcaption>
        </figure>
      </div>
      <div class="six">
        {ends.flatMap(([name, gate]) =>
          planes.map(plane => (
            <figure key={name + plane.name}>
              <Drawn
                width={SLICE}
                height={SLICE}
                name={`${plane.name}, ${name}`}
                draw={element =>
                  drawSlice(element, scene.at((gate - 0.5) / gates), plane, {
                    width: SLICE,
                    height: SLICE,
                    ratio: RATIO,
                    letters: true,
                    cursor: false,
                  })
                }
              />
              <figcaption>{name}</figcaption>
            </figure>
          )),
        )}
      </div>
      <div class="beside maps-and-words">
        <div class="three">
          {maps.map(({ name, map, lut }) => (
            <figure key={name}>
              <Drawn
                width={MAP}
                height={MAP}
                name={name}
                draw={element => {
                  const context = element.getContext("2d");
                  if (context)
                    drawPolar(context, map, MAP, RATIO, {
                      lut: lut ?? scene.wallLut.value,
                      segments: false,
                      threshold: true,
                      territories: false,
                      cursor: null,
                    });
                }}
              />
              <figcaption>
                <span>{name}</span>
                <ColourBar
                  lut={lut ?? scene.wallLut.value}
                  low={String(map.range[0])}
                  high={`${map.range[1]} ${map.unit}`}
                />
              </figcaption>
            </figure>
          ))}
        </div>
        <div class="words">
          <Verdict shown={shown} open />
          <p class="quiet">
            {volume.format}, {shape(volume)}, <code>{volume.id}</code>; beat <code>{shown.result.id}</code>.{" "}
            {report.rr_ms ? `R-R interval ${number(report.rr_ms, 0, "ms")}. ` : ""}
            {parameters.length === 0
              ? "All parameters had their defaults."
              : `Parameters other than the defaults: ${parameters.map(([name, value]) => `${name} = ${value}`).join("; ")}.`}
          </p>
        </div>
      </div>
      <BesideLimits shown={shown} />
      <Foot page={1} of={1} />
    </section>
  );
}
