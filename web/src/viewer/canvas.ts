// Canvases of views: as many pixels as on the screen, drawn when there is something new.

import { useEffect, useRef } from "preact/hooks";

/** Gives a canvas as many pixels as it has on the screen. */
function fit(element: HTMLCanvasElement): void {
  const ratio = Math.min(2, devicePixelRatio);
  const [width, height] = [Math.round(element.clientWidth * ratio), Math.round(element.clientHeight * ratio)];
  if (element.width !== width || element.height !== height) Object.assign(element, { width, height });
}

/**
 * A canvas that is drawn after its component or its size has changed and when `watch` calls, at most once a frame. It
 * is watched anew when `source` is another one.
 */
export function useCanvas(
  draw: (element: HTMLCanvasElement) => void,
  watch: (act: () => void) => () => void,
  source: unknown,
) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const latest = useRef(draw);
  latest.current = draw;
  const ask = useRef(() => undefined as void);
  useEffect(() => {
    const element = canvas.current;
    if (!element) return;
    let asked = 0;
    ask.current = () => {
      asked ||= requestAnimationFrame(() => {
        asked = 0;
        fit(element);
        if (element.width > 1 && element.height > 1) latest.current(element);
      });
    };
    const sizes = new ResizeObserver(() => ask.current());
    sizes.observe(element);
    const end = watch(() => ask.current());
    return () => {
      cancelAnimationFrame(asked);
      sizes.disconnect();
      end();
    };
  }, [source]);
  useEffect(() => ask.current());
  return { canvas, ask: () => ask.current() };
}
