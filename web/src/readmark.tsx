// That a result was read, in lists and menus.

import { readings, readingsOf } from "./library";
import { readBy } from "./reading";
import { useWatched } from "./state";

export function ReadMark({ of }: { of: string }) {
  useWatched(readings);
  const [newest] = readingsOf(of);
  return newest ? (
    <span class="read" title={readBy(newest)}>
      read
    </span>
  ) : null;
}
