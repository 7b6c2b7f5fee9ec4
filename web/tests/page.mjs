// The page in a browser, as a person uses it. Run by scripts/check/page.sh, which sets PROGRAM, SCREENSHOTS and
// CHROMIUM.
//
// Every view is looked at by axe-core; anything that the console reports, that the policy forbids, or that leaves this
// machine fails the check.

import { spawnSync } from "node:child_process";
import { createRequire } from "node:module";
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, truncateSync, writeFileSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import { gunzipSync } from "node:zlib";
import { join } from "node:path";
import assert from "node:assert/strict";
import { chromium } from "playwright-core";
import { comparisons } from "./comparison.mjs";
import { examples } from "./examples.mjs";
import { gated, gatedNm, heartless, nm, pair, series, small } from "./nm.mjs";
import { pulls } from "./pull.mjs";
import { readings } from "./reading.mjs";
import { reports, samePolarMap } from "./report.mjs";
import { serials } from "./serial.mjs";
import { start } from "./service.mjs";
import { studies } from "./study.mjs";

const { PROGRAM, SCREENSHOTS, CHROMIUM } = process.env;
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const SCAN = join(SCREENSHOTS, "phantom/spect.nii.gz");
const TRUTH = join(SCREENSHOTS, "phantom/lv_truth.nii.gz");
const PATIENCE = Number(process.env.PATIENCE ?? 120_000);

let [passed, failed] = [0, 0];
const ends = [];
/** The open tabs, and what went wrong behind each. */
const tabs = new Map();

/** Starts a service with a data folder of its own; returns its address and folder. */
async function service(...flags) {
  const data = mkdtempSync(join(tmpdir(), "page-"));
  const { child, address } = start(PROGRAM, join(data, "data"), ...flags);
  const stopped = new Promise(done => child.on("exit", done));
  const stop = async () => {
    child.kill();
    await stopped;
  };
  ends.push(async () => {
    await stop();
    rmSync(data, { recursive: true, force: true });
  });
  return { address: await address, data: join(data, "data"), stop };
}

/** A tab that fails the check if anything is wrong behind the view. */
async function tab(
  browser,
  address,
  {
    width = 1280,
    height = width > 600 ? 800 : 850,
    dark = false,
    expected = [],
    script,
    scripts = true,
    ratio = 1,
    motion = true,
  } = {},
) {
  const context = await browser.newContext({
    viewport: { width, height },
    colorScheme: dark ? "dark" : "light",
    hasTouch: width < 600,
    acceptDownloads: true,
    javaScriptEnabled: scripts,
    deviceScaleFactor: ratio,
    reducedMotion: motion ? "no-preference" : "reduce",
  });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const faults = [];
  // The software renderer of this browser reports its own slowness.
  const usual = [/GL Driver Message/, /software WebGL/, ...expected];
  page.on("console", message => {
    if (["error", "warning"].includes(message.type()) && !usual.some(words => words.test(message.text())))
      faults.push(`console: ${message.text()}`);
  });
  page.on("pageerror", error => faults.push(`error: ${error.stack}`));
  page.on("request", request => {
    const url = request.url();
    if (url !== address && !url.startsWith(new URL(address).origin) && !/^(blob|data):/.test(url))
      faults.push(`leaves the host: ${url}`);
  });
  await page.addInitScript(() =>
    document.addEventListener("securitypolicyviolation", event =>
      console.error("policy", event.violatedDirective, event.blockedURI),
    ),
  );
  if (script) await page.addInitScript(script);
  await page.goto(address);
  tabs.set(page, faults);
  const close = async () => {
    tabs.delete(page);
    await context.close();
  };
  return { page, faults, close };
}

/** Says what the tabs of a failed check show, keeps pictures of them, and closes them. */
async function examine(name) {
  for (const [page, faults] of tabs) {
    const text = await page
      .evaluate(() => `${location.href}\n${document.body.innerText}`)
      .catch(error => error.message);
    console.log(`the tab shows: ${text.slice(0, 2000)}\n${faults.join("\n")}`);
    await page
      .screenshot({ path: join(SCREENSHOTS, `failed ${name}.png`), timeout: 10_000 })
      .catch(error => console.log(error.message));
    await page.context().close();
  }
  tabs.clear();
}

/** axe finds nothing, nothing sticks out to the right; the picture is kept. */
async function look(page, name) {
  await page.waitForTimeout(150);
  await page.screenshot({ path: join(SCREENSHOTS, `${name}.png`), fullPage: true });
  const wider = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(wider <= 0, `${name}: ${wider} px wider than the window`);
  // Tables scroll by themselves; the column about them does not. That of a beat still does, by 32 px at 1280.
  const columns = await page.evaluate(() =>
    [...document.querySelectorAll(".comparison .facts")].map(column => {
      const right = column.getBoundingClientRect().right;
      const inner = [...column.querySelectorAll("*")].filter(
        one => one.getBoundingClientRect().right > right + 1 && !one.closest(".wide table"),
      );
      return [
        column.className,
        column.scrollWidth - column.clientWidth,
        ...inner.slice(0, 4).map(one => `${one.tagName}.${one.className} ${one.textContent.slice(0, 20)}`),
      ];
    }),
  );
  for (const [column, over, ...which] of columns)
    assert.ok(over <= 0, `${name}: ${column} scrolls by ${over} px: ${which}`);
  // axe runs in a world of its own, so the policy of the page does not apply to it.
  const session = await page.context().newCDPSession(page);
  const { frameTree } = await session.send("Page.getFrameTree");
  const { executionContextId } = await session.send("Page.createIsolatedWorld", { frameId: frameTree.frame.id });
  const run = async expression => {
    const { result, exceptionDetails } = await session.send("Runtime.evaluate", {
      contextId: executionContextId,
      expression,
      awaitPromise: true,
      returnByValue: true,
    });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  };
  await run(AXE);
  const text = await run(
    // Rules that axe leaves off by itself.
    "axe.run({ rules: { 'target-size': { enabled: true }, 'empty-table-header': { enabled: true } } })" +
      ".then(r => JSON.stringify(r.violations" +
      ".map(v => [v.id, v.nodes.slice(0, 3).map(n => n.html.slice(0, 160))])))",
  );
  assert.deepEqual(JSON.parse(text), [], name);
  await session.detach();
}

/** Checks whose name holds the first argument, if there is one. */
async function check(name, act) {
  if (process.argv[2] && !name.includes(process.argv[2])) return;
  const start = Date.now();
  try {
    await act();
    passed++;
    console.log(`ok: ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed++;
    console.log(`FAILED: ${name}\n${error.stack}`);
    await examine(name);
  }
}

const choose = (page, ...files) => page.setInputFiles("input[aria-label='Files of scans']", files);
/** Opens the list, with a fitted scan on it. */
const filled = async (page, address) => {
  await page.waitForSelector(".drop");
  await choose(page, SCAN);
  await drawn(page);
  await page.goto(`${address}/#/`);
  await page.waitForSelector(".scan .result");
};
/** The names in a zip, which another program finds sound. */
const namesIn = path => {
  const tested = spawnSync("python3", ["-m", "zipfile", "-t", path], { encoding: "utf8" });
  assert.equal(tested.status, 0, `the zip is sound: ${tested.stdout}${tested.stderr}`);
  return spawnSync("python3", ["-m", "zipfile", "-l", path], { encoding: "utf8" }).stdout;
};

/** Prints; the answer is the number of pages. */
async function printed(page, name) {
  const path = join(SCREENSHOTS, `${name}.pdf`);
  await page.pdf({ path, preferCSSPageSize: true, printBackground: true });
  return readFileSync(path, "latin1").split(/\/Type\s*\/Page\b/).length - 1;
}

/**
 * A way to the service that breaks, or holds on, once so many bytes were sent on one connection; it is whole again
 * after `mend`.
 */
async function fragile(address, bytes, { holds = false } = {}) {
  let whole = false;
  const server = net.createServer(from => {
    const to = net.connect(Number(new URL(address).port), "127.0.0.1");
    let sent = 0;
    const end = () => {
      from.destroy();
      to.destroy();
    };
    from.on("data", chunk => {
      sent += chunk.length;
      if (whole || sent <= bytes) to.write(chunk);
      else if (holds) from.pause();
      else end();
    });
    to.on("data", chunk => from.write(chunk));
    for (const one of [from, to]) {
      one.on("error", end);
      one.on("close", end);
    }
  });
  await new Promise(done => server.listen(0, "127.0.0.1", done));
  ends.push(() => server.close());
  return { address: `http://127.0.0.1:${server.address().port}`, mend: () => (whole = true) };
}

/** A NIfTI-1 file of 42 MB. */
function largeScan() {
  const [shape, spacing] = [[256, 256, 320], 2];
  const file = Buffer.alloc(352 + 2 * shape[0] * shape[1] * shape[2]);
  file.writeInt32LE(348, 0);
  [3, ...shape, 1, 1, 1, 1].forEach((n, at) => file.writeInt16LE(n, 40 + 2 * at));
  file.writeInt16LE(4, 70);
  file.writeInt16LE(16, 72);
  [1, spacing, spacing, spacing].forEach((mm, at) => file.writeFloatLE(mm, 76 + 4 * at));
  file.writeFloatLE(352, 108);
  file.writeFloatLE(1, 112);
  file[123] = 2;
  file.writeInt16LE(1, 254);
  [0, 1, 2].forEach(row => file.writeFloatLE(spacing, 280 + 20 * row));
  file.write("n+1\0", 344, "latin1");
  for (let at = 352; at < file.length; at += 2) file[at] = at >> 10;
  return file;
}

/** The views of a fit are drawn. */
const drawn = page => page.waitForSelector(".polar canvas");

// Jobs that somebody else files draw the view again; what was typed in a correction stays.
async function typedWhileJobsBegin(page, field) {
  const typed = String(Number(await field.inputValue()) + 3);
  await field.fill(typed);
  // The page looks for jobs that it has not filed every 15 s: enough of them that some are left by then.
  const filed = await page.evaluate(async () => {
    const volume = /vol_\w+/.exec(location.hash)[0];
    const file = async seed => {
      const order = { volume, kind: "model", parameters: { points: 3000, starts: 4, method: "paper", seed } };
      const answer = await fetch("/v1/jobs", {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify(order),
      });
      return (await answer.json()).links.self;
    };
    return Promise.all(Array.from({ length: 24 }, (_, n) => file(n + 1)));
  });
  await page.waitForSelector(".job.queued, .job.running");
  // Their results stand in the list, and do not replace the fit that is corrected.
  const corrected = await page.textContent(".choices .current");
  const models = await page.locator(".choices li", { hasText: "Model, 3000 points" }).count();
  await page.waitForFunction(
    before =>
      [...document.querySelectorAll(".choices li")].filter(one => /Model, 3000/.test(one.textContent)).length > before,
    models,
  );
  assert.equal(await page.textContent(".choices .current"), corrected);
  assert.equal(await field.inputValue(), typed);
  await field.press("Tab");
  await page.waitForFunction(() =>
    /Changed: base/.test(document.querySelector(".correction [role=status]").textContent),
  );
  await page.evaluate(jobs => Promise.all(jobs.map(job => fetch(job, { method: "DELETE" }))), filed);
  await page.waitForFunction(() => !document.querySelector(".job.queued, .job.running"));
  await page.getByRole("button", { name: "Undo changes" }).click();
}

async function main() {
  const browser = await chromium.launch({
    executablePath: CHROMIUM,
    args: ["--no-sandbox", "--enable-unsafe-swiftshader"],
  });
  ends.push(() => browser.close());
  const { address } = await service();

  await check("packed files hold what the plain ones do", async () => {
    const read = async (path, coding) =>
      Buffer.from(
        await (
          await fetch(address + path, { headers: { accept: "text/html", "accept-encoding": coding } })
        ).arrayBuffer(),
      );
    const names = [...(await read("/", "identity")).toString().matchAll(/"[./]*(assets\/[^"]+)"/g)].map(
      match => `/${match[1]}`,
    );
    const program = names.find(name => name.endsWith(".js"));
    const folder = program.slice(0, program.lastIndexOf("/") + 1);
    for (const [, chunk] of (await read(program, "identity")).toString().matchAll(/["'`]\.\/([\w-]+\.js)["'`]/g))
      names.push(folder + chunk);
    assert.ok(names.some(name => name.includes("viewer")) && names.some(name => name.includes("docs")), names.join());
    for (const name of ["/", ...names]) {
      // fetch unpacks what it is sent.
      const plain = await read(name, "identity");
      assert.ok(plain.equals(await read(name, "gzip")), name);
    }
  });

  await check("the first view is small", async () => {
    const { page, faults, close } = await tab(browser, address);
    await page.waitForSelector(".welcome");
    const sizes = await page.evaluate(() =>
      performance
        .getEntriesByType("resource")
        .concat(performance.getEntriesByType("navigation"))
        .map(entry => [entry.name, entry.encodedBodySize]),
    );
    const whole = sizes.filter(([name]) => !name.includes("/v1/")).reduce((sum, [, size]) => sum + size, 0);
    const painted = await page.evaluate(
      () => performance.getEntriesByName("first-contentful-paint")[0]?.startTime ?? 0,
    );
    console.log(`  first view: ${whole} bytes, ${Math.round(painted)} ms to the first paint`);
    assert.ok(whole > 5_000 && whole < 400_000, `${whole} bytes`);
    assert.ok(!sizes.some(([name]) => name.includes("viewer")), "the viewer is loaded when it is needed");
    await look(page, "empty-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  for (const [width, dark] of [
    [1280, false],
    [1280, true],
    [400, false],
    [400, true],
  ]) {
    const name = `${width}-${dark ? "dark" : "light"}`;
    await check(`upload, model, view, fit, correct, compare, download at ${name}`, async () => {
      // The browser reports the answer to the parameter that is out of range.
      const { page, faults, close } = await tab(browser, address, { width, dark, expected: [/status of 422/] });
      // A newcomer: a click and a choice of files, two actions, lead to a fitted ventricle on the screen.
      const [chooser] = await Promise.all([
        page.waitForEvent("filechooser"),
        page.getByRole("button", { name: "Choose files" }).click(),
      ]);
      await chooser.setFiles(SCAN);
      await drawn(page);
      await page.waitForSelector(".wall canvas");
      await look(page, `fit-${name}`);
      assert.match(await page.textContent(".figures"), /Cavity90 %: \d+ to \d+.ml/);

      // Every figure that the wall can be coloured by.
      const colours = page.getByLabel("Colour of the wall");
      for (const figure of await colours.locator("option").allTextContents()) await colours.selectOption(figure);
      if (name === "1280-light") await look(page, "shape-1280-light");
      assert.ok(
        (await colours.locator("option").allTextContents()).some(figure => figure.startsWith("Uncertainty")),
        "uncertainty",
      );
      await colours.selectOption("Uptake");
      if (width === 1280) assert.equal(await printed(page, `fit-${name}`), 2, "pages on paper");

      // Through the slices by keys; the polar map follows.
      const slice = page.locator(".slice canvas").first();
      await slice.focus();
      const before = await slice.getAttribute("aria-valuenow");
      for (let n = 0; n < 4; n++) await page.keyboard.press("PageUp");
      await page.waitForFunction(
        ([old]) => document.querySelector(".slice canvas").getAttribute("aria-valuenow") !== old,
        [before],
      );
      await page.getByRole("button", { name: "Patient" }).click();
      await look(page, `patient-${name}`);
      await page.getByRole("button", { name: "Heart" }).click();

      // A click on the polar map takes the cursor to the wall.
      const map = page.locator(".polar canvas").first();
      const box = await map.boundingBox();
      await map.click({ position: { x: box.width * 0.5, y: box.height * 0.2 } });
      await page.waitForFunction(() => /anterior/.test(document.querySelector(".polar .at").textContent));

      // A model of the same scan, and a parameter that is out of range.
      await page.getByRole("button", { name: "New fit or model" }).click();
      await page.getByRole("button", { name: "Surface model" }).click();
      await page.waitForSelector("#parameter-points");
      await page.fill("#parameter-points", "5");
      await page.getByRole("button", { name: "Make the model" }).click();
      await page.waitForSelector("#parameter-points-error");
      await page.locator(".parameters > details > summary").click();
      await look(page, `parameters-${name}`);
      await page.fill("#parameter-points", width === 400 ? "90" : "110");
      // A preset is kept in the browser.
      await page.getByLabel("Keep as").fill("mine");
      await page.getByRole("button", { name: "Keep", exact: true }).click();
      await page.getByRole("button", { name: "All defaults" }).click();
      assert.equal(await page.inputValue("#parameter-points"), "");
      await page.getByLabel("Preset").selectOption("mine");
      assert.equal(await page.inputValue("#parameter-points"), width === 400 ? "90" : "110");
      await page.getByRole("button", { name: "Make the model" }).click();
      await page.waitForFunction(() => /Hausdorff/.test(document.querySelector(".figures")?.textContent ?? ""));
      await look(page, `model-${name}`);

      // Back to the fit; put the heart elsewhere by a drag, and fit from there.
      await page.locator(".choices .pick", { hasText: "Fit" }).first().click();
      await drawn(page);
      await page.getByRole("button", { name: "Correct by hand" }).click();
      await page.waitForSelector(".correction");
      const long = page.locator(".slice canvas").nth(1);
      await long.scrollIntoViewIfNeeded();
      const place = await long.boundingBox();
      const scale = Math.min(place.width, place.height) / 140;
      await page.waitForTimeout(300);
      const centre = await page.evaluate(() => document.querySelector(".correction input").value);
      const top = [place.x + place.width / 2, place.y + place.height / 2 - 33 * scale];
      await page.mouse.move(...top);
      await page.mouse.down();
      await page.mouse.move(top[0] + 8, top[1] + 2, { steps: 4 });
      await page.mouse.up();
      await page.waitForFunction(old => document.querySelector(".correction input").value !== old, centre);
      const base = page.locator(".correction label", { hasText: "Base" }).locator("input");
      await base.fill(String(Number(await base.inputValue()) + 8));
      await page
        .locator(".correction label", { hasText: "Turn" })
        .locator("input")
        .fill(width === 400 ? "10" : "5");
      await look(page, `correct-${name}`);
      await page.getByRole("button", { name: "Fit from here" }).click();
      // The new fit is shown beside the one it came from.
      await page.waitForSelector(".choices .other");
      assert.match(await page.textContent(".choices .current"), /by hand: .*centre.*base.*; from the fit of/);
      await page.waitForFunction(() => document.querySelectorAll(".figures thead th").length >= 2);
      await page.waitForFunction(() => document.querySelectorAll(".polar").length === 2);
      await page.locator(".layers label", { hasText: "difference" }).locator("input").check();
      await look(page, `compare-${name}`);

      const [zip] = await Promise.all([
        page.waitForEvent("download"),
        page.getByRole("button", { name: "Everything as zip" }).click(),
      ]);
      const bytes = readFileSync(await zip.path());
      writeFileSync(join(SCREENSHOTS, `result-${name}.zip`), bytes);
      assert.match(namesIn(join(SCREENSHOTS, `result-${name}.zip`)), /mesh\.glb[^]*report\.html/);
      if (width === 1280) assert.equal(await printed(page, `compare-${name}`), 2, "pages on paper");
      // Otherwise its download may be taken for the next one.
      const [picture] = await Promise.all([
        page.waitForEvent("download"),
        page.getByRole("button", { name: "Screenshot" }).click(),
      ]);
      assert.equal(readFileSync(await picture.path()).toString("latin1", 1, 4), "PNG");
      await page.goto(`${address}/#/`);
      await page.waitForSelector(".scan");
      await look(page, `list-${name}`);
      if (name === "1280-light") {
        const [whole] = await Promise.all([
          page.waitForEvent("download"),
          page.getByRole("button", { name: "Download all of" }).first().click(),
        ]);
        assert.match(namesIn(await whole.path()), /scan\/[^]*mesh\.vtp[^]*report\.html/);
      }
      assert.deepEqual(faults, []);
      await close();
    });
  }

  await check("a reader's view: words, one scale, report at hand, long identifiers", async () => {
    const own = await service();
    const file = join(SCREENSHOTS, "long.dcm");
    const id = "1.2.840.113619.2.55.3.604688119.868.1459412345.123456";
    writeFileSync(file, nm(readFileSync(SCAN), "Reader^Rita", id));
    // Keeps what is written on a polar map, and where its cursor is.
    const script = () => {
      const { fillText, arc, clearRect } = CanvasRenderingContext2D.prototype;
      Object.assign(CanvasRenderingContext2D.prototype, {
        clearRect(...all) {
          this.canvas.marks = { texts: [], ring: null };
          return clearRect.apply(this, all);
        },
        fillText(text, x, y, ...rest) {
          this.canvas.marks?.texts.push({
            text,
            x,
            y,
            width: this.measureText(text).width,
            height: parseFloat(/([\d.]+)px/.exec(this.font)[1]) * 0.7,
          });
          return fillText.call(this, text, x, y, ...rest);
        },
        arc(x, y, radius, ...rest) {
          if (radius === 6 && this.canvas.marks) this.canvas.marks.ring = { x, y };
          return arc.call(this, x, y, radius, ...rest);
        },
      });
    };
    for (const [width, dark] of [
      [1440, false],
      [1440, true],
      [400, false],
      [400, true],
    ]) {
      const name = `${width}-${dark ? "dark" : "light"}`;
      const { page, faults, close } = await tab(browser, own.address, { width, height: 900, dark, script });
      await page.waitForSelector(".drop");
      if (width === 1440 && !dark) await choose(page, file);
      else await page.locator(".scan .result").first().click();
      await drawn(page);
      await page.waitForSelector(".wall canvas");
      // Identifiers are said to be such, and whole on the view of the scan.
      const head = await page.textContent(".side header");
      assert.ok(head.includes(`patient ID ${id}`) && head.includes("accession ACC7"), head);
      assert.ok(
        await page.evaluate(() =>
          [...document.querySelectorAll(".comparison .facts")].every(part => part.scrollWidth <= part.clientWidth),
        ),
        "nothing sticks out",
      );
      if (width === 1440) {
        for (const label of ["Report", "Print"]) {
          const box = await page.locator(".facts .takeaways").getByText(label, { exact: true }).boundingBox();
          assert.ok(box.y > 0 && box.y + box.height < 900, `${label} above the fold`);
        }
      }
      assert.match(await page.textContent(".verdict > p"), /^(Very likely|Probably|Perhaps) a (good|poor) fit/);
      assert.equal(await page.locator(".verdict details[open]").count(), 0, "figures are folded");
      assert.equal(await page.locator(".facts meter:visible").count(), 0);
      await page.locator(".verdict summary").click();
      assert.match(await page.textContent(".verdict details"), /in 100 agree with a reader/);
      await look(page, `reader-${name}`);
      assert.equal(await page.getByLabel("Colours of polar map and wall").inputValue(), "Inferno");
      for (const slice of await page.locator(".slice canvas").all())
        assert.match(await slice.getAttribute("aria-valuetext"), /value (none|-?\d+|-?0?\.\d{1,3}|-?\d\.\d)$/);
      // Wherever the cursor is, it covers no number, and nothing is above all.
      const map = page.locator(".polar canvas").first();
      await map.scrollIntoViewIfNeeded();
      const marks = () => map.evaluate(canvas => canvas.marks);
      const places = (await marks()).texts.filter(one => /^\d+$/.test(one.text));
      assert.equal(places.length, 17);
      for (const place of places) {
        await map.click({ position: { x: place.x, y: place.y } });
        await page.waitForTimeout(80);
        const { texts, ring } = await marks();
        assert.ok(ring && Math.hypot(ring.x - place.x, ring.y - place.y) < 25, "the cursor is where the press was");
        for (const one of texts)
          assert.ok(
            Math.abs(one.x - ring.x) > 6 + one.width / 2 || Math.abs(one.y - ring.y) > 6 + one.height / 2,
            `${one.text} lies under the cursor`,
          );
        const [segment, here = 0] = [...(await page.textContent(".polar .at")).matchAll(/(\d+)\u2009%/g)].map(match =>
          Number(match[1]),
        );
        assert.ok(segment <= 100 && here <= 100, `${segment} %, here ${here} %`);
      }
      await look(page, `reader-cursor-${name}`);
      await page.goto(`${own.address}/#/`);
      const line = page.locator(".study-head h2");
      assert.match(await line.textContent(), /patient ID 1\.2\.840\.113619\.2[.\d]*…/);
      assert.ok((await line.getAttribute("title")).includes(id));
      await look(page, `reader-list-${name}`);
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("where no heart is found, the picture asks for it", async () => {
    const own = await service();
    const path = join(SCREENSHOTS, "heartless.nii");
    writeFileSync(path, heartless());
    for (const [width, dark] of [
      [1280, false],
      [390, true],
    ]) {
      const { page, faults, close } = await tab(browser, own.address, { width, dark });
      if (width === 1280) {
        await page.waitForSelector(".welcome");
        await choose(page, path);
      }
      const failed = page.locator(".job.failed").first();
      await failed.waitFor();
      const said = await failed.textContent();
      assert.match(said, /No heart found.*put its centre and apex in the picture/);
      assert.doesNotMatch(said, /LPS|millimetres/);
      await failed.getByRole("button", { name: "Put centre and apex" }).click();
      await page.waitForSelector(".correction");
      await page.waitForSelector(".slice canvas");
      await page.getByText("to the middle of the cavity").waitFor();
      await look(page, `no-heart-${width}`);
      if (width === 1280) {
        // A press leads there, the centre follows; the handles stand in the slices.
        const slice = page.locator(".slice canvas").first();
        const { width: across, height: down } = await slice.boundingBox();
        await slice.click({ position: { x: 0.6 * across, y: 0.4 * down } });
        await page.getByRole("button", { name: "Centre at the cursor" }).click();
        const wanted = page.waitForRequest(
          request => request.url().endsWith("/v1/jobs") && request.method() === "POST",
        );
        await page.getByRole("button", { name: "Fit from here" }).click();
        const order = (await wanted).postDataJSON();
        assert.equal(order.kind, "segmentation");
        assert.equal(order.parameters.center.length, 3);
      }
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("a turn renames segments and nothing else; a correction keeps its heart", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address, { width: 1440, height: 900 });
    await page.waitForSelector(".welcome");
    await choose(page, SCAN);
    await drawn(page);
    const all = async kind => (await (await fetch(`${own.address}/v1/${kind}`)).json())[kind];
    const read = async (result, name) =>
      (await fetch(own.address + result.files.find(one => one.name === name).href)).json();
    const [first] = await all("segmentations");
    const correct = async (field, change) => {
      const before = (await all("segmentations")).length;
      if (!(await page.locator(".correction").count()))
        await page.getByRole("button", { name: "Correct by hand" }).click();
      const input = page.locator(".correction label", { hasText: field }).locator("input");
      await input.fill(String(Number(await input.inputValue()) + change));
      await input.press("Tab");
      await page.getByRole("button", { name: "Fit from here" }).click();
      await page.waitForFunction(count => document.querySelectorAll(".choices li").length === count, before + 1);
      await page.waitForFunction(() =>
        /Nothing changed/.test(document.querySelector(".correction [role=status]").textContent),
      );
      return (await all("segmentations"))[0];
    };
    const turned = await correct("Turn", 60);
    assert.deepEqual(
      (await read(turned, "mesh.json")).vertices,
      (await read(first, "mesh.json")).vertices,
      "the same wall",
    );
    const [old, now] = [await read(first, "report.json"), await read(turned, "report.json")];
    assert.equal(now.template, old.template);
    assert.equal(turned.parameters.kept_model, old.template);
    assert.deepEqual(now.volumes_ml, old.volumes_ml);
    assert.deepEqual(now.fit.confidence, old.fit.confidence);
    assert.match(await page.textContent(".choices .current"), /by hand: turn/);
    // What was the anterior wall is now called by its neighbour's name: six basal segments are 60 degrees each.
    const means = async result => (await read(result, "polar.json")).segments.slice(0, 6).map(one => one.mean_percent);
    const [was, is] = [await means(first), await means(turned)];
    const apart = by => Math.max(...was.map((mean, n) => Math.abs(mean - is[(n + by) % 6])));
    assert.ok(Math.min(apart(1), apart(5)) < 1.5, `${was} and ${is}`);
    // Another base, too, keeps heart and names.
    const based = await correct("Base", 4);
    assert.equal((await read(based, "report.json")).template, old.template);
    assert.deepEqual(based.parameters.segments_from, turned.parameters.segments_from);
    await look(page, "turned-1440-light");
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  const tools = { PROGRAM, SCREENSHOTS, browser, service, tab, check, look, printed, choose };
  await examples(tools);
  await pulls(tools);
  await comparisons(tools);
  await studies(tools);
  await serials(tools);
  await readings(tools);

  await check("the documentation of the API", async () => {
    for (const [width, dark] of [
      [1280, false],
      [400, true],
    ]) {
      const { page, faults, close } = await tab(browser, `${address}/docs`, { width, dark });
      await page.waitForSelector(".operation");
      await page.fill("input[type=search]", "volumes");
      await page.locator(".operation summary").first().click();
      await page.locator(".operation", { hasText: "Upload a volume" }).locator("summary").first().click();
      await page.getByRole("button", { name: "Send" }).first().click();
      await page.waitForFunction(() =>
        /next_cursor|"volumes"/.test(document.querySelector("pre[aria-label=Answer]")?.textContent ?? ""),
      );
      await look(page, `docs-${width}`);
      await page.fill("input[type=search]", "distance.json");
      await page
        .locator(".operation", { hasText: "Download one of a model's files" })
        .locator("summary")
        .first()
        .click();
      await page.getByRole("rowheader", { name: "distance.json" }).waitFor();
      assert.deepEqual(faults, []);
      await close();
    }
  });

  await check("what is rarely seen or folded has no fault either", async () => {
    const own = await service();
    for (const [width, dark] of [
      [1280, false],
      [390, true],
    ]) {
      const { page, faults, close } = await tab(browser, own.address, { width, dark, expected: [/status of 404/] });
      await page.waitForSelector(".drop");
      await page.getByLabel("then").selectOption("nothing");
      await choose(page, SCAN, TRUTH);
      await page.waitForFunction(() => document.querySelectorAll(".uploads .stored").length === 2);
      const unfold = async name => {
        await page.evaluate(() => document.querySelectorAll("details").forEach(one => (one.open = true)));
        await look(page, `${name}-${width}`);
      };
      await page.goto(`${own.address}/#/glossary`);
      await page.waitForSelector(".glossary dt");
      await unfold("glossary");
      await page.goto(`${own.address}/#/evaluation`);
      await page.waitForSelector(".evaluation h1");
      await unfold("evaluation-empty");
      await page.goto(`${own.address}/#/scan/vol_${"0".repeat(32)}`);
      await page.waitForSelector("main [role=alert]");
      await unfold("no-scan");
      await page.goto(`${own.address}/#/comparison/cmp_${"0".repeat(32)}`);
      await page.waitForSelector("main [role=alert]");
      await unfold("no-comparison");
      const { volumes } = await (await fetch(`${own.address}/v1/volumes`)).json();
      await page.goto(`${own.address}/#/scan/${volumes.find(volume => !volume.label_values).id}`);
      await page.waitForSelector(".slice canvas");
      await look(page, `no-result-${width}`);
      await page.getByRole("button", { name: "New fit or model" }).click();
      for (const kind of ["Fit the ventricle", "Surface model"]) {
        await page.getByRole("button", { name: kind }).click();
        await page.waitForSelector(kind === "Surface model" ? "#parameter-points" : "#parameter-model");
        await unfold(`all-parameters-${kind}`);
      }
      await page.getByRole("button", { name: "Fit the ventricle" }).click();
      await page.getByRole("button", { name: "Fit", exact: true }).click();
      await drawn(page);
      await page.getByRole("button", { name: "New fit or model" }).click();
      await unfold("fit-open");
      await page.goto(`${own.address}/docs`);
      await page.waitForSelector(".operation");
      await page.fill("input[type=search]", "list volumes");
      await page.waitForFunction(() => document.querySelectorAll(".operation").length < 8);
      await unfold("docs-open");
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("names of files are shown by the tab that sent them, and stored if a person asks for it", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    const stored = async () =>
      (await (await fetch(`${own.address}/v1/volumes`)).json()).volumes.map(volume => volume.labels.name);
    const shown = () => page.locator(".scan .name").allTextContents();
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("fit");
    await choose(page, SCAN);
    await page.waitForFunction(() => /seg_/.test(location.hash));
    await page.goto(`${own.address}/#/`);
    await page.waitForSelector(".scan .result");
    assert.match((await shown()).join(), /spect/);
    const [job] = (await (await fetch(`${own.address}/v1/jobs`)).json()).jobs;
    assert.doesNotMatch(JSON.stringify(job.labels), /spect/);
    await page.reload();
    await page.waitForSelector(".scan .name");
    assert.match((await shown()).join(), /^Scan /);
    await page.getByLabel("keep file names").check();
    await choose(page, TRUTH);
    await page.waitForFunction(() => document.querySelectorAll(".scan").length === 2);
    assert.deepEqual((await stored()).map(name => name ?? "none").sort(), ["lv_truth.nii.gz", "none"]);
    await page.reload();
    await page.waitForFunction(() => /lv_truth/.test(document.querySelector("main")?.textContent ?? ""));
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  await check("an expert's mask is measured against, and the list is searched", async () => {
    const { page, faults, close } = await tab(browser, address);
    await filled(page, address);
    await choose(page, TRUTH);
    await page.waitForFunction(() => document.querySelectorAll(".uploads .stored").length === 2);
    await page.fill("input[type=search]", "spect");
    await page.waitForFunction(() => document.querySelectorAll(".scan").length === 1);
    await page.locator(".scan .name").click();
    await drawn(page);
    await page.getByRole("button", { name: "New fit or model" }).click();
    await page.waitForSelector("#parameter-expert");
    await page.selectOption("#parameter-expert", { index: 1 });
    await page.getByRole("button", { name: "Fit", exact: true }).click();
    await page.waitForFunction(() => /Jaccard/.test(document.querySelector(".figures")?.textContent ?? ""));
    await look(page, "expert-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("two models are compared, figures and walls side by side", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("nothing");
    await choose(page, SCAN);
    await page.waitForSelector(".uploads .stored");
    const volume = (await (await fetch(`${own.address}/v1/volumes`)).json()).volumes[0].id;
    const made = [];
    for (const points of [70, 140]) {
      let job = await (
        await fetch(`${own.address}/v1/jobs`, {
          method: "POST",
          headers: { "content-type": "application/json" },
          body: JSON.stringify({ kind: "model", volume, parameters: { points } }),
        })
      ).json();
      while (["queued", "running"].includes(job.state)) {
        await page.waitForTimeout(100);
        job = await (await fetch(`${own.address}/v1/jobs/${job.id}`)).json();
      }
      made.push(job.model);
    }
    await page.goto(`${own.address}/#/scan/${volume}/${made[0]}/${made[1]}`);
    await page.waitForFunction(() => /compared/.test(document.querySelector(".figures thead")?.textContent ?? ""));
    assert.match(await page.textContent(".figures tbody"), /Points70\s*140/);
    await page.getByLabel("walls side by side").check();
    await page.waitForFunction(() => document.querySelectorAll(".pair .wall canvas[role=slider]").length === 2);
    await page.waitForTimeout(500);
    const walls = page.locator(".pair .wall canvas[role=slider]");
    const seen = n => walls.nth(n).getAttribute("aria-valuetext");
    const before = await seen(0);
    await walls.nth(0).focus();
    for (let n = 0; n < 12; n++) await page.keyboard.press("ArrowLeft");
    await page.waitForFunction(
      old => document.querySelector(".pair .wall canvas").getAttribute("aria-valuetext") !== old,
      before,
    );
    await page.waitForTimeout(300);
    assert.equal(await seen(1), await seen(0), "both are seen from the same side");
    await look(page, "two-models-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("two fits of a scan are told apart in lists and menus", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("nothing");
    await choose(page, SCAN);
    await page.waitForSelector(".uploads .stored");
    const ask = async (path, order) => {
      const body = order && {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify(order),
      };
      return (await fetch(own.address + path, body)).json();
    };
    const volume = (await ask("/v1/volumes")).volumes[0].id;
    const make = async (kind, parameters) => {
      let job = await ask("/v1/jobs", { kind, volume, parameters });
      while (!/succeeded|failed|cancelled/.test(job.state)) job = await ask(job.links.self);
      assert.equal(job.state, "succeeded", JSON.stringify(job.error));
      return job;
    };
    const { model } = await make("model", { points: 120 });
    for (const parameters of [{}, { margin: 1 }, { model }, { margin: 3, roll: 5 }])
      await make("segmentation", parameters);
    await page.reload();
    const apart = async (where, count) => {
      await page.waitForFunction(([where, count]) => document.querySelectorAll(where).length === count, [where, count]);
      const names = await page.locator(where).allTextContents();
      assert.equal(new Set(names).size, count, names.join("; "));
      return names;
    };
    const names = await apart(".scan .result b", 4);
    assert.equal(names.filter(name => /^Fit of .*\d:\d\d/.test(name)).length, 2, names.join("; "));
    assert.ok(names.includes("Fit of a model of 120 points") && names.includes("Corrected fit"), names.join("; "));
    await look(page, "fits-1280");
    await page.goto(`${own.address}/#/scan/${volume}`);
    await drawn(page);
    await apart(".choices .pick", 5);
    const labels = await page
      .locator(".choices button[aria-label^=Compare]")
      .evaluateAll(all => all.map(one => one.getAttribute("aria-label")));
    assert.equal(new Set(labels).size, 4, labels.join("; "));
    await page.getByRole("button", { name: "New fit or model" }).click();
    await page.waitForSelector("#parameter-model");
    await apart("#parameter-model optgroup[label='Fits of this scan'] option", 4);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  await check("a DICOM NM file is read, named and fitted", async () => {
    const file = join(SCREENSHOTS, "spect.dcm");
    writeFileSync(file, nm(readFileSync(SCAN), "Phantom^Fritz"));
    const { page, faults, close } = await tab(browser, address);
    await page.waitForSelector(".drop");
    await choose(page, file);
    await drawn(page);
    await page.waitForSelector(".wall canvas");
    await look(page, "dicom-1280");
    const [zip] = await Promise.all([
      page.waitForEvent("download"),
      page.getByRole("button", { name: "Everything as zip" }).click(),
    ]);
    const packed = namesIn(await zip.path());
    assert.match(packed, /\.dcm/);
    assert.doesNotMatch(packed, /left_out/);
    await page.goto(`${address}/#/`);
    await page.waitForFunction(() => /Phantom Fritz/.test(document.querySelector(".scans")?.textContent ?? ""));
    assert.deepEqual(faults, []);
    await close();
  });

  await check("a gated scan becomes a beat: played, stepped, corrected, printed", async () => {
    const folder = join(SCREENSHOTS, "gated");
    assert.equal(spawnSync(PROGRAM, ["phantom", "-o", folder, "--size", "64", "--spacing", "6.4"]).status, 0);
    const [scan, truth] = ["spect", "lv_truth"].map(name => readFileSync(join(folder, `${name}.nii.gz`)));
    const [nifti, dicom, dynamic] = ["gated.nii.gz", "gated.dcm", "dynamic.nii.gz"].map(name => join(folder, name));
    writeFileSync(nifti, gated(scan, truth, 8));
    writeFileSync(dicom, gatedNm(scan, truth, 16, "Beat^Berta"));
    writeFileSync(dynamic, gated(scan, truth, 8, 480_000));
    const played = page =>
      page.waitForFunction(() => document.querySelector(".player") && !document.querySelector(".player [role=status]"));
    const gate = page => page.getByLabel("Gate", { exact: true }).inputValue().then(Number);
    const moment = page => page.locator(".beat-chart .now line").getAttribute("x1");
    const moves = (page, from) =>
      page.waitForFunction(old => document.querySelector(".beat-chart .now line").getAttribute("x1") !== old, from);
    for (const [width, dark, file, gates] of [
      [1280, false, nifti, 8],
      [1280, true, dicom, 16],
      [400, false, dicom, 16],
      [400, true, nifti, 8],
    ]) {
      const name = `${width}-${dark ? "dark" : "light"}`;
      const motion = width === 1280;
      const own = await service();
      const { page, faults, close } = await tab(browser, own.address, { width, dark, motion });
      await page.waitForSelector(".welcome");
      await choose(page, file);
      await played(page);
      const button = page.locator(".player button.main");
      // It plays unless less motion is asked for.
      assert.equal(await button.textContent(), motion ? "Pause" : "Play");
      if (motion) {
        await moves(page, await moment(page));
        await page.keyboard.press(" ");
      }
      assert.equal(await button.textContent(), "Play");
      await page.waitForTimeout(200);
      const [still, first] = [await moment(page), await gate(page)];
      await page.waitForTimeout(400);
      assert.equal(await moment(page), still, "it stands still");
      await page.keyboard.press("ArrowRight");
      await moves(page, still);
      assert.equal(await gate(page), (first % gates) + 1);
      await page.keyboard.press("ArrowLeft");
      await page.keyboard.press("ArrowLeft");
      assert.equal(await gate(page), ((first + gates - 2) % gates) + 1);
      await page.keyboard.press(" ");
      await page.waitForFunction(() => document.querySelector(".player button.main").textContent === "Pause");
      await moves(page, await moment(page));
      await page.getByLabel("Speed").selectOption("0.25");
      await button.click();
      // At end systole the slices show another gate than at end diastole.
      const picture = () =>
        page
          .locator(".slice canvas")
          .first()
          .evaluate(canvas => canvas.toDataURL());
      const at = wanted => page.getByLabel("Gate", { exact: true }).fill(String(wanted));
      const report = await page.evaluate(async () => {
        const { beats } = await (await fetch("/v1/beats")).json();
        return (await fetch(beats[0].links.report)).json();
      });
      await at(report.end_diastole_gate);
      await page.waitForTimeout(300);
      assert.match(await page.textContent(".player .gate"), /end diastole/);
      const wide = await picture();
      await at(report.end_systole_gate);
      await page.waitForTimeout(300);
      assert.match(await page.textContent(".player .gate"), /end systole/);
      assert.notEqual(await picture(), wide);

      const figures = await page.textContent(".figures");
      const interval = report.ef_interval_percent.map(end => end.toFixed(0)).join(" to ");
      assert.match(figures, new RegExp(`Ejection fraction90 %: ${interval}${report.ef_percent.toFixed(0)}`));
      assert.match(figures, /End-diastolic volume90 %[^]*End-systolic volume90 %[^]*Stroke volume[^]*Bandwidth/);
      if (gates === 16) assert.match(figures, /Peak filling rate[\d.]+/);
      assert.equal(await page.locator(".maps canvas[role=img]").count(), 5);
      const colours = page.getByLabel("Colour of the wall");
      for (const figure of await colours.locator("option").allTextContents()) await colours.selectOption(figure);
      assert.ok((await colours.locator("option").allTextContents()).includes("Motion inward"));
      await colours.selectOption("Uptake");
      const map = page.locator(".maps canvas[role=img]").last();
      await map.scrollIntoViewIfNeeded();
      const box = await map.boundingBox();
      await map.click({ position: { x: box.width * 0.5, y: box.height * 0.2 } });
      await page.waitForFunction(() =>
        /anterior/.test(document.querySelector(".maps figure:last-child figcaption").textContent),
      );
      await page.locator(".beat-maps details summary").click();
      assert.equal(await page.locator(".beat-maps tbody tr").count(), 17);
      await look(page, `beat-${name}`);
      if (width === 1280) assert.equal(await printed(page, `beat-${name}`), 1, "pages on paper");

      // Another rim: all gates are fitted again.
      await page.getByRole("button", { name: "Correct by hand" }).click();
      const base = page.locator(".correction label", { hasText: "Base" }).locator("input");
      await base.fill(String(Number(await base.inputValue()) + 6));
      await look(page, `beat-correct-${name}`);
      await page.getByRole("button", { name: "Fit from here" }).click();
      await page.waitForSelector(".choices .other");
      assert.match(
        await page.textContent(".choices .current"),
        /Corrected beat of \d+ gates[^]*by hand: base; from the fit of/,
      );
      const again = await page.evaluate(
        async () => (await (await fetch("/v1/beats")).json()).beats[0].parameters.kept_model,
      );
      assert.equal(again, report.template, "the beat keeps its heart");
      await page.waitForFunction(() => document.querySelectorAll(".figures thead th").length >= 2);
      await played(page);
      await look(page, `beat-compare-${name}`);
      if (width === 1280) {
        assert.equal(await printed(page, `beat-compare-${name}`), 1, "pages on paper");
        const [zip] = await Promise.all([
          page.waitForEvent("download"),
          page.getByRole("button", { name: "Everything as zip" }).click(),
        ]);
        assert.match(namesIn(await zip.path()), /beat\.json[^]*mesh\.glb/);
      }
      await page.goto(`${own.address}/#/`);
      await page.waitForFunction(() => document.querySelectorAll(".scan .result").length === 2);
      assert.match(await page.textContent(".scan .result"), /EF \d+.%/);
      await look(page, `beat-list-${name}`);
      assert.deepEqual(faults, []);
      await close();
      await own.stop();
    }
    // Files of one gate each are one scan, whatever their order; others beside them stay their own.
    const whole = gunzipSync(readFileSync(nifti));
    const apart = Array.from({ length: 8 }, (_, n) => {
      const [header, bytes] = [Buffer.from(whole.subarray(0, 352)), (whole.length - 352) / 8];
      header.writeInt16LE(3, 40);
      header.writeInt16LE(1, 48);
      const file = join(folder, `gate${n + 4}.nii`);
      writeFileSync(file, Buffer.concat([header, whole.subarray(352 + n * bytes, 352 + (n + 1) * bytes)]));
      return file;
    });
    const several = await service();
    const dropped = await tab(browser, several.address);
    await dropped.page.waitForSelector(".welcome");
    await choose(dropped.page, SCAN, ...apart.reverse());
    await dropped.page.waitForFunction(() => document.querySelectorAll(".scan").length === 2);
    const { volumes } = await (await fetch(`${several.address}/v1/volumes`)).json();
    assert.deepEqual(volumes.map(volume => [volume.files, volume.gates?.number ?? null]).sort(), [
      [1, null],
      [8, 8],
    ]);
    await dropped.close();
    await several.stop();
    // Frames that last minutes are no gates: said in words, and the first of them is shown.
    const { page, close } = await tab(browser, address, { expected: [/status of 4\d\d/] });
    await page.waitForSelector(".drop");
    await choose(page, dynamic);
    await page.waitForFunction(() =>
      /no gates of one heart beat/.test(document.querySelector(".job.failed")?.textContent ?? ""),
    );
    await page.waitForSelector(".slice canvas");
    assert.equal(await page.locator(".stage [role=alert]").count(), 0);
    await look(page, "dynamic-1280");
    await close();
  });

  await check("bad files are named with what is wrong, and nothing is lost", async () => {
    const { page, faults, close } = await tab(browser, address, { expected: [/status of 4\d\d/] });
    const text = join(SCREENSHOTS, "notes.txt");
    writeFileSync(text, "not a scan\n".repeat(50));
    await page.waitForSelector(".drop");
    await choose(page, text);
    await page.waitForSelector(".uploads .refused .error strong");
    await choose(page, SCAN);
    await page.waitForSelector(".uploads .stored");
    await look(page, "refused-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("of a folder with foreign files, one sentence tells, which shows them when asked", async () => {
    const own = await service();
    const folder = join(SCREENSHOTS, "foreign");
    mkdirSync(join(folder, "notes"), { recursive: true });
    cpSync(SCAN, join(folder, "spect.nii.gz"));
    cpSync(TRUTH, join(folder, "truth.nii.gz"));
    for (const name of ["report.txt", "notes/first.csv", "notes/second.csv"])
      writeFileSync(join(folder, name), `${name} is not a scan\n`.repeat(50));
    for (const [width, dark] of [
      [1280, false],
      [390, true],
    ]) {
      const { page, faults, close } = await tab(browser, own.address, { width, dark, expected: [/status of 422/] });
      await page.waitForSelector(".drop");
      await page.getByLabel("then").selectOption("nothing");
      await page.setInputFiles("input[aria-label='Folder of scans']", folder);
      const stored = width === 1280 ? "2 scans stored" : "2 scans were stored before";
      await page.getByText(`${stored}, 3 files are no scans:`, { exact: true }).waitFor();
      assert.equal(await page.locator(".uploads li").count(), 1);
      const show = page.getByRole("button", { name: "show the files that are no scans" });
      assert.equal(await page.getByText("first.csv").count(), 0);
      await look(page, `foreign-folded-${width}`);
      await show.press("Enter");
      for (const name of ["report.txt", "first.csv", "second.csv"])
        assert.match(
          await page.locator(".foreign div", { hasText: name }).textContent(),
          /not in a known volume format: it begins with/,
        );
      await look(page, `foreign-shown-${width}`);
      // The scans among them are offered for a comparison as without the foreign files; a mask is none.
      assert.equal(await page.locator(".pair-form").count(), 0);
      await page.getByRole("button", { name: "Take these files off this list" }).click();
      assert.equal(await page.locator(".uploads").count(), 0);
      assert.equal(await page.locator(".scan").count(), 2);
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("a file over the limit is not sent", async () => {
    const small = await service("--body-limit", "1MiB");
    const { page, faults, close } = await tab(browser, small.address);
    const sent = [];
    page.on("request", request => request.method() === "POST" && sent.push(request.url()));
    const huge = join(SCREENSHOTS, "huge.nii");
    writeFileSync(huge, "");
    truncateSync(huge, 2 ** 31 + 1);
    await page.waitForSelector(".welcome");
    await choose(page, huge);
    await page.waitForSelector(".uploads .refused");
    rmSync(huge);
    assert.match(await page.textContent(".uploads .refused"), /It was not sent: 2.15 GB are more than 1.0 MB/);
    assert.deepEqual(sent, []);
    await look(page, "too-large-1280");
    await choose(page, TRUTH);
    await page.waitForSelector(".uploads .stored");
    // The service says the same of a length that it is told.
    const answer = await new Promise((done, fail) => {
      const socket = net.connect(Number(new URL(small.address).port), "127.0.0.1");
      let text = "";
      socket.on("data", chunk => (text += chunk));
      socket.on("error", fail);
      socket.on("close", () => done(text));
      const { host } = new URL(small.address);
      socket.write(
        `POST /v1/volumes HTTP/1.1\r\nhost: ${host}\r\ncontent-length: 3000000000\r\nconnection: close\r\n\r\n`,
      );
    });
    assert.match(answer, /^HTTP\/1.1 413 [^]*The body is larger than 1 ?MiB, the limit of this service/);
    assert.deepEqual(faults, []);
    await close();
  });

  await check("a connection that is lost in the middle loses nothing", async () => {
    const line = await fragile(address, 900_000);
    const { page, close } = await tab(browser, line.address, { expected: [/.*/] });
    await page.waitForSelector(".drop");
    await choose(page, SCAN);
    await page.waitForSelector(".uploads .interrupted");
    await look(page, "lost-1280");
    line.mend();
    await page.getByRole("button", { name: "Send again" }).click();
    await drawn(page);
    await close();
  });

  await check("of many files that wait, the last are told of in one line", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    let go;
    const held = new Promise(done => (go = done));
    await page.route("**/v1/volumes*", async route => {
      if (route.request().method() === "POST") await held;
      await route.continue();
    });
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("nothing");
    const files = Array.from({ length: 10 }, (_, n) => ({ name: `s${n}.nii`, mimeType: "", buffer: small(n + 1) }));
    await choose(page, ...files);
    await page.getByText("4 more wait").waitFor();
    assert.equal(await page.locator(".uploads li").count(), 7);
    await look(page, "waiting-1280");
    await page.getByRole("button", { name: "Cancel these too" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".uploads .cancelled").length === 4);
    go();
    await page.waitForFunction(() => document.querySelectorAll(".uploads .stored").length === 6);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  await check("an upload is cancelled and sent again", async () => {
    const own = await service();
    const line = await fragile(own.address, 900_000, { holds: true });
    const { page, faults, close } = await tab(browser, line.address);
    await page.waitForSelector(".welcome");
    // More than what the system keeps of a connection that nobody reads.
    const large = join(SCREENSHOTS, "large.nii");
    writeFileSync(large, largeScan());
    await choose(page, large, TRUTH);
    await page.waitForFunction(() => document.querySelector(".uploads .sending progress")?.value > 0);
    await look(page, "sending-1280");
    // Whoever leaves the page is asked, and stays.
    await page.locator("body").click({ position: { x: 5, y: 5 } });
    const question = page.waitForEvent("dialog");
    await page.close({ runBeforeUnload: true });
    assert.equal((await question).type(), "beforeunload");
    await (await question).dismiss();
    // What waits is cancelled as what is sent.
    const stored = async () => (await (await fetch(`${own.address}/v1/volumes`)).json()).volumes.length;
    await page.locator(".uploads .waiting").getByRole("button", { name: "Cancel" }).click();
    await page.locator(".uploads .sending").getByRole("button", { name: "Cancel" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".uploads .cancelled").length === 2);
    assert.equal(await stored(), 0);
    line.mend();
    await page.locator(".uploads .cancelled", { hasText: "large" }).getByRole("button", { name: "Send again" }).click();
    await page.waitForSelector(".uploads .stored");
    assert.equal(await stored(), 1);
    await page.getByRole("button", { name: "Take lv_truth.nii.gz off this list" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".uploads .cancelled").length === 0);
    rmSync(large);
    // Nothing is under way any more: nobody is asked.
    let asked = 0;
    page.on("dialog", dialog => ++asked && dialog.accept());
    await page.reload();
    await page.waitForSelector(".scan");
    assert.equal(asked, 0);
    assert.deepEqual(faults, []);
    await close();
  });

  await check("the list has pages and is sorted", async () => {
    const own = await service();
    const count = 33;
    const form = n => {
      const sent = new FormData();
      sent.append("volume", new Blob([small(n)]), "small.nii");
      return sent;
    };
    // Names and sizes ascend, the time of arrival descends.
    for (let n = count; n > 0; n--) {
      const answer = await fetch(`${own.address}/v1/volumes?labels=name:scan%20${n}`, {
        method: "POST",
        body: form(n),
      });
      assert.equal(answer.status, 201, await answer.text());
    }
    const { page, faults, close } = await tab(browser, own.address);
    const shown = () => page.locator(".scan .name").allTextContents();
    const awaited = (first, length) =>
      page.waitForFunction(
        ([first, length]) => {
          const names = [...document.querySelectorAll(".scan .name")].map(name => name.textContent);
          return names[0] === first && names.length === length;
        },
        [first, length],
      );
    const scans = (...from) => from.map(n => `scan ${n}`);
    const ascending = Array.from({ length: count }, (_, n) => n + 1);
    await awaited("scan 1", 30);
    assert.deepEqual(await shown(), scans(...ascending.slice(0, 30)));
    const loadMore = page.getByRole("button", { name: "Load more" });
    await loadMore.click();
    await awaited("scan 1", 33);
    assert.deepEqual(await shown(), scans(...ascending));
    assert.equal(await loadMore.count(), 0);
    // The first of the new rows has the focus.
    await page.waitForFunction(() => document.activeElement?.textContent === "scan 31");
    await look(page, "pages-1280");
    await page.getByLabel("Sort").selectOption("largest");
    await awaited("scan 33", 30);
    assert.deepEqual(await shown(), scans(...ascending.toReversed().slice(0, 30)));
    // By name, numbers in the order of their values; a new order starts at its first page.
    await loadMore.click();
    await awaited("scan 33", 33);
    await page.getByLabel("Sort").selectOption("name");
    await awaited("scan 1", 30);
    assert.deepEqual(await shown(), scans(...ascending.slice(0, 30)));
    await page.fill("input[type=search]", "scan 32");
    await awaited("scan 32", 1);
    assert.deepEqual(faults, []);
    await close();
  });

  await check("a search finds what is on no page, with its filters, and says when nothing does", async () => {
    const own = await service();
    const store = async (n, name) => {
      const sent = new FormData();
      sent.append("volume", new Blob([small(n)]), "small.nii");
      const labels = new URLSearchParams({ labels: `name:${name}` });
      const answer = await fetch(`${own.address}/v1/volumes?${labels}`, { method: "POST", body: sent });
      const said = await answer.text();
      assert.equal(answer.status, 201, said);
      return JSON.parse(said).id;
    };
    const oldest = await store(1, "Found Alone");
    for (let n = 2; n <= 45; n++) await store(n, `other ${n}`);
    const stated = await fetch(`${own.address}/v1/volumes/${oldest}/identity`, {
      method: "PUT",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({
        patient_name: "Hidden^Hanna",
        patient_id: "H-1",
        study_date: "20260131",
        study_uid: "1.2.3.4",
      }),
    });
    assert.ok(stated.ok, await stated.text());
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForFunction(() => document.querySelectorAll(".scan").length === 30);
    assert.match(await page.textContent(".tools"), /30\+ scans/);
    const alone = async () => {
      await page.waitForFunction(() => document.querySelectorAll(".scan").length === 1);
      assert.deepEqual(await page.locator(".scan .name").allTextContents(), ["Found Alone"]);
    };
    const search = page.getByLabel("Search patient, name, id or label");
    for (const words of ["hanna hidden", "FOUND", "2026-01-31", oldest.slice(4, 24)]) {
      await search.fill(words);
      await alone();
      await search.fill("");
      await page.waitForFunction(() => document.querySelectorAll(".scan").length === 30);
    }
    await page.getByText("Filters").click();
    await page.getByLabel("Studies from").fill("2026-01-31");
    await alone();
    await look(page, "filters-1280");
    await page.setViewportSize({ width: 400, height: 850 });
    await look(page, "filters-400");
    await page.getByLabel("Made at").selectOption("rest");
    await page.waitForFunction(() => /Nothing matches/.test(document.body.textContent));
    await page.getByRole("button", { name: "No filter" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".scan").length === 30);
    await page.getByLabel("Show").selectOption("segmentation");
    await page.waitForFunction(() => /Nothing matches/.test(document.body.textContent));
    assert.deepEqual(faults, []);
    await close();
  });

  await check("two tabs agree on what is stored, and rows that arrive do not move the others", async () => {
    const own = await service();
    const store = async n => {
      const sent = new FormData();
      sent.append("volume", new Blob([small(n)]), "small.nii");
      const answer = await fetch(`${own.address}/v1/volumes?labels=name:scan%20${n}`, { method: "POST", body: sent });
      assert.equal(answer.status, 201, await answer.text());
    };
    await store(1);
    const one = await tab(browser, own.address);
    // A browser of another person, which nothing tells.
    const two = await tab(browser, own.address);
    // Another tab of the first browser.
    const three = await one.page.context().newPage();
    await three.goto(own.address);
    const names = page => page.locator(".scan .name").allTextContents();
    const until = (page, wanted) =>
      page.waitForFunction(
        wanted => [...document.querySelectorAll(".scan .name")].map(name => name.textContent).join() === wanted,
        wanted,
      );
    for (const page of [one.page, two.page, three]) await until(page, "scan 1");
    // Others send two scans: the list says so, and shows them when asked.
    await store(2);
    await store(3);
    for (const page of [one.page, two.page]) {
      await page.getByRole("button", { name: "Show 2 new scans" }).waitFor();
      assert.deepEqual(await names(page), ["scan 1"]);
    }
    await look(one.page, "arrived-1280");
    await one.page.getByRole("button", { name: "Show 2 new scans" }).click();
    await two.page.getByRole("button", { name: "Show 2 new scans" }).click();
    for (const page of [one.page, two.page]) await until(page, "scan 3,scan 2,scan 1");
    // What one erases, the others lose.
    await one.page.getByRole("button", { name: "Erase scan 2" }).click();
    await one.page.getByRole("button", { name: "Erase", exact: true }).click();
    for (const page of [one.page, two.page]) await until(page, "scan 3,scan 1");
    // A result that somebody else made is shown.
    const [volume] = (await (await fetch(`${own.address}/v1/volumes`)).json()).volumes;
    await fetch(`${own.address}/v1/jobs`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ kind: "model", volume: volume.id, parameters: { points: 50 } }),
    });
    for (const page of [one.page, two.page]) await page.waitForSelector(".scan .result, .scan .job");
    assert.deepEqual([...one.faults, ...two.faults], []);
    await three.close();
    await one.close();
    await two.close();
  });

  await check("a list that is slow to come keeps what happened meanwhile", async () => {
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    let go;
    const told = new Promise(resolve => (go = resolve));
    await page.route(
      /\/v1\/(volumes|segmentations)\?limit=(30|100)$/,
      async route => {
        const response = await route.fetch();
        await told;
        await route.fulfill({ response });
      },
      { times: 2 },
    );
    await page.reload();
    await page.waitForSelector(".drop");
    await choose(page, SCAN);
    await drawn(page);
    await page.goto(`${own.address}/#/`);
    await page.waitForFunction(() => /Reading the list/.test(document.body.textContent));
    go();
    await page.waitForSelector(".scan .result");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("files, folders and series are dropped", async () => {
    const own = await service();
    const folder = join(SCREENSHOTS, "dropped");
    mkdirSync(join(folder, "series"), { recursive: true });
    const scan = readFileSync(SCAN);
    const { header, image } = pair(scan);
    writeFileSync(join(folder, "pair.hdr"), header);
    writeFileSync(join(folder, "pair.img"), image);
    series(scan, "Series^Sara").forEach((slice, n) => writeFileSync(join(folder, "series", `slice${n}.dcm`), slice));
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    const session = await page.context().newCDPSession(page);
    const data = { items: [], files: [folder, TRUTH], dragOperationsMask: 1 };
    for (const type of ["dragEnter", "dragOver"])
      await session.send("Input.dispatchDragEvent", { type, x: 600, y: 400, data });
    await page.waitForSelector(".drop.over");
    await look(page, "drop-1280");
    await session.send("Input.dispatchDragEvent", { type: "drop", x: 600, y: 400, data });
    await page.waitForFunction(() => document.querySelectorAll(".uploads .stored").length === 3);
    assert.match(await page.textContent(".uploads"), /pair\.hdr.*2 files/);
    assert.match(await page.textContent(".uploads"), /128 files/);
    await page.waitForFunction(() => /Series Sara/.test(document.querySelector(".scans").textContent));
    await page.waitForFunction(() => document.querySelectorAll(".scan .result").length === 2);
    await look(page, "dropped-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("jobs are watched, cancelled and tried again; a scan is erased when asked twice", async () => {
    const one = await service("--workers", "1");
    const { page, faults, close } = await tab(browser, one.address);
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("nothing");
    await choose(page, SCAN);
    await page.waitForSelector(".uploads .stored");
    const volume = (await (await fetch(`${one.address}/v1/volumes`)).json()).volumes[0].id;
    const job = points =>
      fetch(`${one.address}/v1/jobs`, {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify({ kind: "model", volume, parameters: { points } }),
      });
    for (const points of [30000, 30001, 30002]) await job(points);
    await page.reload();
    await page.waitForSelector(".job.running progress");
    await page.waitForFunction(
      () => /1st in the queue/.test(document.body.textContent) && /2nd in the queue/.test(document.body.textContent),
    );
    await look(page, "queue-1280");
    await page.locator(".job.queued").first().getByRole("button", { name: "Cancel" }).click();
    await page.waitForSelector(".job.cancelled");
    await page.locator(".job.running").getByRole("button", { name: "Cancel" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".job.cancelled").length === 2);
    await page.locator(".job.queued, .job.running").getByRole("button", { name: "Cancel" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".job.cancelled").length === 3);
    await page.locator(".job.cancelled").first().getByRole("button", { name: "Change and retry" }).click();
    await page.waitForFunction(() => /^3000/.test(document.querySelector("#parameter-points")?.value ?? ""));
    await page.fill("#parameter-points", "60");
    await page.getByRole("button", { name: "Make the model" }).click();
    await page.waitForFunction(() => /Hausdorff/.test(document.querySelector(".figures")?.textContent ?? ""));
    await page.goto(`${one.address}/#/`);
    await page.getByLabel("Show").selectOption("segmentation");
    await page.waitForFunction(() => document.querySelectorAll(".scan").length === 0);
    await page.getByLabel("Show").selectOption("all");
    await page
      .getByRole("button", { name: /^Erase/ })
      .first()
      .click();
    await page.getByRole("button", { name: "Keep" }).click();
    await page
      .getByRole("button", { name: /^Erase/ })
      .first()
      .click();
    await page.locator(".ask .danger").click();
    await page.waitForSelector(".welcome");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("slices and wall are moved by touch", async () => {
    const { page, faults, close } = await tab(browser, address, { width: 400 });
    await filled(page, address);
    await page.locator(".scan .result", { hasText: "Fit" }).first().click();
    await drawn(page);
    await page.waitForTimeout(500);
    const session = await page.context().newCDPSession(page);
    const touch = (type, ...points) =>
      session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    const slices = page.locator(".slice canvas");
    const picture = n => slices.nth(n).evaluate(canvas => canvas.toDataURL());
    const place = await slices.nth(0).boundingBox();
    const [x, y] = [place.x + place.width / 2, place.y + place.height / 2];
    // One finger takes the cursor along, so the other planes move.
    const before = await slices.nth(2).getAttribute("aria-valuenow");
    await touch("touchStart", [x, y]);
    await touch("touchMove", [x + 25, y]);
    await touch("touchEnd");
    await page.waitForFunction(
      old => document.querySelectorAll(".slice canvas")[2].getAttribute("aria-valuenow") !== old,
      before,
    );
    // Two fingers zoom every slice.
    const old = await picture(1);
    await touch("touchStart", [x - 20, y], [x + 20, y]);
    for (const d of [30, 40, 50]) await touch("touchMove", [x - d, y], [x + d, y]);
    await touch("touchEnd");
    await page.waitForTimeout(300);
    assert.notEqual(await picture(1), old);
    // A finger turns the wall.
    const wall = page.locator(".wall canvas").first();
    const seen = await wall.getAttribute("aria-valuetext");
    const box = await wall.boundingBox();
    await touch("touchStart", [box.x + 60, box.y + 60]);
    for (const d of [40, 80, 110]) await touch("touchMove", [box.x + 60 + d, box.y + 60]);
    await touch("touchEnd");
    await page.waitForFunction(
      was => document.querySelector(".wall canvas").getAttribute("aria-valuetext") !== was,
      seen,
    );
    await look(page, "touched-400");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("an evaluation is browsed without sending anything", async () => {
    const cohort = join(SCREENSHOTS, "cohort");
    for (const [name, seed] of [
      ["t1", 3],
      ["p1", 4],
      ["p2", 5],
    ]) {
      assert.equal(
        spawnSync(PROGRAM, [
          "phantom",
          "-o",
          join(cohort, name),
          "--size",
          "64",
          "--spacing",
          "5",
          "--seed",
          String(seed),
        ]).status,
        0,
      );
      cpSync(join(cohort, name, "lv_truth.nii.gz"), join(cohort, name, "lv_expert_img.nii.gz"));
    }
    const folder = join(SCREENSHOTS, "evaluation");
    const made = spawnSync(
      PROGRAM,
      ["evaluate", cohort, "--points", "67,110", "--reference-points", "67", "--output", folder],
      { encoding: "utf8" },
    );
    assert.equal(made.status, 0, made.stderr);
    for (const [width, dark] of [
      [1280, false],
      [400, true],
    ]) {
      const { page, faults, close } = await tab(browser, address, { width, dark });
      await page.getByRole("link", { name: "Evaluation" }).click();
      // The list has a place to drop files, too, and goes on loading its pictures.
      await page.waitForSelector("input[aria-label='Folder of an evaluation']", { state: "attached" });
      await page.waitForLoadState("networkidle");
      const asked = [];
      page.on(
        "request",
        request => !/^blob:/.test(request.url()) && asked.push(`${request.method()} ${request.url()}`),
      );
      const open = chosen => page.setInputFiles("input[aria-label='Folder of an evaluation']", chosen);
      await open(cohort);
      await page.waitForSelector("[role=alert]");
      await open(folder);
      await page.waitForSelector(".table1 tbody tr");
      assert.equal(await page.locator(".table1 tbody tr").count(), 3);
      await page.locator(".table1 button", { hasText: "p2" }).click();
      await page.waitForFunction(() => document.querySelector(".patient img")?.naturalWidth > 300);
      assert.match(await page.textContent(".patient"), /Patient p2/);
      await page.getByRole("button", { name: "Next" }).click();
      await page.waitForFunction(() => /Patient p1/.test(document.querySelector(".patient").textContent));
      // The reference, re-tiled, flips alone, fit alone, finished.
      assert.equal(await page.locator(".chart polyline").count(), 5);
      await page.waitForTimeout(300);
      await look(page, `evaluation-${width}`);
      assert.deepEqual(
        asked.filter(one => !/GET .*\/v1\/jobs/.test(one)),
        [],
      );
      assert.deepEqual(faults, []);
      await close();
    }
  });

  await check("a correction is fitted again", async () => {
    // Counts the pictures that are painted.
    const script = () => {
      window.painted = 0;
      const put = CanvasRenderingContext2D.prototype.putImageData;
      CanvasRenderingContext2D.prototype.putImageData = function (...all) {
        window.painted++;
        return put.apply(this, all);
      };
    };
    for (const [size, spacing] of [
      [64, 6.4],
      [128, 3.2],
    ]) {
      const folder = join(SCREENSHOTS, `refit-${size}`);
      assert.equal(
        spawnSync(PROGRAM, ["phantom", "-o", folder, "--size", String(size), "--spacing", String(spacing)]).status,
        0,
      );
      const { page, faults, close } = await tab(browser, address, { script });
      await page.waitForSelector(".drop");
      await choose(page, join(folder, "spect.nii.gz"));
      await drawn(page);
      await page.getByRole("button", { name: "Correct by hand" }).click();
      const base = page.locator(".correction label", { hasText: "Base" }).locator("input");
      if (size === 64) await typedWhileJobsBegin(page, base);
      const [times, painted] = [[], []];
      for (let n = 0; n < 5; n++) {
        await base.fill(String(Number(await base.inputValue()) + 2 - 4 * (n % 2)));
        await base.press("Tab");
        await page.waitForFunction(() =>
          /Changed: base/.test(document.querySelector(".correction [role=status]").textContent),
        );
        // From the press to the second frame after the views were given the new fit: by then its contours are drawn.
        const time = await page.evaluate(
          () =>
            new Promise(done => {
              const shown = () => document.querySelector(".downloads a.button")?.getAttribute("href");
              const before = shown();
              const start = performance.now();
              window.painted = 0;
              const frame = act => requestAnimationFrame(act);
              const look = () =>
                shown() && shown() !== before ? frame(() => frame(() => done(performance.now() - start))) : frame(look);
              [...document.querySelectorAll("button")].find(button => button.textContent === "Fit from here").click();
              look();
            }),
        );
        times.push(time);
        painted.push(await page.evaluate(() => window.painted));
        await page.waitForFunction(() =>
          /Nothing changed/.test(document.querySelector(".correction [role=status]").textContent),
        );
      }
      times.sort((a, b) => a - b);
      const [least, , median, , most] = times.map(time => time.toFixed(0));
      console.log(`  ${size}^3: new contours ${median} ms after the press (median of 5; ${least} to ${most})`);
      // Three slices, the row of slices and two maps a few times, however often the job tells of its progress.
      console.log(`  pictures painted for each: ${painted.join(", ")}`);
      assert.ok(Math.max(...painted) <= 180);
      assert.deepEqual(faults, []);
      await close();
    }
  });

  await check("self-contained reports are touched, and are whole without a script", async () => {
    const { fit, model } = reports(PROGRAM, join(SCREENSHOTS, "report"));
    for (const [width, dark] of [
      [1280, false],
      [400, true],
    ]) {
      const name = `${width}-${dark ? "dark" : "light"}`;
      const { page, faults, close } = await tab(browser, fit, { width, dark, ratio: 2 });
      await page.waitForSelector("#polar canvas");
      await page.waitForSelector("#viewer .stack");
      await page.waitForTimeout(500);
      if (width === 1280) await samePolarMap(page);
      // Through the slices by wheel or keys.
      const slice = page.locator(".slice canvas").first();
      const before = await slice.getAttribute("aria-valuenow");
      await slice.focus();
      for (let n = 0; n < 3; n++) await page.keyboard.press("PageUp");
      await page.waitForFunction(
        old => document.querySelector(".slice canvas").getAttribute("aria-valuenow") !== old,
        before,
      );
      // Table, polar map and slices show the same place.
      await page.locator("tr[data-segment='7'] button").click();
      await page.waitForFunction(() => /mid anterior/i.test(document.querySelector("#polar .at").textContent));
      assert.equal(await page.locator("tr[aria-current]").getAttribute("data-segment"), "7");
      const map = page.locator("#polar canvas").first();
      const box = await map.boundingBox();
      await map.click({ position: { x: box.width * 0.5, y: box.height * 0.84 } });
      await page.waitForFunction(() => document.querySelector("tr[aria-current]")?.dataset.segment === "4");
      await look(page, `report-${name}`);
      if (width === 1280) assert.equal(await printed(page, `report-${name}`), 2, "pages on paper");
      assert.deepEqual(faults, []);
      await close();
    }
    for (const [address, name] of [
      [fit, "fit"],
      [model, "model"],
    ]) {
      const { page, faults, close } = await tab(browser, address, { scripts: false });
      assert.ok(await page.locator(".verdict").isVisible());
      for (const picture of await page.locator("img").all()) assert.ok(await picture.isVisible());
      assert.equal(await page.locator("#viewer").isVisible(), false);
      await page.screenshot({ path: join(SCREENSHOTS, `report-plain-${name}.png`), fullPage: true });
      if (name === "fit") assert.equal(await printed(page, `report-plain-${name}`), 2, "pages on paper");
      assert.deepEqual(faults, []);
      await close();
    }
    const { page, faults, close } = await tab(browser, model);
    const wall = page.locator("#viewer .wall canvas").first();
    await wall.focus();
    const seen = await wall.getAttribute("aria-valuetext");
    for (let n = 0; n < 8; n++) await page.keyboard.press("ArrowLeft");
    await page.waitForFunction(
      old => document.querySelector(".wall canvas").getAttribute("aria-valuetext") !== old,
      seen,
    );
    assert.equal(await page.locator("#viewer select").first().inputValue(), "Distance to the surface");
    await look(page, "report-model-1280");
    assert.deepEqual(faults, []);
    await close();
  });

  await check("a key is asked for, and again when it has expired", async () => {
    const closed = await service();
    const keys = (...words) =>
      spawnSync(PROGRAM, ["keys", ...words, "--data-dir", closed.data], { encoding: "utf8" }).stdout;
    const make = name => /vf_\S+|[A-Za-z0-9_-]{30,}/.exec(keys("create", "--name", name, "--scope", "submit"))[0];
    const first = make("first");
    const { page, close } = await tab(browser, closed.address, { expected: [/401/] });
    await page.waitForSelector(".sign-in");
    await look(page, "sign-in-1280");
    await page.fill(".sign-in input", first);
    await page.keyboard.press("Enter");
    await page.waitForSelector(".welcome");
    await choose(page, SCAN);
    await drawn(page);
    const second = make("second");
    const id = /\b[0-9a-f]{16}\b(?=[^\n]*first)/.exec(keys("list"))[0];
    keys("revoke", id);
    await page.waitForTimeout(1500);
    await page.getByRole("button", { name: "New fit or model" }).click();
    await page.selectOption("#parameter-edge", "anatomical");
    await page.getByRole("button", { name: "Fit", exact: true }).click();
    await page.waitForSelector(".sign-in");
    await page.fill(".sign-in input", second);
    await page.keyboard.press("Enter");
    // The order that was refused goes on by itself.
    await page.waitForFunction(() => document.querySelectorAll(".choices li").length === 2);
    // So does an upload.
    keys("revoke", /\b[0-9a-f]{16}\b(?=[^\n]*second)/.exec(keys("list"))[0]);
    await page.waitForTimeout(1500);
    await page.goto(`${closed.address}/#/`);
    await page.waitForSelector(".drop");
    await choose(page, TRUTH);
    await page.waitForSelector(".sign-in");
    await page.fill(".sign-in input", make("third"));
    await page.keyboard.press("Enter");
    await page.waitForFunction(() =>
      /lv_truth[^]*stored/.test(document.querySelector(".uploads .stored")?.textContent ?? ""),
    );
    await close();
  });

  await check("without WebGL, slices and polar map work and the page says what is off", async () => {
    const script = () => {
      const get = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest);
      };
    };
    const { page, faults, close } = await tab(browser, address, { script });
    await filled(page, address);
    await page.locator(".scan .result", { hasText: "Fit" }).first().click();
    await drawn(page);
    await page.waitForSelector(".off");
    assert.match(await page.textContent(".off"), /WebGL/);
    // The wall is drawn all the same.
    await page.waitForFunction(() => {
      const canvas = document.querySelector(".wall canvas");
      // Of a copy: Chromium warns of a canvas that is read twice, which it is if its picture is late.
      const copy = Object.assign(document.createElement("canvas"), {
        width: canvas.width,
        height: canvas.height,
      }).getContext("2d");
      copy.drawImage(canvas, 0, 0);
      const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
      return new Set(new Uint32Array(data.buffer)).size > 50;
    });
    await look(page, "no-webgl-1280");
    assert.deepEqual(faults, []);
    await close();
  });
}

try {
  await main();
} catch (error) {
  failed++;
  console.log(error.stack);
}
for (const end of ends.reverse()) await end();
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed ? 1 : 0);
