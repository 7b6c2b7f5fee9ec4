// Values that components watch.

import { useLayoutEffect, useState } from "preact/hooks";

export class Watched<T> {
  private watchers = new Set<() => void>();
  constructor(private current: T) {}

  get value(): T {
    return this.current;
  }

  set value(next: T) {
    if (Object.is(next, this.current)) return;
    this.current = next;
    for (const watcher of [...this.watchers]) watcher();
  }

  watch(watcher: () => void): () => void {
    this.watchers.add(watcher);
    return () => this.watchers.delete(watcher);
  }
}

/** The value of `watched`; the component is drawn again when it changes. */
export function useWatched<T>(watched: Watched<T>): T {
  const [, draw] = useState(0);
  // Not `useEffect`: it runs after the view was painted, and what changes until then would not be seen.
  const drawn = watched.value;
  useLayoutEffect(() => {
    const again = () => draw(n => n + 1);
    // What another view has changed since this one was drawn.
    if (!Object.is(watched.value, drawn)) again();
    return watched.watch(again);
  }, [watched]);
  return watched.value;
}
