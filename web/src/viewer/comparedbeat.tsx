// The beats of both scans of a comparison: one player for all rows of slices, volume curves on one chart, phases,
// segments.

import { useEffect, useState } from "preact/hooks";
import { type Volume, words } from "../api";
import { PartTable, rowsOf } from "../figures";
import type { ComparisonReport } from "../generated/openapi";
import { JobLine } from "../jobline";
import { beats as storedBeats, find, isActive, jobs } from "../library";
import { useWatched } from "../state";
import { number } from "../words";
import { PhaseHistogram, VolumeCurves, highestOf } from "./charts";
import type { Compared } from "./compared";
import { beatOf, fitBeats, isSameBeat } from "./comparedbeats";
import { BeatChangeTable } from "./comparedfacts";
import { type OfBoth, gatesOf, measured, readHeartGates } from "./comparedgates";
import { useSegmentMarks } from "./comparedmaps";
import type { ComparedScene } from "./comparedscene";
import { type Loaded, loadLoaded } from "./loaded";
import { PlayerBar, UNKNOWN_CYCLE_MS, nameOfGate } from "./player";
import type { Voxels } from "./volume";

const BOTH = ["stress", "rest"] as const;

interface Props {
  compared: Compared;
  scene: ComparedScene;
  scans: OfBoth<Volume>;
}

/** Keeps the stored beats of both scans in the scene; the answer is what went wrong. */
export function useBeats({ compared, scene, scans }: Props): string {
  const { result, report } = compared;
  useWatched(storedBeats);
  const [problem, setProblem] = useState("");
  const ids = BOTH.map(scan => (report.beat ? (beatOf(result, report.beat, scan, scans[scan].id)?.id ?? "") : ""));
  useEffect(() => {
    let gone = false;
    const load = async (id: string) => {
      const found = id ? find(id) : undefined;
      return found ? loadLoaded(found) : null;
    };
    Promise.all(ids.map(load)).then(
      ([stress = null, rest = null]) => {
        if (!gone) scene.beats.value = { stress, rest };
      },
      error => !gone && setProblem(words(error)),
    );
    return () => void (gone = true);
  }, [scene, ids.join()]);
  return problem;
}

/** Reads the gates of both scans as soon as one is shown; the answer is how far that is, and what went wrong. */
function useGates({ compared, scene, scans }: Props): { read: number; problem: string } {
  const beats = useWatched(scene.beats);
  const wanted = useWatched(scene.gate) !== null;
  const [read, setRead] = useState<OfBoth<number>>({ stress: 0, rest: 0 });
  const [near, setNear] = useState<OfBoth<Voxels[]> | null>(null);
  const [problem, setProblem] = useState("");
  const [asked, setAsked] = useState(false);
  if (wanted && !asked) setAsked(true);
  useEffect(() => {
    if (!asked) return;
    let gone = false;
    const readOne = (scan: "stress" | "rest") => {
      const { region } = compared[scan];
      if (!region) throw new Error("This comparison has no image about the heart.");
      return readHeartGates(scans[scan], region, gatesOf(scans[scan], scene.beats.value[scan]), count => {
        if (!gone) setRead(now => ({ ...now, [scan]: count }));
        return !gone;
      });
    };
    (async () => {
      const [stress, rest] = await Promise.all([readOne("stress"), readOne("rest")]);
      if (!gone && stress && rest) setNear({ stress, rest });
    })().catch(error => !gone && setProblem(words(error)));
    return () => void (gone = true);
  }, [compared, asked]);
  useEffect(() => {
    if (!near) return;
    const of = (scan: "stress" | "rest") => measured(compared[scan], near[scan], beats[scan]?.gates ?? null);
    scene.gates.value = { stress: of("stress"), rest: of("rest") };
  }, [compared, scene, near, beats]);
  return { read: Math.min(read.stress, read.rest), problem };
}

/** Plays both scans at the same moments of their cycles, whatever the number of their gates. */
export function ComparedPlayer(props: Props) {
  const { scene, scans } = props;
  const beats = useWatched(scene.beats);
  const gates = useWatched(scene.gates);
  const { problem } = useGates(props);
  const outlined = useWatched(scene.contours);
  const still = useWatched(scene.gate) === null;
  const count = { stress: countOf(scans.stress, beats.stress), rest: countOf(scans.rest, beats.rest) };
  const longer = count.stress >= count.rest ? "stress" : "rest";
  const cycles = BOTH.flatMap(scan => beats[scan]?.beat?.report.rr_ms ?? scans[scan].gates?.rr_ms ?? []);
  const all = count[longer];
  const isRead = gates.stress !== null && gates.rest !== null;
  const nameOf = (gate: number) => {
    const turns = (gate - 0.5) / all;
    return BOTH.map(scan => {
      const own = Math.min(count[scan], Math.floor(turns * count[scan]) + 1);
      const report = beats[scan]?.beat?.report;
      const place = count[scan] === all ? "" : `${own} of ${count[scan]}`;
      return [scan, place, report ? nameOfGate(report, own) : ""].filter(Boolean).join(" ");
    })
      .filter(text => text.includes(" "))
      .join(", ");
  };
  return (
    <>
      <PlayerBar
        scene={scene}
        gates={all}
        read={isRead || still ? all : 0}
        first={beats[longer]?.beat?.report.end_diastole_gate ?? 1}
        cycle={cycles.length > 0 ? cycles.reduce((sum, ms) => sum + ms, 0) / cycles.length : UNKNOWN_CYCLE_MS}
        nameOf={nameOf}
        starts={false}>
        <button type="button" class="plain" disabled={still} onClick={() => scene.leave()}>
          Sum of gates
        </button>
      </PlayerBar>
      {!still && outlined && isRead && !(gates.stress?.meshes && gates.rest?.meshes) && (
        <p class="layers quiet">
          Contours {withoutWalls(gates)}: the wall in the sum of the gates. Fit the beats to see it in every gate.
        </p>
      )}
      {problem && (
        <p class="layers error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}

function countOf(volume: Volume, beat: Loaded | null): number {
  return gatesOf(volume, beat).length;
}

function withoutWalls(gates: ComparedScene["gates"]["value"]): string {
  return BOTH.filter(scan => !gates[scan]?.meshes)
    .map(scan => `at ${scan}`)
    .join(" and ");
}

/** Curves, phases and segments of both beats; without them how to get them. */
export function ComparedBeats(props: Props) {
  const { compared, scene } = props;
  const problem = useBeats(props);
  const { stress, rest } = useWatched(scene.beats);
  const { report } = compared;
  if (!report.beat) return null;
  const reports = stress?.beat && rest?.beat ? { stress: stress.beat.report, rest: rest.beat.report } : null;
  // Intervals are those of the figures beside them.
  const isOfBoth = reports !== null && apartFrom(report, reports).length === 0;
  return (
    <section class="compared-beat figures" aria-label="The beat at stress and at rest">
      <h2>Volume</h2>
      {reports && (
        <div class="volumes">
          <Curves scene={scene} reports={reports} />
          <BeatChangeTable report={report} reports={isOfBoth ? reports : null} />
        </div>
      )}
      {reports && <FittedApart report={report} reports={reports} />}
      {reports && <Phases reports={reports} />}
      {reports && (
        <details>
          <summary>Segments of the beat</summary>
          <div class="wide" tabIndex={0} role="region" aria-label="Segments of the beat">
            <SegmentMotions compared={compared} scene={scene} reports={reports} />
          </div>
        </details>
      )}
      {!reports && <FitBeats {...props} />}
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </section>
  );
}

type Reports = OfBoth<NonNullable<Loaded["beat"]>["report"]>;

/** Both volume curves on one chart. */
function Curves({ scene, reports }: { scene: ComparedScene; reports: Reports }) {
  return (
    <div>
      <VolumeCurves
        of={BOTH.map(scan => [scan, reports[scan]])}
        scene={scene}
        gates={Math.max(reports.stress.gates.length, reports.rest.gates.length)}
      />
      <p class="curve-keys">
        {BOTH.map(scan => (
          <span key={scan} class={scan}>
            <svg viewBox="0 0 24 6" aria-hidden="true">
              <line x1="0" x2="24" y1="3" y2="3" />
            </svg>
            {scan}
          </span>
        ))}
      </p>
    </div>
  );
}

/** The scans whose beats are not those that the comparison has figures of. */
function apartFrom({ beat }: ComparisonReport, reports: Reports): ("stress" | "rest")[] {
  return BOTH.filter(scan => beat && !isSameBeat(reports[scan], beat, scan));
}

function FittedApart({ report, reports }: { report: ComparisonReport; reports: Reports }) {
  return (
    <>
      {apartFrom(report, reports).map(scan => {
        const { ef_percent, edv_ml } = reports[scan];
        return (
          <p key={scan} class="warning">
            Curve, phases and maps at {scan} are of a beat that was fitted in another way: EF{" "}
            {number(ef_percent, 0, "%")}, EDV {number(edv_ml, 0, "ml")}.
          </p>
        );
      })}
    </>
  );
}

function Phases({ reports }: { reports: Reports }) {
  const highest = Math.max(highestOf(reports.stress), highestOf(reports.rest));
  const doubted = BOTH.filter(scan => !reports[scan].phase.reliable);
  return (
    <>
      <h2>Phases of the wall</h2>
      <div class="phases">
        {BOTH.map(scan => {
          const { sd_degrees, bandwidth_degrees } = reports[scan].phase;
          return (
            <figure key={scan} class={scan}>
              <PhaseHistogram report={reports[scan]} of={scan === "stress" ? "Stress" : "Rest"} highest={highest} />
              <figcaption>
                <b>{scan}</b> SD {number(sd_degrees, 0, "°")}, bandwidth {number(bandwidth_degrees, 0, "°")}
              </figcaption>
            </figure>
          );
        })}
      </div>
      {doubted.length > 0 && (
        <p class="warning">The phases at {doubted.join(" and ")} are not reliable: too little of the wall moves.</p>
      )}
    </>
  );
}

/** Motion, thickening and phase of the segments at stress beside those at rest. */
function SegmentMotions({ compared, scene, reports }: { compared: Compared; scene: ComparedScene; reports: Reports }) {
  const parts = reports.rest.segments.map(rest => ({
    segment: rest.segment,
    name: rest.name,
    rest,
    stress: reports.stress.segments.find(one => one.segment === rest.segment),
  }));
  const figures = rowsOf("SegmentMotionReport").filter(row => row.place !== "thickening_counts_percent");
  return (
    <PartTable
      caption="Motion, thickening and phase of the segments at stress and at rest"
      head="Segment"
      parts={parts}
      nameOf={one => `${one.segment} ${one.name}`}
      rows={figures.flatMap(row =>
        BOTH.map(scan => ({
          ...row,
          place: `${scan}/${row.place}`,
          short: `${row.short ?? row.label}, ${scan}`,
          about: `At ${scan}. ${row.about}`,
        })),
      )}
      marks={useSegmentMarks<(typeof parts)[number]>(compared, scene)}
    />
  );
}

/** Fits the beats that no one has stored. */
function FitBeats({ compared, scene, scans }: Props) {
  const [problem, setProblem] = useState("");
  const [sending, setSending] = useState(false);
  const ids = BOTH.map(scan => scans[scan].id);
  const own = useWatched(jobs).filter(job => job.kind === "beat" && ids.includes(job.volume ?? ""));
  const active = own.filter(isActive);
  const failed = own.filter(job => job.state === "failed").slice(0, 2);
  const fit = async () => {
    setProblem("");
    setSending(true);
    try {
      await fitBeats(compared.result, compared.report, scans, scene.beats.value);
    } catch (error) {
      setProblem(words(error));
    }
    setSending(false);
  };
  return (
    <>
      <BeatChangeTable report={compared.report} reports={null} />
      <p class="quiet">
        A comparison keeps no walls of single gates. Beats of both scans give volume curves, phases, maps of motion and
        thickening, and contours in every gate.
      </p>
      {active.length > 0 ? (
        active.map(job => <JobLine key={job.id} job={job} />)
      ) : (
        <>
          {failed.map(job => (
            <JobLine key={job.id} job={job} />
          ))}
          <button type="button" disabled={sending} onClick={() => void fit()}>
            Fit the beats
          </button>
        </>
      )}
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}
