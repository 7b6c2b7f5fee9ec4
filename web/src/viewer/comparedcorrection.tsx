// Putting one heart of a comparison where it is: by handles in its rows of slices or by numbers; then both are compared
// again from there.

import { useEffect, useState } from "preact/hooks";
import { type Result, type Volume, fieldOf, words } from "../api";
import { CORRECTIONS, correctionName } from "../corrections";
import { draftOf, parameterSpecs, valuesOf } from "../parameters";
import { openComparison } from "../route";
import { useWatched } from "../state";
import { fileComparison } from "../work";
import type { Compared, WhichScan } from "./compared";
import type { OfBoth } from "./comparedgates";
import type { ComparedEdit, ComparedScene } from "./comparedscene";
import { Changed, EditFields, Pulls, correctionOf, whyNotPulled } from "./correction";
import { frameOf } from "./plane";
import { WallFrame } from "./polar";
import { fittedPulls, repeatedPulls } from "./pulls";
import type { Edit } from "./scene";
import type { Triple } from "./shown";
import { mix } from "./vector";

/** Share of the way from base to apex at which the centre stands where nobody has put it. */
const CENTRE_SHARE = 0.45;

const NAMES: Record<string, string> = {
  center: "centre",
  axis: "axis",
  base: "base",
  segments_from: "turn",
  inner_through: "inner contour",
  outer_through: "outer contour",
};

/** What was corrected of a scan before it was compared, in words; nothing where nothing was. */
export function correctedWords({ parameters }: Pick<Result, "parameters">, scan: WhichScan): string {
  return CORRECTIONS.filter(name => parameters[correctionName(scan, name)] != null)
    .map(name => NAMES[name] ?? name)
    .join(", ");
}

const otherScan = (scan: WhichScan): WhichScan => (scan === "stress" ? "rest" : "stress");

/** The heart as it was fitted; null where it has no axis. */
function startOf({ result, report, ...hearts }: Compared, scan: WhichScan): Edit | null {
  const { mesh, heart } = hearts[scan];
  if (!heart) return null;
  // The plane of the base is that of the rim, as the service counts it.
  const { base } = new WallFrame(mesh, heart, 1, 1);
  const { apex } = heart;
  const own = (name: string) => result.parameters[correctionName(scan, name)];
  const fitted = fittedPulls(own("inner_through"), own("outer_through"));
  return {
    base,
    apex,
    center: (own("center") as Triple | null | undefined) ?? mix(base, apex, CENTRE_SHARE),
    roll: 0,
    // The gates of a beat follow the image.
    wall: { mesh, base, apex, pulled: !report.beat && !whyNotPulled(result.parameters) },
    pulls: fitted,
    fitted,
    changed: new Set(),
  };
}

interface Props {
  compared: Compared;
  scene: ComparedScene;
  scans: OfBoth<Volume>;
}

/** What was corrected of a scan, and the button that puts handles on its slices. */
export function CorrectScan({ compared, scene, scan }: Omit<Props, "scans"> & { scan: WhichScan }) {
  const now = useWatched(scene.edit);
  const edited = now?.scan === scan;
  const corrected = correctedWords(compared.result, scan);
  const start = () => {
    const edit = now?.other ?? startOf(compared, scan);
    scene.valve.value = null;
    scene.edit.value = edited || !edit ? null : { scan, edit, other: now?.edit.changed.size ? now.edit : null };
  };
  return (
    <>
      {corrected && <span class="corrected">corrected by hand: {corrected}</span>}{" "}
      {compared[scan].heart && (
        <button type="button" class="plain" aria-expanded={edited} aria-label={`Correct ${scan}`} onClick={start}>
          Correct
        </button>
      )}
    </>
  );
}

/** The correction that is under way. */
export function ComparedCorrection({ compared, scene, scans }: Props) {
  const now = useWatched(scene.edit);
  const valve = useWatched(scene.valve);
  const [problem, setProblem] = useState<{ field: string | null; text: string } | null>(null);
  const [sending, setSending] = useState(false);
  useEffect(() => {
    setProblem(null);
    const leave = (event: KeyboardEvent) => {
      if (event.key === "Escape") scene.valve.value = null;
    };
    addEventListener("keydown", leave);
    return () => removeEventListener("keydown", leave);
  }, [scene, now?.scan]);
  useEffect(() => () => void (scene.edit.value = scene.valve.value = null), [scene]);
  if (!now) return null;
  const { scan, edit, other } = now;
  const { result, report } = compared;
  const beside = otherScan(scan);
  const nothing = edit.changed.size === 0 && !other?.changed.size;
  const send = async () => {
    setProblem(null);
    setSending(true);
    try {
      const specs = (await parameterSpecs()).comparison;
      const { normals, ...parameters } = valuesOf(draftOf(result.parameters, specs), specs);
      for (const [which, one] of [
        [scan, edit],
        [beside, other],
      ] as const) {
        const moved = one ? correctionOf(one, compared[which].heart) : {};
        for (const [name, value] of Object.entries(moved)) {
          if (value) parameters[correctionName(which, name)] = value;
          else delete parameters[correctionName(which, name)];
        }
      }
      // Another heart may win from another place; the one that was looked at is kept.
      parameters["kept_model"] = report[scan].template;
      const job = await fileComparison({
        ...scans,
        fits: { stress: null, rest: null },
        normals: typeof normals === "string" ? normals : null,
        parameters,
      });
      openComparison(job.id);
    } catch (error) {
      setProblem({ field: fieldOf(error)?.replace(`${scan}_`, "") ?? null, text: words(error) });
    }
    setSending(false);
  };
  return (
    <div class="panel correction" role="group" aria-label={`Correct ${scan} by hand`}>
      <p class="quiet">
        Drag <b>centre</b> (green), <b>apex</b> and <b>base</b> (yellow) in the long-axis slices at {scan}, and{" "}
        <b>turn</b> (pink) in the short axis so that it points to the anterior wall: turning only renames segments.{" "}
        {edit.wall?.pulled && "Drag the contour to pull the wall’s inner or outer side where it should pass. "}
        {!report.beat && whyNotPulled(result.parameters)} The blue line shows where the wall goes before it is fitted
        again.
      </p>
      <button
        type="button"
        aria-pressed={valve !== null}
        onClick={() => (scene.valve.value = valve === null ? { first: null } : null)}>
        Valve plane by two points
      </button>
      {valve && (
        <p role="status">
          {valve.first
            ? "Press on the other side of the valve plane in the same row."
            : `Press on one side of the valve plane in a long-axis slice at ${scan}; then on the other.`}{" "}
          The base goes half-way between both.
        </p>
      )}
      <EditFields
        edit={edit}
        onEdit={next => (scene.edit.value = { ...now, edit: next })}
        wrong={problem?.field ?? null}
      />
      <Pulls edit={edit} onEdit={next => (scene.edit.value = { ...now, edit: next })} wrong={problem?.field ?? null} />
      {edit.pulls.length > 0 && <Repeat compared={compared} scene={scene} now={now} />}
      {other && other.pulls.length > 0 && (
        <section aria-label={`Pulls at ${beside}`}>
          <p class="quiet">At {beside}:</p>
          <Pulls edit={other} onEdit={next => (scene.edit.value = { ...now, other: next })} wrong={null} />
        </section>
      )}
      {problem && (
        <p class="error" role="alert">
          {problem.text}
        </p>
      )}
      <div class="buttons">
        <button type="button" class="main" disabled={sending || nothing} onClick={() => void send()}>
          Fit and compare again
        </button>
        <button
          type="button"
          class="plain"
          onClick={() => {
            const first = startOf(compared, scan);
            if (first) scene.edit.value = { scan, edit: first, other: null };
          }}>
          Undo changes
        </button>
      </div>
      <Changed edit={edit} />
      {other && other.changed.size > 0 && (
        <p class="quiet">
          Changed at {beside}: {[...other.changed].join(", ")}
        </p>
      )}
    </div>
  );
}

/** Takes the pulls of the corrected scan to the same places of the other heart. */
function Repeat({ compared, scene, now }: Pick<Props, "compared" | "scene"> & { now: ComparedEdit }) {
  const beside = otherScan(now.scan);
  const [own, heart] = [compared[now.scan].heart, compared[beside].heart];
  const other = now.other ?? startOf(compared, beside);
  if (!own || !heart || !other?.wall?.pulled) return null;
  const next = repeatedPulls(now.edit.pulls, frameOf(own), other, frameOf(heart));
  return (
    <button
      type="button"
      disabled={next.pulls.length === other.pulls.length}
      onClick={() => (scene.edit.value = { ...now, other: next })}>
      Repeat on the scan at {beside}
    </button>
  );
}
