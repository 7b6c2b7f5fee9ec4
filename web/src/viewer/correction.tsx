// Putting the heart where it is: by handles in the slices or by numbers, then a new fit from there.

import { useLayoutEffect, useState } from "preact/hooks";
import { type ParameterValue, type Parameters, type Volume, fieldOf, words } from "../api";
import { ReaderChoice, draftOf, parameterSpecs, valuesOf } from "../parameters";
import { useWatched } from "../state";
import { isFit, isGated, kindOf } from "../words";
import { file } from "../work";
import type { Loaded } from "./loaded";
import { previewOf } from "./handles";
import { type Axis, frameOf } from "./plane";
import { WallFrame } from "./polar";
import { fittedPulls, pullTo, pullWords, throughOf, withPulls } from "./pulls";
import type { Edit, Pull, Scene } from "./scene";
import type { Triple } from "./shown";
import { type Vec, add, dot, scale, sub, turned, unit } from "./vector";

interface Props {
  scene: Scene;
  volume: Volume;
  shown: Loaded | null;
}

/** Where most hearts point: to the left, forward and down. */
const USUAL: Vec = unit([0.65, -0.6, -0.45]);
const HALF_LENGTH = 36;

function start(scene: Scene, shown: Loaded | null): Edit {
  const heart = shown?.heart;
  if (heart) {
    const center = (shown.report?.localisation?.centre as Triple | undefined) ?? shown.middle;
    // The plane of the base is that of the rim, as the service counts it.
    const { base } = new WallFrame(shown.mesh, heart, 1, 1);
    const { parameters, id } = shown.result;
    const fitted = isFit(id) ? fittedPulls(parameters["inner_through"], parameters["outer_through"]) : [];
    return {
      base,
      apex: heart.apex,
      center,
      roll: 0,
      wall: { mesh: shown.mesh, base, apex: heart.apex, pulled: isFit(id) && !whyNotPulled(parameters) },
      pulls: fitted,
      fitted,
      changed: new Set(),
    };
  }
  const center = scene.cursor.value;
  return {
    center,
    base: sub(center, scale(USUAL, HALF_LENGTH)),
    apex: add(center, scale(USUAL, HALF_LENGTH)),
    roll: 0,
    wall: null,
    pulls: [],
    fitted: [],
    changed: new Set(["center"]),
  };
}

/** Why the contour of a wall made with these parameters cannot be pulled; nothing where it can. */
export function whyNotPulled({ edge, reader }: Parameters): string {
  if (edge === "anatomical") return "The contour can be pulled where the apparent wall is shown.";
  return reader ? "The contour can be pulled where no reader’s profile draws it." : "";
}

export function Correction({ scene, volume, shown }: Props) {
  const edit = useWatched(scene.edit);
  const cursor = useWatched(scene.cursor);
  const [problem, setProblem] = useState<{ field: string | null; text: string } | null>(null);
  const [sending, setSending] = useState(false);
  const [edge, setEdge] = useState("");
  const [reader, setReader] = useState("");
  useLayoutEffect(() => {
    scene.edit.value = start(scene, shown);
    scene.tool.value = "correct";
    setProblem(null);
    setReader(String(shown?.result.parameters["reader"] ?? ""));
    setEdge(String(shown?.result.parameters["edge"] ?? "apparent"));
  }, [scene, shown]);
  if (!edit) return null;

  const kind = shown?.beat || (!shown && isGated(volume)) ? "beat" : "segmentation";
  const corrected = shown && kindOf(shown.result.id) === kind ? shown : null;
  const send = async () => {
    setProblem(null);
    setSending(true);
    try {
      const specs = (await parameterSpecs())[kind];
      const before = corrected ? valuesOf(draftOf(corrected.result.parameters, specs), specs) : {};
      const next: Record<string, ParameterValue> = { ...before, ...(kind === "beat" ? {} : { edge }) };
      // Another heart may win from another place; the one that was looked at is kept.
      const kept = corrected?.report?.template ?? corrected?.beat?.report.template;
      if (kept) next["kept_model"] = kept;
      const moved = correctionOf(edit, scene.heart.value);
      for (const [name, value] of Object.entries(moved)) {
        if (value) next[name] = value;
        else delete next[name];
      }
      if (moved.center) {
        delete next["seed_point"];
        delete next["box"];
      }
      if (reader) next["reader"] = reader;
      else delete next["reader"];
      const changed = [
        ...edit.changed,
        ...(reader !== (shown?.result.parameters["reader"] ?? "") ? ["reader"] : []),
        ...(edge !== (shown?.result.parameters["edge"] ?? "apparent") ? ["edge"] : []),
      ];
      const labels: Record<string, string> = { changed: changed.join(" ") || "nothing" };
      if (corrected) labels["parent"] = corrected.result.id;
      await file(kind, volume, next, labels);
    } catch (error) {
      setProblem({ field: fieldOf(error), text: words(error) });
    }
    setSending(false);
  };
  return (
    <div class="panel correction" role="group" aria-label="Correct by hand">
      {shown ? (
        <p class="quiet">
          Drag <b>centre</b>, <b>apex</b> and <b>base</b> in the long-axis slices, and <b>turn</b> in the short axis so
          that it points to the anterior wall: turning only renames segments.{" "}
          {edit.wall?.pulled &&
            "Drag the contour to pull the wall’s inner or outer side where it should pass: the new fit goes through there. "}
          {corrected && kind === "segmentation" && whyNotPulled(corrected.result.parameters)}{" "}
          {kind === "beat" && "All gates are fitted again. "}The new fit is kept beside this one and names it.
        </p>
      ) : (
        <p class="quiet">
          Drag <b>centre</b> to the middle of the cavity, <b>apex</b> to its tip and <b>base</b> to the valve plane. A
          press beside them goes to other slices; <b>Centre at the cursor</b> brings all three there.
        </p>
      )}
      <EditFields
        edit={edit}
        onEdit={next => (scene.edit.value = next)}
        cursor={cursor}
        wrong={problem?.field ?? null}
      />
      <Pulls
        edit={edit}
        onEdit={next => (scene.edit.value = next)}
        cursor={cursor}
        onShow={({ place }) => (scene.cursor.value = place)}
        wrong={problem?.field ?? null}
      />
      {kind === "segmentation" && (
        <label class="field">
          Wall shown
          <select value={edge} onChange={event => setEdge(event.currentTarget.value)}>
            <option value="apparent">apparent: as the image shows it</option>
            <option value="anatomical">anatomical: without blur</option>
          </select>
        </label>
      )}
      {kind === "segmentation" && (
        <label class="field">
          Drawn as by
          <ReaderChoice common={{ id: "correction-reader" }} text={reader} onText={setReader} />
        </label>
      )}
      {problem && (
        <p class="error" role="alert">
          {problem.text}
        </p>
      )}
      <div class="buttons">
        <button type="button" class="main" disabled={sending} onClick={() => void send()}>
          Fit from here
        </button>
        <button type="button" class="plain" onClick={() => (scene.edit.value = start(scene, shown))}>
          Undo changes
        </button>
      </div>
      <Changed edit={edit} />
    </div>
  );
}

interface FieldsProps {
  edit: Edit;
  onEdit: (next: Edit) => void;
  /** Where the centre may be put by a press. */
  cursor?: Vec;
  /** The parameter that the service has refused. */
  wrong: string | null;
}

/** The correction in numbers. */
export function EditFields({ edit, onEdit, cursor, wrong }: FieldsProps) {
  const axis = unit(sub(edit.apex, edit.base));
  const centreTo = (center: Vec) => {
    const way = sub(center, edit.center);
    onEdit({
      ...edit,
      center,
      base: add(edit.base, way),
      apex: add(edit.apex, way),
      changed: new Set(edit.changed).add("center"),
    });
  };
  /** The base so far from the centre, along the axis. */
  const baseTo = (distance: number) => {
    if (!(distance > 5 && distance < 120)) return;
    onEdit({
      ...edit,
      base: sub(edit.center, scale(axis, distance)),
      changed: new Set(edit.changed).add("base"),
    });
  };
  const axisTo = (wanted: Vec) => {
    if (!(Math.hypot(...wanted) > 1e-6)) return;
    const way = unit(wanted);
    const length = Math.hypot(...sub(edit.apex, edit.base));
    const base = sub(edit.center, scale(way, 0.45 * length));
    onEdit({
      ...edit,
      base,
      apex: add(base, scale(way, length)),
      changed: new Set(edit.changed).add("axis"),
    });
  };
  return (
    <>
      <TripleField
        name="Centre, mm (L, P, S)"
        value={edit.center}
        digits={1}
        wrong={wrong === "center"}
        onValue={centreTo}
      />
      {cursor && (
        <button type="button" onClick={() => centreTo(cursor)}>
          Centre at the cursor
        </button>
      )}
      <TripleField name="Axis, base to apex" value={axis} digits={3} wrong={wrong === "axis"} onValue={axisTo} />
      <label class="field">
        Base, mm from the centre
        <NumberInput
          step={1}
          text={dot(sub(edit.center, edit.base), axis).toFixed(0)}
          aria-invalid={wrong === "base" || undefined}
          onNumber={baseTo}
        />
      </label>
      <label class="field">
        Turn about the axis, °
        <input
          type="number"
          step={5}
          value={edit.roll}
          onInput={event =>
            onEdit({
              ...edit,
              roll: Number(event.currentTarget.value) || 0,
              changed: new Set(edit.changed).add("roll"),
            })
          }
        />
      </label>
    </>
  );
}

interface PullsProps extends FieldsProps {
  /** Takes the views to a pull. */
  onShow?: (pull: Pull) => void;
}

/** Where the contour was pulled: each is taken back by itself. */
export function Pulls({ edit, onEdit, cursor, onShow, wrong }: PullsProps) {
  const toCursor = cursor && edit.wall?.pulled && pullTo(edit, previewOf(edit) ?? edit.wall.mesh, cursor);
  return (
    <>
      {toCursor && (
        <button type="button" onClick={() => onEdit(withPulls(edit, [...edit.pulls, toCursor]))}>
          Pull the {toCursor.outer ? "outer" : "inner"} contour to the cursor
        </button>
      )}
      {edit.pulls.length > 0 && (
        <ul class="pulls" aria-label="Pulls of the contour">
          {edit.pulls.map((pull, n) => {
            const name = `${n + 1}: ${pullWords(pull, edit)}`;
            const refused = wrong === (pull.outer ? "outer_through" : "inner_through");
            return (
              <li key={n} class={refused ? "wrong" : ""}>
                <span>{name}</span>
                {onShow && (
                  <button type="button" class="plain" aria-label={`Show pull ${name}`} onClick={() => onShow(pull)}>
                    Show
                  </button>
                )}
                <button
                  type="button"
                  class="plain"
                  aria-label={`Remove pull ${name}`}
                  onClick={() =>
                    onEdit(
                      withPulls(
                        edit,
                        edit.pulls.filter((_, at) => at !== n),
                      ),
                    )
                  }>
                  Remove
                </button>
              </li>
            );
          })}
        </ul>
      )}
    </>
  );
}

/** What was changed so far. */
export function Changed({ edit }: { edit: Edit }) {
  return (
    <p class="quiet" role="status">
      {edit.changed.size ? `Changed: ${[...edit.changed].join(", ")}` : "Nothing changed yet"}
    </p>
  );
}

const rounded = (value: Vec, digits: number) => value.map(part => Math.round(part * 10 ** digits) / 10 ** digits);

/** What the service is told of a correction: of what was changed, the parameters; null for those that it has no more. */
export function correctionOf(edit: Edit, heart: Axis | null): Partial<Record<Correctable, number[] | null>> {
  const moved: Partial<Record<Correctable, number[] | null>> = {};
  if (edit.changed.has("center")) moved.center = rounded(edit.center, 2);
  if (edit.changed.has("axis")) moved.axis = rounded(unit(sub(edit.apex, edit.base)), 4);
  if (edit.changed.has("base")) moved.base = rounded(edit.base, 2);
  if (edit.changed.has("roll") && heart) {
    // The wall that now stands on top is anterior. Only names follow it: the fit starts from the orientation that it had.
    const { axis, anterior } = frameOf(heart);
    moved.segments_from = rounded(turned(anterior, axis, (edit.roll * Math.PI) / 180), 4);
  }
  if (edit.changed.has("contour")) {
    moved.inner_through = throughOf(edit, false);
    moved.outer_through = throughOf(edit, true);
  }
  return moved;
}

type Correctable = "center" | "axis" | "base" | "segments_from" | "inner_through" | "outer_through";

interface TripleFieldProps {
  name: string;
  value: Vec;
  digits: number;
  wrong: boolean;
  onValue: (value: Vec) => void;
}

function TripleField({ name, value, digits, wrong, onValue }: TripleFieldProps) {
  return (
    <fieldset class={wrong ? "field triple wrong" : "field triple"}>
      <legend>{name}</legend>
      {value.map((part, n) => (
        <NumberInput
          key={n}
          step={digits > 1 ? 0.05 : 1}
          aria-label={`${name}, ${["x", "y", "z"][n]}`}
          text={part.toFixed(digits)}
          onNumber={number => onValue(value.map((old, at) => (at === n ? number : old)) as unknown as Vec)}
        />
      ))}
    </fieldset>
  );
}

interface NumberInputProps {
  step: number;
  text: string;
  onNumber: (value: number) => void;
  "aria-label"?: string;
  "aria-invalid"?: true | undefined;
}

/**
 * A number that counts when the field is left. What is typed until then is kept, however often the view is drawn again.
 */
function NumberInput({ text, onNumber, ...rest }: NumberInputProps) {
  const [typed, setTyped] = useState<string | null>(null);
  return (
    <input
      type="number"
      {...rest}
      value={typed ?? text}
      onInput={event => setTyped(event.currentTarget.value)}
      onChange={event => {
        setTyped(null);
        const { value } = event.currentTarget;
        if (value !== "" && Number.isFinite(Number(value))) onNumber(Number(value));
      }}
    />
  );
}
