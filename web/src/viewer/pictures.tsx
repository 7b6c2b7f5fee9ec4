// Slices, wall and short-axis row of one scan, and what people choose about them.

import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useWatched } from "../state";
import { counts } from "../words";
import { LUT } from "./colours";
import { PATIENT, heartPlanes } from "./plane";
import type { Layer, Scene, Tool } from "./scene";
import { screenshot } from "./screenshot";
import { HEART_WIDTH, type Shown, layersOf } from "./shown";
import { Slice } from "./slice";
import { Stack } from "./stack";
import { ColourBar, LutChoice, Wall, uptake } from "./wall";

interface Props {
  scene: Scene;
  /** The name of the scan. */
  name: string;
  shown: Shown | null;
  other: Shown | null;
  /** Stands where the wall will be. */
  empty: string;
  /** What goes on meanwhile. */
  children?: ComponentChildren;
}

export function Pictures({ scene, name, shown, other, empty, children }: Props) {
  const [heartAligned, setHeartAligned] = useState(true);
  const [big, setBig] = useState<number | null>(null);
  const heart = useWatched(scene.heart);
  const layers = useWatched(scene.layers);
  const window_ = useWatched(scene.window);
  const tool = useWatched(scene.tool);
  const lut = useWatched(scene.lut);
  const edit = useWatched(scene.edit);
  const difference = useWatched(scene.difference);
  const smooth = useWatched(scene.smooth);
  const stage = useRef<HTMLDivElement>(null);
  const [help, setHelp] = useState(false);
  const [aside, setAside] = useState(false);

  // Each result brings its contours and its axis; the cursor goes to the heart the first time.
  useEffect(() => {
    const before = new Map(scene.layers.value.map(layer => [layer.name, layer.shown]));
    scene.layers.value = layersOf(shown, other).map(layer => ({
      ...layer,
      shown: before.get(layer.name) ?? layer.shown,
    }));
    scene.difference.value = null;
    const first = scene.heart.value === null;
    scene.heart.value = shown?.heart ?? other?.heart ?? scene.heart.value;
    if (shown && first) {
      scene.cursor.value = shown.middle;
      scene.view.value = { width: HEART_WIDTH, middle: scene.heart.value ? null : shown.middle };
      // The window reaches to the wall's own maximum: liver and gut may be hotter.
      const hottest = Math.max(...uptake(scene.still, shown.mesh));
      if (hottest > scene.still.lowest) scene.window.value = { low: scene.window.value.low, high: hottest };
    }
    if (!shown && scene.view.value.width === 0) scene.view.value = { width: 260, middle: null };
  }, [scene, shown, other]);
  const gates = useWatched(scene.gates);
  useEffect(() => {
    const walls = shown?.gates;
    if (!walls || walls.length !== gates.length) return;
    const brightest = walls.map((wall, n) => (gates[n] ? Math.max(...uptake(gates[n], wall)) : NaN));
    const share = Math.max(...brightest) / Math.max(...uptake(scene.still, shown.mesh));
    if (share > 0) scene.gateShare.value = share;
  }, [scene, shown, gates]);
  const aligned = heart && heartAligned;
  const planes = useMemo(() => (aligned ? heartPlanes(heart) : PATIENT), [aligned, heart]);
  const [rowPlane, setRowPlane] = useState(0);
  const rows = useMemo(() => (heart ? heartPlanes(heart) : []), [heart]);
  const row = rows[rowPlane];
  const toggle = (name: string) =>
    (scene.layers.value = layers.map(layer => (layer.name === name ? { ...layer, shown: !layer.shown } : layer)));
  const masks =
    shown?.mask && (other?.mask ?? shown.expert) ? { fit: shown.mask, other: (other?.mask ?? shown.expert)! } : null;

  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (event.ctrlKey || event.metaKey || event.altKey || ["INPUT", "SELECT", "TEXTAREA"].includes(target.tagName))
        return;
      const keys: Record<string, () => void> = {
        h: () => setHeartAligned(now => !now),
        c: () => {
          const any = scene.layers.value.some(layer => layer.shown);
          scene.layers.value = scene.layers.value.map(layer => ({ ...layer, shown: !any }));
        },
        f: () => void (document.fullscreenElement ? document.exitFullscreen() : stage.current?.requestFullscreen()),
        w: () => (scene.tool.value = scene.tool.value === "window" ? "cursor" : "window"),
        m: () => (scene.tool.value = scene.tool.value === "move" ? "cursor" : "move"),
        "?": () => setHelp(now => !now),
        Escape: () => setBig(null),
      };
      keys[event.key]?.();
    };
    addEventListener("keydown", press);
    return () => removeEventListener("keydown", press);
  }, [scene]);

  const range = scene.still.highest - Math.min(0, scene.still.lowest);
  const tools: [Tool, string][] = [
    ["cursor", "Point"],
    ["window", "Window"],
    ["move", "Move"],
  ];
  return (
    <div class="pictures" ref={stage}>
      <div class="toolbar" role="toolbar" aria-label="How to look">
        <span class="choice" role="group" aria-label="Planes">
          <button type="button" aria-pressed={Boolean(aligned)} disabled={!heart} onClick={() => setHeartAligned(true)}>
            Heart
          </button>
          <button type="button" aria-pressed={!aligned} onClick={() => setHeartAligned(false)}>
            Patient
          </button>
        </span>
        <span class="choice" role="group" aria-label="What a drag does">
          {tools.map(([name, text]) => (
            <button
              key={name}
              type="button"
              aria-pressed={tool === name || (name === "cursor" && tool === "correct")}
              onClick={() => (scene.tool.value = name === "cursor" && edit ? "correct" : name)}>
              {text}
            </button>
          ))}
        </span>
        <label class="inline">
          <LutChoice label="Colours" lut={scene.lut} keptAs={LUT} />
        </label>
        <label class="inline brightness">
          <ColourBar lut={lut} low={counts(window_.low)} high={counts(window_.high)} />
          <input
            type="range"
            aria-label="Brightest value"
            min={1}
            max={130}
            value={Math.round((100 * window_.high) / (range || 1))}
            onInput={event =>
              (scene.window.value = { low: window_.low, high: (range * Number(event.currentTarget.value)) / 100 })
            }
          />
        </label>
        <span class="end">
          <button
            type="button"
            class="plain"
            title="Screenshot"
            aria-label="Screenshot"
            onClick={() => stage.current && screenshot(stage.current, name)}>
            <Icon d="M3 6h3l1-2h6l1 2h3v10H3zM10 8a3 3 0 1 0 .01 0" />
          </button>
          <button
            type="button"
            class="plain"
            onClick={() =>
              void (document.fullscreenElement ? document.exitFullscreen() : stage.current?.requestFullscreen())
            }
            title="Full screen"
            aria-label="Full screen">
            <Icon d="M3 8V3h5M12 3h5v5M17 12v5h-5M8 17H3v-5" />
          </button>
          <button
            type="button"
            class="plain"
            title="Keys and mouse"
            aria-label="Keys and mouse"
            aria-expanded={help}
            onClick={() => setHelp(!help)}>
            ?
          </button>
        </span>
      </div>
      {help && <Keys />}
      {layers.length > 0 && (
        <div class="layers" role="group" aria-label="Contours">
          {layers.map(layer => (
            <label key={layer.name} class="inline">
              <input type="checkbox" checked={layer.shown} onChange={() => toggle(layer.name)} />
              <Swatch layer={layer} />
              {layer.name}
            </label>
          ))}
          {masks && (
            <label class="inline">
              <input
                type="checkbox"
                checked={difference !== null}
                onChange={event => (scene.difference.value = event.currentTarget.checked ? masks : null)}
              />
              difference{" "}
              <span class="quiet">
                <span class="only here" /> only here <span class="only there" /> only{" "}
                {other?.mask ? "compared" : "expert"}
              </span>
            </label>
          )}
          {other && (
            <label class="inline">
              <input type="checkbox" checked={aside} onChange={event => setAside(event.currentTarget.checked)} /> walls
              side by side
            </label>
          )}
          <label class="inline">
            <input
              type="checkbox"
              checked={smooth}
              onChange={event => (scene.smooth.value = event.currentTarget.checked)}
            />{" "}
            smooth
          </label>
        </div>
      )}
      {children}
      <div class={`grid${big === null ? "" : " one"}`}>
        {planes.map(
          (plane, n) =>
            (big === null || big === n) && (
              <Slice key={n} scene={scene} plane={plane} onBig={() => setBig(big === n ? null : n)} />
            ),
        )}
        {(big === null || big === 3) &&
          (shown && other && aside ? (
            <div class="pair">
              <Wall scene={scene} {...wallOf(shown)} other={null} title="shown" />
              <Wall scene={scene} {...wallOf(other)} other={null} title="compared" follows />
            </div>
          ) : shown ? (
            <Wall scene={scene} {...wallOf(shown)} other={other?.mesh ?? null} />
          ) : (
            <div class="off">{empty}</div>
          ))}
      </div>
      {row && (
        <div class="row-of-slices">
          <span class="choice" role="group" aria-label="Row of slices">
            {rows.map((plane, n) => (
              <button
                key={plane.short}
                type="button"
                aria-pressed={n === rowPlane}
                title={plane.name}
                onClick={() => setRowPlane(n)}>
                {plane.short}
              </button>
            ))}
          </span>
          <Stack scene={scene} plane={row} />
        </div>
      )}
    </div>
  );
}

function wallOf({ mesh, gates, figures, otherEdge, polar, displacement, surface }: Shown) {
  return { mesh, gates, figures, inner: otherEdge, polar, displacement, surface };
}

function Swatch({ layer }: { layer: Layer }) {
  return (
    <svg class="swatch" viewBox="0 0 18 6" aria-hidden="true">
      <line
        x1="1"
        y1="3"
        x2="17"
        y2="3"
        stroke={layer.colour}
        stroke-width="3"
        stroke-dasharray={layer.dashed ? "3 3" : undefined}
      />
    </svg>
  );
}

function Icon({ d }: { d: string }) {
  return (
    <svg class="icon" viewBox="0 0 20 20" aria-hidden="true">
      <path d={d} />
    </svg>
  );
}

function Keys() {
  const rows = [
    ["Click or drag", "put the cursor there, in all views"],
    ["Wheel, Page Up, Page Down", "through the slices"],
    ["Arrows", "move the cursor; on the 3-D view turn it"],
    ["Shift + drag, right button, [ ]", "window"],
    ["Ctrl + wheel, pinch, + −", "zoom; two fingers move the picture"],
    ["Double click", "one view large, and back"],
    ["H", "heart or patient planes"],
    ["C", "contours on and off"],
    ["W, M", "drag sets the window, moves the picture"],
    ["Home, 0", "back to the heart"],
    ["F", "full screen"],
    ["Space, arrows outside of the views", "a beat: play and pause, gate by gate"],
  ];
  return (
    <dl class="keys">
      {rows.map(([key, what]) => (
        <div key={key}>
          <dt>{key}</dt>
          <dd>{what}</dd>
        </div>
      ))}
    </dl>
  );
}
