// One picture of all views as they stand, with the name of the scan.

import { saveBlob } from "../save";
import { label } from "./drawing";

export function screenshot(stage: HTMLElement, name: string): void {
  const box = stage.getBoundingClientRect();
  const canvases = [...stage.querySelectorAll("canvas")].filter(canvas => canvas.clientHeight > 30);
  const ratio = 2;
  const out = document.createElement("canvas");
  const top = Math.min(...canvases.map(canvas => canvas.getBoundingClientRect().top)) - box.top;
  const bottom = Math.max(...canvases.map(canvas => canvas.getBoundingClientRect().bottom)) - box.top;
  Object.assign(out, { width: box.width * ratio, height: (bottom - top + 28) * ratio });
  const context = out.getContext("2d");
  if (!context) return;
  context.scale(ratio, ratio);
  context.fillStyle = "#0a0e11";
  context.fillRect(0, 0, out.width, out.height);
  for (const canvas of canvases) {
    const place = canvas.getBoundingClientRect();
    context.drawImage(canvas, place.left - box.left, place.top - box.top - top, place.width, place.height);
  }
  label(
    context,
    `${name} · ventriform, research software, not a medical device · ${new Date().toLocaleString()}`,
    8,
    bottom - top + 14,
    "left",
    12,
  );
  out.toBlob(blob => blob && saveBlob(blob, `${name}.png`));
}
