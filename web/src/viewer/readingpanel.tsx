// The reading of a result: whether it was read, by whom, and what somebody states who reads or amends it.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { type Volume, words } from "../api";
import { jobs, loadReadings, readings, readingsOf } from "../library";
import { type Readable, draftFrom, drafts, firstDraft, keepDraft, readBy } from "../reading";
import { useWatched } from "../state";
import { ReadingForm } from "./readingform";
import { FormerReadings, SignedReading } from "./signed";

const HEAD = ".reading h2";

/** Whether the result was read, where its view begins, and the way to the panel. */
export function ReadingState({ of }: { of: string }) {
  useWatched(readings);
  const [newest] = readingsOf(of);
  const show = () => {
    const head = document.querySelector<HTMLElement>(HEAD);
    head?.scrollIntoView();
    head?.focus({ preventScroll: true });
  };
  return (
    <p class="reading-state">
      <span>{newest ? readBy(newest) : "Not read yet"}</span>
      <button type="button" class="plain" onClick={show}>
        Reading
      </button>
    </p>
  );
}

export function ReadingPanel({ readable, volume }: { readable: Readable; volume: Volume }) {
  const { id } = readable.result;
  const draft = useWatched(drafts).get(id);
  useWatched(readings);
  const [newest, ...former] = readingsOf(id);
  const [isOpen, setOpen] = useState(draft?.isChanged ?? false);
  const [problem, setProblem] = useState("");
  const job = useWatched(jobs).find(one => one.id === draft?.job);
  useEffect(() => void loadReadings().catch(error => setProblem(words(error))), [id]);

  const isGone = draft === undefined;
  useEffect(() => {
    if (isGone) setOpen(false);
  }, [isGone]);

  // The button that was pressed is gone.
  const head = useRef<HTMLHeadingElement>(null);
  const wasOpen = useRef(isOpen);
  useLayoutEffect(() => {
    if (wasOpen.current !== isOpen) head.current?.focus();
    wasOpen.current = isOpen;
  }, [isOpen]);

  const begin = async () => {
    setProblem("");
    if (!draft?.isChanged) keepDraft(id, newest ? await draftFrom(readable, newest) : firstDraft(readable));
    setOpen(true);
  };
  const close = () => setOpen(false);
  return (
    <section class="reading" aria-label="Reading">
      <h2 tabIndex={-1} ref={head}>
        Reading
      </h2>
      {newest ? <SignedReading reading={newest} volume={volume} /> : !isOpen && <p class="quiet">Not read yet.</p>}
      {!isOpen && (
        <div class="buttons">
          <button
            type="button"
            aria-expanded="false"
            onClick={() => void begin().catch(error => setProblem(words(error)))}>
            {newest ? "Amend" : "Read"}
          </button>
          {draft?.isChanged && <span class="warning">Not signed yet.</span>}
        </div>
      )}
      {problem && (
        <p class="error" role="alert">
          {problem}
        </p>
      )}
      {isOpen && draft && <ReadingForm readable={readable} draft={draft} newest={newest} job={job} onClose={close} />}
      <FormerReadings former={former} volume={volume} />
    </section>
  );
}
