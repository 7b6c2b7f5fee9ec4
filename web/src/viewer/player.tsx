// The controls of a beat: play and pause, speed, gate by gate, by buttons and keys.

import { useEffect, useLayoutEffect, useState } from "preact/hooks";
import type { BeatReport } from "../generated/openapi";
import { useWatched } from "../state";
import type { Scene } from "./scene";

/** Length of the cycle where the R-R interval is not known, ms: that of the animation in `mesh.glb`. */
const UNKNOWN_CYCLE_MS = 1000;

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
  const shown = useWatched(scene.gate);
  const read = useWatched(scene.gates).filter(Boolean).length;
  // Who asks for less motion starts the beat by hand.
  const [playing, setPlaying] = useState(() => !matchMedia("(prefers-reduced-motion: reduce)").matches);
  const [speed, setSpeed] = useState(1);
  const gateOf = (turns: number | null) => (turns === null ? report.end_diastole_gate : Math.floor(turns * gates) + 1);
  const gate = gateOf(shown);

  const goTo = (wanted: number) => {
    setPlaying(false);
    scene.goTo((((wanted - 1 + gates) % gates) + 0.5) / gates, gates);
  };
  // Keys may follow each other faster than the view is drawn.
  const step = (by: number) => goTo(gateOf(scene.gate.value) + by);
  useLayoutEffect(() => {
    scene.goTo(scene.moment.value ?? (report.end_diastole_gate - 0.5) / gates, gates);
    return () => {
      scene.moment.value = null;
      scene.gate.value = null;
    };
  }, [scene, report]);
  // Whoever shows another moment, as a press on the curve does, stops the beat there; so does whoever moves the heart.
  useEffect(() => {
    const ends = [
      scene.held.watch(() => setPlaying(false)),
      scene.edit.watch(() => scene.edit.value && setPlaying(false)),
    ];
    return () => ends.forEach(end => end());
  }, [scene]);

  useEffect(() => {
    if (!playing) return;
    const [start, from] = [performance.now(), scene.moment.value ?? 0];
    let asked = 0;
    const draw = (now: number) => {
      scene.goTo((from + (Math.max(0, now - start) * speed) / (report.rr_ms ?? UNKNOWN_CYCLE_MS)) % 1, gates);
      asked = requestAnimationFrame(draw);
    };
    asked = requestAnimationFrame(draw);
    return () => cancelAnimationFrame(asked);
  }, [scene, report, playing, speed]);

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

  const name = nameOfGate(report, gate);
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
        aria-valuetext={`${gate} of ${gates}${name && `, ${name}`}`}
        onInput={event => goTo(Number(event.currentTarget.value))}
      />
      <span class="gate">
        gate {gate} of {gates} <b>{name}</b>
      </span>
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
