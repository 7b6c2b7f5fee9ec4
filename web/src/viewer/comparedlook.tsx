// How the slices of a comparison are shown: window, normalisation, zoom, and the rows.

import { useWatched } from "../state";
import { KINDS, type Row } from "./compared";
import type { ComparedScene, Normalisation } from "./comparedscene";
import { ColourBar } from "./wall";

const NORMALISATIONS: [Normalisation, string, string][] = [
  ["wall", "wall", "per cent of the hottest quarter of each scan’s wall"],
  ["image", "image", "per cent of the brightest place of each scan’s image about the heart"],
  ["slice", "each slice", "per cent of the brightest place of each slice"],
];

/** How the slices are shown, in words for print. */
export function shownAs(scene: ComparedScene): string {
  const [low, high] = scene.window.value;
  const means = NORMALISATIONS.find(([name]) => name === scene.normalisation.value)![2];
  const shifted = scene.rows.value.flatMap(({ restShift }, kind) =>
    restShift ? [`${KINDS[kind]!.short} of rest shifted by ${restShift} mm`] : [],
  );
  return [`${low} to ${high} ${means}`, ...shifted].join("; ");
}

/** Most slices of a row: more are too small to read. */
const MOST_SLICES = 14;

interface NumberProps {
  label: string;
  unit: string;
  value: number;
  least: number;
  most: number;
  step?: number;
  onNumber: (value: number) => void;
}

/** A number that counts as soon as it is one within its limits. */
function NumberField({ label, unit, value, least, most, step = 1, onNumber }: NumberProps) {
  return (
    <label class="inline number">
      {label}
      <input
        type="number"
        min={least}
        max={most}
        step={step}
        value={value}
        onInput={event => {
          const given = event.currentTarget.valueAsNumber;
          if (given >= least && given <= most) onNumber(given);
        }}
      />
      {unit}
    </label>
  );
}

/** Colours of the slices: what 100 per cent is, and which per cent have the first and the last one. */
export function WindowOfSlices({ scene }: { scene: ComparedScene }) {
  const lut = useWatched(scene.lut);
  const [low, high] = useWatched(scene.window);
  const normalisation = useWatched(scene.normalisation);
  const means = NORMALISATIONS.find(([name]) => name === normalisation)![2];
  return (
    <>
      <label class="inline brightness">
        <ColourBar lut={lut} low={String(low)} high={`${high}\u2009%`} />
        <input
          type="range"
          aria-label="Uptake of the brightest colour, per cent"
          min={40}
          max={160}
          step={5}
          value={high}
          onInput={event => {
            const given = Number(event.currentTarget.value);
            scene.window.value = [Math.min(low, given - 5), given];
          }}
        />
      </label>
      <label class="inline" title={`${means}; of single gates: of the brightest such place in any gate`}>
        of
        <select
          aria-label="What counts as 100 per cent in the slices"
          value={normalisation}
          onChange={event => (scene.normalisation.value = event.currentTarget.value as Normalisation)}>
          {NORMALISATIONS.map(([name, text]) => (
            <option key={name} value={name}>
              {text}
            </option>
          ))}
        </select>
      </label>
    </>
  );
}

/** The window in numbers, the zoom, and the row of the marked slice. */
export function RowsOfSlices({ scene }: { scene: ComparedScene }) {
  const [low, high] = useWatched(scene.window);
  const across = useWatched(scene.across);
  const rows = useWatched(scene.rows);
  const { kind } = useWatched(scene.chosen);
  const row = rows[kind]!;
  const [first, last] = row.ends.map(share => Math.round(100 * share)) as [number, number];
  const [least, most] = kind === 0 ? [-10, 110] : [-60, 60];
  const ends = (from: number, to: number): Pick<Row, "ends"> => ({ ends: [from / 100, to / 100] });
  return (
    <div class="layers" role="group" aria-label="Rows of slices">
      <NumberField
        label="Lower"
        unit="%"
        value={low}
        least={-20}
        most={high - 1}
        onNumber={value => (scene.window.value = [value, high])}
      />
      <NumberField
        label="Upper"
        unit="%"
        value={high}
        least={low + 1}
        most={400}
        onNumber={value => (scene.window.value = [low, value])}
      />
      <NumberField
        label="Width of a slice"
        unit="mm"
        value={across}
        least={40}
        most={300}
        step={0.1}
        onNumber={value => (scene.across.value = value)}
      />
      <b>{KINDS[kind]!.name}</b>
      <NumberField
        label="slices"
        unit=""
        value={row.count}
        least={2}
        most={MOST_SLICES}
        onNumber={value => scene.changeRow({ count: Math.round(value) })}
      />
      <NumberField
        label="from"
        unit="%"
        value={first}
        least={least}
        most={last - 1}
        onNumber={value => scene.changeRow(ends(value, last))}
      />
      <NumberField
        label="to"
        unit="% of the long axis"
        value={last}
        least={first + 1}
        most={most}
        onNumber={value => scene.changeRow(ends(first, value))}
      />
      <NumberField
        label="rest shifted by"
        unit="mm"
        value={row.restShift}
        least={-60}
        most={60}
        onNumber={value => scene.changeRow({ restShift: value })}
      />
      <button type="button" class="plain" onClick={() => scene.showAsAtFirst()}>
        As at first
      </button>
    </div>
  );
}
