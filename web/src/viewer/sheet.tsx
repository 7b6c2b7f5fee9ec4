// What the viewer prints: two pages of paper, of a beat one, the figures that matter first.

import { type ComponentChildren, render } from "preact";
import type { Volume } from "../api";
import { counts, isFit, moment, nameOf, number, resultName, shape, study } from "../words";
import { BeatSheet } from "./beatsheet";
import { limitMapsOf, perfusionOf } from "./beatview";
import { LimitsUsed, PerfusionTable } from "./comparedfacts";
import { type Camera } from "./camera";
import { DIVERGING, LUTS, UPTAKE } from "./colours";
import { drawSlice } from "./drawing";
import { Figures, Verdict, headlines } from "./figures";
import { FlatView } from "./flatview";
import type { Loaded } from "./loaded";
import { PATIENT, frameOf, heartPlanes } from "./plane";
import { drawPolar, hasValvePlane, uptakeMap } from "./polar";
import type { Scene } from "./scene";
import { drawStack } from "./stack";
import { add, scale, unit } from "./vector";
import { ColourBar, coloursOf, uptakeOf, wallCamera } from "./wall";

/** Pixels of paper for one CSS pixel: 96 x 3 to the inch. */
const RATIO = 3;

export interface Printed {
  scene: Scene;
  volume: Volume;
  shown: Loaded;
  other: Loaded | null;
  /** The parameters that differ from the defaults. */
  parameters: [string, string][];
}

/** What is printed of a result. */
export function sheetOf(printed: Printed): ComponentChildren {
  return printed.shown.beat ? <BeatSheet {...printed} beat={printed.shown.beat} /> : <Sheet {...printed} />;
}

/** Puts the sheet into the document while it is printed; the answer stops that. */
export function printsAs(printed: () => ComponentChildren): () => void {
  let host: HTMLElement | null = null;
  const before = () => {
    const now = printed();
    if (!now || host) return;
    host = document.createElement("div");
    host.className = "sheet";
    document.body.append(host);
    render(now, host);
  };
  const after = () => {
    if (!host) return;
    render(null, host);
    host.remove();
    host = null;
  };
  addEventListener("beforeprint", before);
  addEventListener("afterprint", after);
  return () => {
    after();
    removeEventListener("beforeprint", before);
    removeEventListener("afterprint", after);
  };
}

export function Drawn({ width, height, name, draw }: { width: number; height: number; name: string; draw: (element: HTMLCanvasElement) => void }) {
  return (
    <canvas role="img" aria-label={name} ref={element => {
      if (!element) return;
      Object.assign(element, { width: width * RATIO, height: height * RATIO });
      draw(element);
    }} />
  );
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
              <Drawn width={360} height={360} name="Polar map" draw={element => {
                const context = element.getContext("2d");
                if (context) drawPolar(context, uptakeMap(polar), 360, RATIO, { lut: scene.wallLut.value, segments: false, threshold: true, territories: false, cursor: null });
              }} />
              <figcaption>
                <span>Uptake; the line encloses what is below {number(polar.threshold_percent, 0, "%")}{hasValvePlane(polar) && "; hatched: valve plane, in no figure"}</span>
                <ColourBar lut={scene.wallLut.value} low="0" high="100 %" />
              </figcaption>
            </figure>
          )}
          <div>
            <dl class="headlines">
              {headlines(shown).map(([name, value, interval]) => <div key={name}><dt>{name}</dt><dd>{value}{interval && <span class="interval">90 %: {interval}</span>}</dd></div>)}
            </dl>
            {shown.report && <Verdict shown={shown} open />}
          </div>
        </div>
        <div class="three">
          {planes.map(plane => (
            <figure key={plane.name}>
              <Drawn width={230} height={230} name={plane.name} draw={element => drawSlice(element, scene, plane, { width: 230, height: 230, ratio: RATIO, letters: true, cursor: false })} />
            </figure>
          ))}
        </div>
        {heart && <Drawn width={690} height={88} name="Short axis from apex to base" draw={element => drawStack(element, scene, heartPlanes(heart)[0]!, { width: 690, height: 88, ratio: RATIO, cursor: false })} />}
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
                <thead><tr><th scope="col">Segment</th><th scope="col">uptake</th><th scope="col">below {number(polar.threshold_percent, 0, "%")}</th></tr></thead>
                <tbody>
                  {polar.segments.map(one => <tr key={one.number}><th scope="row">{one.number} {one.name}</th><td>{number(one.mean_percent, 0, "%")}</td><td>{number(one.extent_percent, 0, "%")}</td></tr>)}
                  {polar.territories.map(one => <tr key={one.name}><th scope="row">{one.name}</th><td>{number(one.mean_percent, 0, "%")}</td><td>{number(one.extent_percent, 0, "%")}</td></tr>)}
                </tbody>
              </table>
            )}
          </div>
        </div>
        {polar?.note && <p class="quiet">Uptake: {polar.note}.</p>}
        <Walls scene={scene} shown={shown} />
        <h2>How it was made</h2>
        <p>
          {volume.format}, {shape(volume)}, stored {moment(volume.created_at)} as <code>{volume.id}</code>. Result <code>{shown.result.id}</code>
          {typeof parent === "string" && <>, model <code>{parent}</code></>}.{" "}
          {parameters.length === 0 ? "All parameters had their defaults." : `Parameters other than the defaults: ${parameters.map(([name, value]) => `${name} = ${value}`).join("; ")}.`}
        </p>
        {other && <p>Compared with {resultName(other.result)} of {moment(other.result.created_at)}, <code>{other.result.id}</code>.</p>}
        {(shown.report?.warnings ?? []).map(text => <p key={text}>{text}</p>)}
        <Foot page={2} />
      </section>
    </>
  );
}

/** The uptake beside normal limits, on paper. */
export function BesideLimits({ shown }: { shown: Loaded }) {
  const perfusion = perfusionOf(shown);
  if (!perfusion) return null;
  return (
    <div class="beside-limits">
      {limitMapsOf(shown).map(({ name, map, lut }) => (
        <figure key={name}>
          <Drawn width={180} height={180} name={name} draw={element => {
            const context = element.getContext("2d");
            if (context && lut) drawPolar(context, map, 180, RATIO, { lut, segments: false, threshold: false, territories: false, cursor: null });
          }} />
          <figcaption><span>{name}</span>{lut && <ColourBar lut={lut} low={String(map.range[0])} high={`${map.range[1]} ${map.unit}`} />}</figcaption>
        </figure>
      ))}
      <div class="figures">
        <PerfusionTable of={[["this scan", perfusion]]} />
        <LimitsUsed perfusion={{ ...perfusion, flags: [] }} />
      </div>
    </div>
  );
}

export function Head({ volume, title, children }: { volume: Volume; title: string; children?: ComponentChildren }) {
  return (
    <header>
      <h1>{title}</h1>
      <p><b>{study(volume) || nameOf(volume)}</b>{study(volume) && ` · ${nameOf(volume)}`}</p>
      {children && <p class="quiet">{children}</p>}
    </header>
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
    far.up = unit(add(scale(axis, -1), scale(far.toward, axis.reduce((sum, part, n) => sum + part * far.toward[n]!, 0))));
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
        <span>{heart ? "From anterior and lateral; from inferior and septal" : "From in front; from behind"}{byDistance ? ": distance to the surface" : ""}</span>
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
      {layers.map(layer => <span key={layer.name}><svg viewBox="0 0 18 6" aria-hidden="true"><line x1="1" y1="3" x2="17" y2="3" stroke={layer.colour} stroke-width="3" stroke-dasharray={layer.dashed ? "3 3" : undefined} /></svg> {layer.name}</span>)}
      <ColourBar lut={scene.lut.value} low={counts(low)} high={counts(high)} />
    </p>
  );
}

export function Foot({ page, of = 2 }: { page: number; of?: number }) {
  return <footer>ventriform: research software, not a medical device. Measurements are no diagnosis. Printed {moment(new Date().toISOString())}. Page {page} of {of}</footer>;
}
