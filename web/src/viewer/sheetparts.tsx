// What the sheets of paper share: how they are printed, their head and foot, pictures drawn for paper, normal limits.

import { type ComponentChildren, render } from "preact";
import type { Volume } from "../api";
import { moment, nameOf, study } from "../words";
import { limitMapsOf, perfusionOf } from "./beatview";
import { LimitsUsed, PerfusionTable } from "./comparedfacts";
import type { Loaded } from "./loaded";
import { drawPolar } from "./polar";
import type { Scene } from "./scene";
import { ColourBar } from "./wall";

/** Pixels of paper for one CSS pixel: 96 x 3 to the inch. */
export const RATIO = 3;

export interface Printed {
  scene: Scene;
  volume: Volume;
  shown: Loaded;
  other: Loaded | null;
  /** The parameters that differ from the defaults. */
  parameters: [string, string][];
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

export function Drawn({
  width,
  height,
  name,
  draw,
}: {
  width: number;
  height: number;
  name: string;
  draw: (element: HTMLCanvasElement) => void;
}) {
  return (
    <canvas
      role="img"
      aria-label={name}
      ref={element => {
        if (!element) return;
        Object.assign(element, { width: width * RATIO, height: height * RATIO });
        draw(element);
      }}
    />
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
          <Drawn
            width={180}
            height={180}
            name={name}
            draw={element => {
              const context = element.getContext("2d");
              if (context && lut)
                drawPolar(context, map, 180, RATIO, {
                  lut,
                  segments: false,
                  threshold: false,
                  territories: false,
                  cursor: null,
                });
            }}
          />
          <figcaption>
            <span>{name}</span>
            {lut && <ColourBar lut={lut} low={String(map.range[0])} high={`${map.range[1]} ${map.unit}`} />}
          </figcaption>
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
      <p>
        <b>{study(volume) || nameOf(volume)}</b>
        {study(volume) && ` · ${nameOf(volume)}`}
      </p>
      {children && <p class="quiet">{children}</p>}
    </header>
  );
}

export function Foot({ page, of = 2 }: { page: number; of?: number }) {
  return (
    <footer>
      ventriform: research software, not a medical device. Measurements are not a diagnosis. Printed{" "}
      {moment(new Date().toISOString())}. Page {page} of {of}
    </footer>
  );
}
