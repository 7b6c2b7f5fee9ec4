// A signed reading: who read when, its files, and how far its structured report is on the way to the archive.

import { useEffect, useState } from "preact/hooks";
import { Abbreviation } from "../abbreviation";
import { type Job, type Result, type Volume, call, get, page, save, words } from "../api";
import { fileNameOf } from "../bundle";
import type { ObjectDelivery } from "../generated/openapi";
import { jobs, put } from "../library";
import { readBy } from "../reading";
import { useWatched } from "../state";
import { moment } from "../words";
import { PageButton } from "./figures";

/** Pause between two looks at deliveries that wait, ms. */
const PAUSE = 3000;

interface Props {
  reading: Result;
  volume: Volume;
}

export function SignedReading({ reading, volume }: Props) {
  const { sss, srs, sds, quality } = reading.summary;
  const sums = { SSS: sss, SRS: srs, SDS: sds };
  const scores = [
    sds == null
      ? sss != null && `sum ${sss}`
      : Object.entries(sums).map(([name, sum], at) => [
          at > 0 && ", ",
          <Abbreviation key={name}>{name}</Abbreviation>,
          ` ${sum}`,
        ]),
    quality && `quality ${quality}`,
  ].filter(Boolean);
  return (
    <div class="signed">
      <p role="status">
        <b>{readBy(reading)}</b>
        {scores.length > 0 && <span class="quiet"> {scores.map((score, at) => [at > 0 && "; ", score])}</span>}
      </p>
      <ReadingFiles reading={reading} volume={volume} />
      <Deliveries reading={reading} />
    </div>
  );
}

function ReadingFiles({ reading: { links }, volume }: Props) {
  const [problem, setProblem] = useState("");
  const failed = (error: unknown) => setProblem(words(error));
  const name = fileNameOf(volume);
  const saved = (path: string, file: string) => () => {
    setProblem("");
    void save(path, `${name}_reading_${file}`).catch(failed);
  };
  const [object] = links.dicom ?? [];
  return (
    <>
      <div class="buttons">
        {links.page && (
          <PageButton path={links.page} name={`${name}_reading.html`} failed={failed}>
            Printed page
          </PageButton>
        )}
        {object && (
          <button type="button" class="plain" onClick={saved(object, "measurements.dcm")}>
            Structured report
          </button>
        )}
        {links.fhir && (
          <button type="button" class="plain" onClick={saved(links.fhir, "fhir.json")}>
            FHIR
          </button>
        )}
      </div>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </>
  );
}

/** The readings that others replaced. */
export function FormerReadings({ former, volume }: { former: Result[]; volume: Volume }) {
  const [problem, setProblem] = useState("");
  if (former.length === 0) return null;
  return (
    <details class="former">
      <summary>
        {former.length} former {former.length === 1 ? "reading" : "readings"}
      </summary>
      <ul>
        {former.map(reading => (
          <li key={reading.id}>
            <span>{readBy(reading)}</span>
            {reading.links.page && (
              <PageButton
                path={reading.links.page}
                name={`${fileNameOf(volume)}_former_reading.html`}
                failed={error => setProblem(words(error))}>
                Printed page
              </PageButton>
            )}
          </li>
        ))}
      </ul>
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
    </details>
  );
}

/** The job that wrote a reading, looked at again while something of it waits. */
function useJobOf(reading: Result): Job | undefined {
  const job = useWatched(jobs).find(one => one.reading === reading.id);
  const isKnown = job !== undefined;
  const waits = job?.deliveries?.some(delivery => delivery.state === "pending") ?? false;
  useEffect(() => {
    if (isKnown) return;
    page<Job>("jobs", { volume: reading.volume, kind: "reading", limit: 100 }).then(
      ({ items }) => items.filter(one => one.reading === reading.id).forEach(put),
      () => undefined,
    );
  }, [reading.id, isKnown]);
  const self = job?.links.self;
  useEffect(() => {
    if (!waits || !self) return;
    const timer = setInterval(() => void get<Job>(self).then(put, () => undefined), PAUSE);
    return () => clearInterval(timer);
  }, [waits, self]);
  return job;
}

function Deliveries({ reading }: { reading: Result }) {
  const job = useJobOf(reading);
  const [problem, setProblem] = useState("");
  const again = async ({ links }: Job, id: string) => {
    setProblem("");
    await call(`${links.self}/deliveries/${id}/redeliver`, { method: "POST" });
    put(await get<Job>(links.self));
  };
  if (!job?.deliveries) return <p class="quiet">Not sent to the PACS.</p>;
  return (
    <div class="deliveries" role="status">
      {job.deliveries.map(delivery => (
        <p key={delivery.id ?? delivery.name}>
          <DeliveryState delivery={delivery} />
          {delivery.state === "dead" && delivery.id && (
            <button
              type="button"
              onClick={() => void again(job, delivery.id!).catch(error => setProblem(words(error)))}>
              Send again
            </button>
          )}
        </p>
      ))}
      {problem && <p class="error">{problem}</p>}
    </div>
  );
}

function DeliveryState({ delivery }: { delivery: ObjectDelivery }) {
  const { to, state, last_error: why, attempts, next_attempt_at: next, last_attempt_at: last } = delivery;
  const sentence = why && (/[.!?]$/.test(why) ? why : `${why}.`);
  if (state === "delivered")
    return (
      <span class="delivered">
        Delivered to {to}
        {last && `, ${moment(last)}`}.
      </span>
    );
  if (state === "dead")
    return (
      <span class="error">
        Sending to {to} failed{sentence ? `: ${sentence}` : "."}
      </span>
    );
  return (
    <span>
      Waiting for {to}.{" "}
      {attempts > 0 && (
        <span class="warning">
          Tried {attempts === 1 ? "once" : `${attempts} times`}
          {sentence ? `: ${sentence}` : "."}
          {next && ` Next try ${moment(next)}.`}
        </span>
      )}
    </span>
  );
}
