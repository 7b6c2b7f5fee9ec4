// The pictures of scripts/release/pictures.sh, which sets PROGRAM, CHROMIUM and PICTURES: a service of its own, a phantom, the page.

import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { start } from "./service.mjs";

const { PROGRAM, CHROMIUM, PICTURES } = process.env;
const PATIENCE_MS = 120_000;

const folder = mkdtempSync(join(tmpdir(), "pictures-"));
const made = spawnSync(PROGRAM, ["phantom", "-o", join(folder, "phantom"), "--defect", "7:0.7", "--defect", "13:0.7"], { encoding: "utf8" });
if (made.status !== 0) throw new Error(made.stderr);
const service = start(PROGRAM, join(folder, "data"));
try {
  const address = await service.address;
  const browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", "--enable-unsafe-swiftshader"] });
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, colorScheme: "light", deviceScaleFactor: 0.8 });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(address);
  await page.setInputFiles("input[aria-label='Files of scans']", [join(folder, "phantom/spect.nii.gz")]);
  const wall = page.locator("canvas[aria-label^='The wall in three dimensions']");
  await wall.waitFor();
  await page.waitForSelector(".polar canvas");
  // The views are drawn when their data have come.
  await page.waitForLoadState("networkidle");
  await page.waitForTimeout(1500);
  await page.screenshot({ path: join(PICTURES, "page.png") });
  // The mesh alone: its edges shown, the view's controls out of the way.
  const closer = await browser.newContext({ viewport: { width: 1440, height: 900 }, colorScheme: "light" });
  const other = await closer.newPage();
  other.setDefaultTimeout(PATIENCE_MS);
  await other.goto(page.url());
  const alone = other.locator("canvas[aria-label^='The wall in three dimensions']");
  await alone.waitFor();
  await other.getByLabel("edges").check();
  await other.waitForLoadState("networkidle");
  await other.waitForTimeout(1500);
  await alone.evaluate(canvas => {
    for (const beside of canvas.parentElement.children) if (beside !== canvas) beside.style.visibility = "hidden";
  });
  await alone.screenshot({ path: join(PICTURES, "wall.png") });
  await browser.close();
} finally {
  service.child.kill();
  rmSync(folder, { recursive: true, force: true });
}
