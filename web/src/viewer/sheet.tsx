// What the viewer prints: two pages of paper, of a beat one, the figures that matter first.

import type { ComponentChildren } from "preact";
import { resultName } from "../resultnames";
import { counts, isFit, moment, number, shape } from "../words";
import { BeatSheet } from "./beatsheet";
import type { Camera } from "./camera";
import { DIVERGING, LUTS, UPTAKE } from "./colours";
import { drawSlice } from "./drawing";
import { Figures, Verdict, headlines } from "./figures";
import { FlatView } from "./flatview";
import type { Loaded } from "./loaded";
import { PATIENT, frameOf, heartPlanes } from "./plane";
import { drawPolar, hasValvePlane, uptakeMap } from "./polar";
import type { Scene } from "./scene";
import { BesideLimits, Drawn, Foot, Head, type Printed, RATIO } from "./sheetparts";
import { drawStack } from "./stack";
import { add, scale, unit } from "./vector";
import { ColourBar, coloursOf, uptakeOf, wallCamera } from "./wall";

/** What is printed of a result. */
export function sheetOf(printed: Printed): ComponentChildren {
  return printed.shown.beat ? <BeatSheet {...printed} beat={printed.shown.beat} /> : <Sheet {...printed} />;
}

function Sheet({ scene, volume, shown, other, parameters }: Printed) {
  const heart = shown.heart ?? scene.heart.value;
  const planes = heart ? heartPlanes(heart) : PATIENT;
  const { polar } = shown;
  const parent = shown.result.parameters["model"];
  return (
    <>
      <section class="paper">
        <Head volume={volume} title={isFit(shown.result.id) ? "Left ventricle: fit" : "Left ventricle: surface model"}>
          {resultName(shown.result)} of {moment(shown.result.created_at)}
        </Head>
        <div class="beside">
          {polar && (
            <figure>
              <Drawn
                width={360}
                height={360}
                name="Polar map"
                draw={element => {
                  const context = element.getContext("2d");
                  if (context)
                    drawPolar(context, uptakeMap(polar), 360, RATIO, {
                      lut: scene.wallLut.value,
                      segments: false,
                      threshold: true,
                      territories: false,
                      cursor: null,
                    });
                }}
              />
              <figcaption>
                <span>
                  Uptake; the line encloses what is below {number(polar.threshold_percent, 0, "%")}
                  {hasValvePlane(polar) && "; hatched: valve plane, in no figure"}
                </span>
                <ColourBar lut={scene.wallLut.value} low="0" high="100 %" />
              </figcaption>
            </figure>
          )}
          <div>
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
            {shown.report && <Verdict shown={shown} open />}
          </div>
        </div>
        <div class="three">
          {planes.map(plane => (
            <figure key={plane.name}>
              <Drawn
                width={230}
                height={230}
                name={plane.name}
                draw={element =>
                  drawSlice(element, scene, plane, {
                    width: 230,
                    height: 230,
                    ratio: RATIO,
                    letters: true,
                    cursor: false,
                  })
                }
              />
            </figure>
          ))}
        </div>
        {heart && (
          <Drawn
            width={690}
            height={88}
            name="Short axis from apex to base"
            draw={element =>
              drawStack(element, scene, heartPlanes(heart)[0]!, { width: 690, height: 88, ratio: RATIO, cursor: false })
            }
          />
        )}
        <Legend scene={scene} />
        <BesideLimits shown={shown} />
        <Foot page={1} />
      </section>
      <section class="paper">
        <Head volume={volume} title="Particulars" />
        <div class="columns">
          <Figures shown={shown} other={other} verdict={false} />
          <div>
            {polar && (
              <table class="segments">
                <caption>Segments of the American Heart Association</caption>
                <thead>
                  <tr>
                    <th scope="col">Segment</th>
                    <th scope="col">uptake</th>
                    <th scope="col">below {number(polar.threshold_percent, 0, "%")}</th>
                  </tr>
                </thead>
                <tbody>
                  {polar.segments.map(one => (
                    <tr key={one.number}>
                      <th scope="row">
                        {one.number} {one.name}
                      </th>
                      <td>{number(one.mean_percent, 0, "%")}</td>
                      <td>{number(one.extent_percent, 0, "%")}</td>
                    </tr>
                  ))}
                  {polar.territories.map(one => (
                    <tr key={one.name}>
                      <th scope="row">{one.name}</th>
                      <td>{number(one.mean_percent, 0, "%")}</td>
                      <td>{number(one.extent_percent, 0, "%")}</td>
                    </tr>
                  ))}
                </tbody>
              </table>
            )}
          </div>
        </div>
        {polar?.note && <p class="quiet">Uptake: {polar.note}.</p>}
        {polar?.attenuation && <p class="quiet">{polar.attenuation.note}</p>}
        <Walls scene={scene} shown={shown} />
        <h2>How it was made</h2>
        <p>
          {volume.format}, {shape(volume)}, stored {moment(volume.created_at)} as <code>{volume.id}</code>. Result{" "}
          <code>{shown.result.id}</code>
          {typeof parent === "string" && (
            <>
              , model <code>{parent}</code>
            </>
          )}
          .{" "}
          {parameters.length === 0
            ? "All parameters had their defaults."
            : `Parameters other than the defaults: ${parameters.map(([name, value]) => `${name} = ${value}`).join("; ")}.`}
        </p>
        {other && (
          <p>
            Compared with {resultName(other.result)} of {moment(other.result.created_at)},{" "}
            <code>{other.result.id}</code>.
          </p>
        )}
        {(shown.report?.warnings ?? []).map(text => (
          <p key={text}>{text}</p>
        ))}
        <Foot page={2} />
      </section>
    </>
  );
}

/** The wall from both sides in the colours of the uptake; of a model, of its distance to the surface. */
function Walls({ scene, shown }: { scene: Scene; shown: Loaded }) {
  const heart = shown.heart;
  const byDistance = shown.surface !== null;
  const paint = byDistance
    ? { lut: DIVERGING, range: [-2, 2] as [number, number] }
    : { lut: scene.wallLut.value ?? LUTS[UPTAKE]!, range: [0, 100] as [number, number] };
  const colours = coloursOf(shown.surface ?? uptakeOf(scene, shown), paint);
  const near = wallCamera(shown.mesh, heart);
  const far = { ...near, toward: scale(near.toward, -1) };
  if (heart) {
    const { anterior, lateral, axis } = frameOf(heart);
    far.toward = unit(add(add(scale(lateral, -0.65), scale(anterior, -0.55)), scale(axis, 0.52)));
    far.up = unit(
      add(
        scale(axis, -1),
        scale(
          far.toward,
          axis.reduce((sum, part, n) => sum + part * far.toward[n]!, 0),
        ),
      ),
    );
  }
  const draw = (camera: Camera) => (element: HTMLCanvasElement) => {
    const view = new FlatView(element, "#ffffff");
    view.camera = camera;
    view.setSurface("wall", shown.mesh, colours);
    view.draw();
  };
  return (
    <figure class="walls">
      <Drawn width={270} height={270} name="The wall" draw={draw(near)} />
      <Drawn width={270} height={270} name="The wall from the other side" draw={draw(far)} />
      <figcaption>
        <span>
          {heart ? "From anterior and lateral; from inferior and septal" : "From in front; from behind"}
          {byDistance ? ": distance to the surface" : ""}
        </span>
        <ColourBar lut={paint.lut} low={String(paint.range[0])} high={`${paint.range[1]} ${byDistance ? "mm" : "%"}`} />
      </figcaption>
    </figure>
  );
}

function Legend({ scene }: { scene: Scene }) {
  const { low, high } = scene.window.value;
  const layers = scene.layers.value.filter(layer => layer.shown);
  return (
    <p class="legend">
      {layers.map(layer => (
        <span key={layer.name}>
          <svg viewBox="0 0 18 6" aria-hidden="true">
            <line
              x1="1"
              y1="3"
              x2="17"
              y2="3"
              stroke={layer.colour}
              stroke-width="3"
              stroke-dasharray={layer.dashed ? "3 3" : undefined}
            />
          </svg>{" "}
          {layer.name}
        </span>
      ))}
      <ColourBar lut={scene.lut.value} low={counts(low)} high={counts(high)} />
    </p>
  );
}
