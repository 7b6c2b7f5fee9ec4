// Self-contained reports, opened as files: what their script draws is what the program drew as pictures.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { statSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

/** Largest report, bytes. */
const LARGEST = 1_100_000;

/** Reports of a fit and of a model of a scan with two infarcts; returns their addresses. */
export function reports(program, folder) {
  const run = (...words) => {
    const made = spawnSync(program, words, { encoding: "utf8" });
    assert.equal(made.status, 0, made.stderr);
  };
  const scan = join(folder, "scan/spect.nii.gz");
  run("phantom", "-o", join(folder, "scan"), "--defect", "13:0.8", "--defect", "10:0.6");
  run("segment", scan, "--model", "auto", "-o", join(folder, "fit"));
  run("generate", scan, "--points", "150", "-o", join(folder, "model.json"), "--report", join(folder, "model.html"));
  const files = { fit: join(folder, "fit/report.html"), model: join(folder, "model.html") };
  for (const [name, file] of Object.entries(files)) {
    const { size } = statSync(file);
    console.log(`  report of a ${name}: ${(size / 1e3).toFixed(0)} kB`);
    assert.ok(size < LARGEST, `${name}: ${size} bytes`);
  }
  return Object.fromEntries(Object.entries(files).map(([name, file]) => [name, pathToFileURL(file).href]));
}

/** The polar map on the canvas beside the SVG in the same report. */
export async function samePolarMap(page) {
  const found = await page.evaluate(() => {
    const uri = document.querySelector("img[src^='data:image/svg']").src;
    const svg = new DOMParser().parseFromString(atob(uri.split(",")[1]), "image/svg+xml");
    const map = JSON.parse(document.getElementById("data").textContent).polar;
    const canvas = document.querySelector("#polar canvas");
    const { width: size } = canvas;
    const pixels = canvas.getContext("2d").getImageData(0, 0, size, size).data;
    // Both maps are circles: of 280 about (320, 320), and of 0.43 of the canvas.
    const place = ([x, y]) => [size / 2 + ((x - 320) / 280) * 0.43 * size, size / 2 + ((y - 320) / 280) * 0.43 * size];
    const at = ([x, y]) => [0, 1, 2].map(n => pixels[4 * (Math.floor(y) * size + Math.floor(x)) + n]);
    const rgb = hex => [1, 3, 5].map(n => parseInt(hex.slice(n, n + 2), 16));
    const apart = (a, b) => Math.max(...a.map((part, n) => Math.abs(part - b[n])));
    const paths = [...svg.querySelectorAll("path")].slice(0, map.rows * map.columns);
    const isHatched = n => map.states[Math.floor(n / map.columns)][n % map.columns] === "valve_plane";
    const middles = paths.map(path => {
      const corners = path
        .getAttribute("d")
        .slice(1, -1)
        .split("L")
        .map(text => text.split(" ").map(Number));
      return place([0, 1].map(n => corners.reduce((sum, corner) => sum + corner[n], 0) / corners.length));
    });
    const fills = paths.map((path, n) => apart(at(middles[n]), rgb(path.getAttribute("fill"))));
    const tiles = fills.filter((_, n) => !isHatched(n));
    const cyan = [0, 220, 255];
    const lines = [...svg.querySelectorAll("line[stroke='#00dcff']")]
      .map(line => ["x1", "y1", "x2", "y2"].map(name => Number(line.getAttribute(name))))
      .map(([x1, y1, x2, y2]) => place([(x1 + x2) / 2, (y1 + y2) / 2]))
      .filter(([x]) => x < size);
    const near = ([x, y], reach, test) => {
      for (let dy = -reach; dy <= reach; dy++)
        for (let dx = -reach; dx <= reach; dx++) if (test([x + dx, y + dy])) return true;
      return false;
    };
    const hatches = middles.filter((_, n) => isHatched(n));
    const hatch = rgb([...svg.querySelectorAll("line")][0].getAttribute("stroke"));
    const isHatch = place => apart(at(place), hatch) < 12;
    const isCyan = place => apart(at(place), cyan) < 40;
    let [drawn, stray] = [0, 0];
    for (let y = 0; y < size; y++) {
      for (let x = 0; x < size; x++) {
        if (!isCyan([x, y])) continue;
        drawn++;
        if (!lines.some(line => Math.hypot(line[0] - x, line[1] - y) < 0.03 * size)) stray++;
      }
    }
    const texts = [...svg.querySelectorAll("text")].slice(0, 17).map(text => text.textContent);
    return {
      tiles: tiles.sort((a, b) => a - b),
      hatches: hatches.length,
      hatched: hatches.filter(place => near(place, 2, isHatch)).length,
      lines: lines.length,
      covered: lines.filter(line => near(line, 2, isCyan)).length,
      drawn,
      stray,
      texts,
      means: map.segments.map(segment => (segment.mean_percent === null ? "-" : segment.mean_percent.toFixed(0))),
      label: canvas.getAttribute("aria-label"),
      numbers: [...document.querySelectorAll("tr[data-segment]")].map(row => Number(row.dataset.segment)),
      names: map.segments.map(segment => segment.name),
    };
  });
  const { tiles, hatches, hatched, lines, covered, drawn, stray } = found;
  const quantile = share => tiles[Math.floor(share * tiles.length)];
  console.log(
    `  polar map: colours apart by ${quantile(0.5)} (half of the ${tiles.length} places), ${quantile(0.9)} (nine tenths); ` +
      `${covered} of ${lines} parts of the contour, ${stray} of ${drawn} pixels beside it`,
  );
  // A tenth lies under lines and numbers.
  assert.ok(
    tiles.length + hatches === 1920 && quantile(0.5) <= 2 && quantile(0.9) <= 6,
    "the colours are those of the picture",
  );
  console.log(`  valve plane: ${hatched} of ${hatches} places hatched`);
  assert.ok(hatches > 20 && hatched >= 0.9 * hatches, "the valve plane is hatched as in the picture");
  assert.ok(lines > 20 && covered >= 0.9 * lines && stray <= 0.02 * drawn, "the contour is that of the picture");
  assert.deepEqual(found.texts, found.means, "the segments have the numbers of the picture");
  assert.deepEqual(
    found.numbers,
    Array.from({ length: 17 }, (_, n) => n + 1),
  );
  for (const name of found.names) assert.ok(found.label.includes(name), name);
}
