// The controls of a beat: play and pause, speed, gate by gate, by buttons and keys.

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useState } from "preact/hooks";
import type { BeatReport } from "../generated/openapi";
import { type Watched, useWatched } from "../state";
import type { Beating } from "./beating";
import type { Scene } from "./scene";

/** Length of the cycle where the R-R interval is not known, ms: that of the animation in `mesh.glb`. */
export const UNKNOWN_CYCLE_MS = 1000;

const SPEEDS = [0.25, 0.5, 1, 2];

/** What happens in a gate, counted from 1. */
export function nameOfGate(report: BeatReport, gate: number): string {
  return gate === report.end_diastole_gate ? "end diastole" : gate === report.end_systole_gate ? "end systole" : "";
}

/** What takes the space bar or the arrows for itself. */
const WRITTEN = "select, textarea, input:not([type=range], [type=checkbox])";
const PRESSED = "button, summary, a, input[type=checkbox]";

export function Player({ scene, report }: { scene: Scene; report: BeatReport }) {
  const gates = report.gates.length;
  useLayoutEffect(() => {
    scene.goTo(scene.moment.value ?? (report.end_diastole_gate - 0.5) / gates, gates);
    return () => {
      scene.moment.value = null;
      scene.gate.value = null;
    };
  }, [scene, report]);
  return (
    <PlayerBar
      scene={scene}
      stops={scene.edit}
      gates={gates}
      read={useWatched(scene.gates).filter(Boolean).length}
      first={report.end_diastole_gate}
      cycle={report.rr_ms ?? UNKNOWN_CYCLE_MS}
      nameOf={gate => nameOfGate(report, gate)}
      // Who asks for less motion starts the beat by hand.
      starts={!matchMedia("(prefers-reduced-motion: reduce)").matches}
    />
  );
}

interface BarProps {
  scene: Beating;
  /** Stops the beat as soon as it holds something. */
  stops?: Watched<unknown>;
  gates: number;
  /** Gates that were read. */
  read: number;
  /** The gate that is shown before any other, counted from 1. */
  first: number;
  /** Length of the cycle, ms. */
  cycle: number;
  nameOf: (gate: number) => string;
  /** Whether it plays by itself. */
  starts: boolean;
  children?: ComponentChildren;
}

/** Controls of what beats, whatever it shows. */
export function PlayerBar({ scene, stops, gates, read, first, cycle, nameOf, starts, children }: BarProps) {
  const shown = useWatched(scene.gate);
  const [playing, setPlaying] = useState(starts);
  const [speed, setSpeed] = useState(1);
  const gateOf = (turns: number | null) => (turns === null ? first : Math.floor(turns * gates) + 1);
  const gate = gateOf(shown);

  const goTo = (wanted: number) => {
    setPlaying(false);
    scene.goTo((((wanted - 1 + gates) % gates) + 0.5) / gates, gates);
  };
  // Keys may follow each other faster than the view is drawn.
  const step = (by: number) => goTo(scene.gate.value === null ? first : gateOf(scene.gate.value) + by);
  // Whoever shows another moment, as a press on the curve does, stops the beat there; so does whoever moves the heart.
  useEffect(() => {
    const ends = [
      scene.held.watch(() => setPlaying(false)),
      ...(stops ? [stops.watch(() => stops.value && setPlaying(false))] : []),
    ];
    return () => ends.forEach(end => end());
  }, [scene, stops]);

  useEffect(() => {
    if (!playing) return;
    const [start, from] = [performance.now(), scene.moment.value ?? (first - 0.5) / gates];
    let asked = 0;
    const draw = (now: number) => {
      scene.goTo((from + (Math.max(0, now - start) * speed) / cycle) % 1, gates);
      asked = requestAnimationFrame(draw);
    };
    asked = requestAnimationFrame(draw);
    return () => cancelAnimationFrame(asked);
  }, [scene, gates, cycle, playing, speed]);

  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const at = event.target as Element;
      if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || at.closest(WRITTEN)) return;
      if (event.key === " " && !at.closest(PRESSED)) setPlaying(now => !now);
      else if (event.key === "ArrowLeft" && !at.closest("input")) step(-1);
      else if (event.key === "ArrowRight" && !at.closest("input")) step(1);
      else return;
      event.preventDefault();
    };
    addEventListener("keydown", press);
    return () => removeEventListener("keydown", press);
  });

  const name = nameOf(gate);
  return (
    <div class="toolbar player" role="group" aria-label="Beat">
      <button type="button" class="main" onClick={() => setPlaying(!playing)}>
        {playing ? "Pause" : "Play"}
      </button>
      <span class="choice">
        <button type="button" aria-label="Gate before" onClick={() => step(-1)}>
          ◀
        </button>
        <button type="button" aria-label="Next gate" onClick={() => step(1)}>
          ▶
        </button>
      </span>
      <input
        type="range"
        aria-label="Gate"
        min={1}
        max={gates}
        value={gate}
        aria-valuetext={shown === null ? "sum of all gates" : `${gate} of ${gates}${name && `, ${name}`}`}
        onInput={event => goTo(Number(event.currentTarget.value))}
      />
      <span class="gate">
        {shown === null ? (
          "sum of all gates"
        ) : (
          <>
            gate {gate} of {gates} <b>{name}</b>
          </>
        )}
      </span>
      {children}
      <label class="inline end">
        Speed
        <select value={speed} onChange={event => setSpeed(Number(event.currentTarget.value))}>
          {SPEEDS.map(one => (
            <option key={one} value={one}>
              {one} ×
            </option>
          ))}
        </select>
      </label>
      {read < gates && (
        <span class="quiet" role="status">
          reading gate {read + 1} …
        </span>
      )}
    </div>
  );
}
