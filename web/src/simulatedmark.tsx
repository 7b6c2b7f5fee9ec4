// That a scan is of a simulated patient, in lists and heads.

import type { Volume } from "./api";
import { isOfSimulated } from "./words";

export function SimulatedMark({ of }: { of: Volume }) {
  return isOfSimulated(of) ? <span class="role simulated">simulated</span> : null;
}
