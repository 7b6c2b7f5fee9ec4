// One patient's study in the list of scans: its pairs of rest and stress, its scans, earlier studies, and what is compared
// over the years.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import type { Result, Volume } from "./api";
import { volumes } from "./library";
import { type Pairing, type StudyPair, earlierStudies, picked, studyKey } from "./pairing";
import { ComparisonLink } from "./resultlink";
import { loadCompany } from "./scanlist";
import { SimulatedMark } from "./simulatedmark";
import { useWatched } from "./state";
import { cut, isoDay, study } from "./words";
import { OverTheYears } from "./yearscard";

interface Props {
  /** The key of the study. */
  name: string;
  /** All scans of the study that are known, also those that the list does not show. */
  scans: Volume[];
  pairing: Pairing;
  /** What was compared within the study, the newest first. */
  compared: Result[];
  /** The rows. */
  children: ComponentChildren;
}

export function StudyCard({ name, scans, pairing: { pairs, unpaired }, compared, children }: Props) {
  const known = useWatched(volumes);
  const [isComplete, setComplete] = useState(false);
  const [first] = scans;
  useEffect(() => {
    if (first)
      loadCompany(first).then(
        () => setComplete(true),
        () => undefined,
      );
  }, [name]);
  if (!first) return null;
  const isOf = ({ stress, rest }: StudyPair, made: Result) =>
    made.volume === stress.id && made.parameters["rest"] === rest.id;
  const before = earlierStudies(first, known);
  const others = compared.filter(made => !pairs.some(pair => isOf(pair, made)));
  return (
    <li class="study" data-study={name}>
      <div class="study-head">
        <h2 tabIndex={-1} title={study(first)}>
          {study(first, cut) || "One study"} <SimulatedMark of={first} />
        </h2>
        {others.map(made => (
          <ComparisonLink key={made.id} made={made} />
        ))}
        {pairs.map((pair, at) => (
          <Pair
            key={pair.stress.id}
            pair={pair}
            isFirst={at === 0}
            compared={compared.filter(made => isOf(pair, made))}
          />
        ))}
      </div>
      {isComplete && unpaired.length > 0 && <p class="quiet">{unpaired.join(" ")}</p>}
      <Earlier studies={before} />
      <OverTheYears scans={scans} before={before} isComplete={isComplete} />
      <ul class="scans">{children}</ul>
    </li>
  );
}

/** What was compared of a pair, and the button that compares it. */
function Pair({ pair, isFirst, compared }: { pair: StudyPair; isFirst: boolean; compared: Result[] }) {
  const compare = () => {
    picked.value = [pair.stress.id, pair.rest.id];
    requestAnimationFrame(() => {
      document.querySelector(".drop")?.scrollIntoView();
      document.querySelector<HTMLElement>(".pair-form input:checked")?.focus({ preventScroll: true });
    });
  };
  const what = compared.length > 0 ? "Compare again" : "Compare rest and stress";
  return (
    <span class="study-pair">
      {compared.map(made => (
        <ComparisonLink key={made.id} made={made} />
      ))}
      <button type="button" class={isFirst && compared.length === 0 ? "main" : ""} onClick={compare}>
        {what}
        {pair.kind && `: ${pair.kind}`}
      </button>
    </span>
  );
}

/** The card of a study, if the list shows it. */
const cardOf = (key: string | null): HTMLElement | undefined =>
  [...document.querySelectorAll<HTMLElement>(".study")].find(card => card.dataset["study"] === key);

/** Earlier studies of the patient: a press leads to their card, or where the list shows none, to their first scan. */
function Earlier({ studies }: { studies: Volume[][] }) {
  if (studies.length === 0) return null;
  return (
    <p class="earlier">
      Earlier {studies.length === 1 ? "study" : "studies"}:{" "}
      {studies.map(scans => (
        <EarlierStudy key={scans[0]?.id} scans={scans} />
      ))}
    </p>
  );
}

function EarlierStudy({ scans }: { scans: Volume[] }) {
  const [first] = scans;
  if (!first) return null;
  const go = (event: Event) => {
    const card = cardOf(studyKey(first));
    if (!card) return;
    event.preventDefault();
    card.scrollIntoView();
    card.querySelector("h2")?.focus({ preventScroll: true });
  };
  return (
    <a href={`#/scan/${first.id}`} onClick={go}>
      {isoDay(first.dicom?.study_date ?? "")} ({scans.length} {scans.length === 1 ? "scan" : "scans"})
    </a>
  );
}
