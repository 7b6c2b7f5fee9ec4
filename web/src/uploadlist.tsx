// What is being sent and what was, and why files were refused.

import { useState } from "preact/hooks";
import { sentences } from "./api";
import { Trouble } from "./jobline";
import { open } from "./route";
import { useWatched } from "./state";
import { type Upload, again, batchesOf, dismiss, isForeign, isUnderWay, stop, uploads } from "./upload";
import { bytes, cut } from "./words";

const STATES: Record<Upload["state"], string> = {
  waiting: "waits",
  sending: "is sent",
  reading: "is being read",
  stored: "stored",
  refused: "refused",
  interrupted: "The connection broke before the service had everything. Nothing is lost: send it again.",
  cancelled: "cancelled",
};

export function Uploads() {
  const all = useWatched(uploads);
  if (all.length === 0) return null;
  return (
    <section aria-label="Uploads" class="uploads">
      <ul>
        {batchesOf(all).flatMap(({ number, told, lines, behind }) => [
          told.length > 0 && <Told key={`batch ${number}`} uploads={told} />,
          ...lines.map(upload => <Line key={upload.id} upload={upload} />),
          behind.length > 0 && <Behind key={`behind ${number}`} uploads={behind} />,
        ])}
      </ul>
    </section>
  );
}

const counted = (count: number, one: string, several: string) =>
  count > 0 ? [`${count} ${count === 1 ? one : several}`] : [];

const filesOf = (some: Upload[]) => some.reduce((sum, upload) => sum + upload.group.files.length, 0);

/** One sentence on what was sent together; the names of foreign files are shown when asked for. */
function Told({ uploads: told }: { uploads: Upload[] }) {
  const [isShown, setShown] = useState(false);
  const shows = isShown ? "hide" : "show";
  const foreign = told.filter(isForeign);
  const stored = told.filter(upload => upload.volume);
  const before = stored.filter(upload => upload.existed).length;
  const parts = [
    ...counted(stored.length - before, "scan stored", "scans stored"),
    ...counted(before, "scan was stored before", "scans were stored before"),
    ...counted(filesOf(foreign), "file is no scan", "files are no scans"),
  ];
  return (
    <li class="told">
      <span role="status">{parts.join(", ")}:</span>
      <button
        type="button"
        class="plain"
        aria-expanded={isShown}
        aria-label={`${shows} the files that are no scans`}
        onClick={() => setShown(!isShown)}>
        {shows}
      </button>
      <span class="end">
        <button
          type="button"
          class="plain"
          aria-label="Take these files off this list"
          onClick={() => dismiss(...told)}>
          ✕
        </button>
      </span>
      {isShown && (
        <dl class="foreign" tabIndex={0} aria-label="Files that are no scans">
          {foreign.map(upload => (
            <div key={upload.id}>
              <dt title={upload.group.name}>{cut(upload.group.name)}</dt>
              <dd>{upload.problem && sentences(upload.problem)[0]}</dd>
            </div>
          ))}
        </dl>
      )}
    </li>
  );
}

function Behind({ uploads: behind }: { uploads: Upload[] }) {
  return (
    <li class="waiting">
      <span>{counted(behind.length, "more waits", "more wait")}</span>
      <span class="end">
        <button type="button" class="plain" aria-label="Cancel these too" onClick={() => behind.forEach(stop)}>
          Cancel
        </button>
      </span>
    </li>
  );
}

function Line({ upload }: { upload: Upload }) {
  const underway = isUnderWay(upload);
  const ended = upload.state === "refused" || upload.state === "interrupted" || upload.state === "cancelled";
  return (
    <li class={upload.state}>
      <span class="name" title={upload.group.name}>
        {cut(upload.group.name)}
      </span>
      <span class="quiet">
        {bytes(upload.bytes)}
        {upload.group.files.length > 1 && `, ${upload.group.files.length} files`}
      </span>
      {upload.state === "sending" && (
        <progress value={upload.sent} max={upload.bytes || 1} aria-label={`Sending ${upload.group.name}`} />
      )}
      <span role="status" class={upload.state === "refused" || upload.state === "interrupted" ? "error" : "state"}>
        {upload.problem ? (
          <Trouble problem={upload.problem} />
        ) : upload.existed ? (
          "was stored before"
        ) : (
          STATES[upload.state]
        )}
      </span>
      <span class="end">
        {underway && (
          <button type="button" class="plain" onClick={() => stop(upload)}>
            Cancel
          </button>
        )}
        {ended && (
          <button type="button" onClick={() => again(upload)}>
            Send again
          </button>
        )}
        {upload.volume && (
          <button type="button" onClick={() => upload.volume && open(upload.volume.id)}>
            Open
          </button>
        )}
        {!underway && (
          <button
            type="button"
            class="plain"
            aria-label={`Take ${upload.group.name} off this list`}
            onClick={() => dismiss(upload)}>
            ✕
          </button>
        )}
      </span>
    </li>
  );
}
