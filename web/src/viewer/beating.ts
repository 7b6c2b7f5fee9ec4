// The moment of a beat that views show.

import { Watched } from "../state";

export class Beating {
  /** The moment of the beat, in turns of its cycle; null where nothing beats. */
  readonly moment = new Watched<number | null>(null);
  /** The moment in the middle of the gate that is shown: it changes with the gate. */
  readonly gate = new Watched<number | null>(null);
  /** Counts how often the beat was stopped at a moment. */
  readonly held = new Watched<number>(0);

  /** Shows a moment of a beat of so many gates, and stops there. */
  hold(turns: number, gates: number): void {
    this.held.value += 1;
    this.goTo(turns, gates);
  }

  /** Shows a moment of a beat of so many gates. */
  goTo(turns: number, gates: number): void {
    this.gate.value = (Math.floor(turns * gates) + 0.5) / gates;
    this.moment.value = turns;
  }

  /** Shows no moment, but the sum of all gates. */
  leave(): void {
    this.held.value += 1;
    this.moment.value = null;
    this.gate.value = null;
  }
}

/** What belongs to the gate at a moment of the cycle. */
export function gateAt<T>(gates: T[], turns: number | null): T | undefined {
  return turns === null ? undefined : gates[Math.min(gates.length - 1, Math.floor(turns * gates.length))];
}
