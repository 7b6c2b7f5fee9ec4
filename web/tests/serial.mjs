// Scans of one patient over the years on the page: from one press on the card of a study to figures, maps and list.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gatedNm, nm } from "./nm.mjs";

const [PATIENT, ID] = ["Years^Yara", "PH14"];
const TRACER = "Tetrofosmin Tc-99m";
/** Mid and apical segments of the LAD, which lack uptake in the later scan. */
const LAD = [7, 8, 13, 14];
const VIEWS = [
  ["1280-light", 1280, false],
  ["1280-dark", 1280, true],
  ["390-light", 390, false],
  ["390-dark", 390, true],
];
const [FIRST, MIDDLE, LAST] = [
  { study: 1, day: "20220310" },
  { study: 2, day: "20230405" },
  { study: 3, day: "20250115" },
];
/** The series of three studies. */
const SERIES = {
  first: { ...FIRST, number: 1, description: "Stress NAC" },
  last: { ...LAST, number: 2, description: "Stress NAC" },
  "first gated": { ...FIRST, number: 3, description: "Gated stress" },
  "last gated": { ...LAST, number: 4, description: "Gated stress" },
  "first rest": { ...FIRST, number: 5, description: "Rest NAC" },
  "last rest": { ...LAST, number: 6, description: "Rest IRAC", corrected: ["ATTN", "SCAT"] },
  middle: { ...MIDDLE, number: 7, description: "Stress NAC" },
};

/** Each series as a file; the later scan at stress lacks uptake. */
function made({ PROGRAM, SCREENSHOTS }) {
  const folder = join(SCREENSHOTS, "years");
  const scan = (name, ...flags) => {
    const all = ["phantom", "-o", join(folder, name), "--size", "64", "--spacing", "5", "--seed", "4", ...flags];
    const { status, stderr } = spawnSync(PROGRAM, all, { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    const read = file => readFileSync(join(folder, name, file));
    return [read("spect.nii.gz"), read("lv_truth.nii.gz")];
  };
  const before = scan("before");
  const after = scan("after", "--noise", "0.06", ...LAD.flatMap(segment => ["--defect", `${segment}:0.6`]));
  const file = (name, id, own) => {
    const [image, truth] = own.study === LAST.study ? after : before;
    const series = { ...own, tracer: TRACER };
    const path = join(folder, `${name}.dcm`);
    const isGated = name.endsWith("gated");
    writeFileSync(path, isGated ? gatedNm(image, truth, 8, PATIENT, { id, series }) : nm(image, PATIENT, id, series));
    return path;
  };
  return {
    ...Object.fromEntries(Object.entries(SERIES).map(([name, own]) => [name, file(name, ID, own)])),
    other: file("other", "PH15", { ...SERIES.last, number: 8 }),
  };
}

export async function serials(tools) {
  const { browser, service, tab, check, look, choose } = tools;
  let files;
  const data = () => (files ??= made(tools));
  const read = async (address, path) => (await fetch(address + path)).json();
  const store = async (address, path) => {
    const sent = new FormData();
    sent.append("volume", new Blob([readFileSync(path)]), "scan.dcm");
    const answer = await fetch(`${address}/v1/volumes`, { method: "POST", body: sent });
    assert.equal(answer.status, 201, await answer.clone().text());
    return (await answer.json()).id;
  };
  const study = (page, day) => page.locator(".study", { has: page.locator("h2", { hasText: `study of ${day}` }) });
  const shown = async page => {
    await page.waitForSelector(".serial .chart.trend");
    await page.waitForSelector(".serial-maps .polar canvas");
  };
  const words = verdict => verdict.replaceAll("_", " ");

  await check(
    "over the years: one press on the card of a study, figures and verdicts as the service says",
    async () => {
      const { first, last } = data();
      const own = await service();
      for (const [name, width, dark] of VIEWS) {
        const { page, faults, close } = await tab(browser, own.address, { width, dark });
        await page.waitForSelector(".drop");
        const card = study(page, "2025-01-15");
        if (name === "1280-light") {
          await page.getByLabel("then").selectOption("nothing");
          await choose(page, first, last);
          await page.waitForFunction(() => document.querySelectorAll(".study").length === 2);
          const button = card.getByRole("button", { name: "Compare over the years", exact: true });
          await button.waitFor();
          assert.equal(
            await card.locator(".offered .quiet").textContent(),
            "Takes the scans at stress: 2022-03-10 and 2025-01-15.",
          );
          assert.equal(await study(page, "2022-03-10").locator(".years").count(), 0);
          await page.getByRole("button", { name: "Not now" }).click();
          await look(page, "years-card-1280");
          await button.press("Enter");
        } else {
          const link = card.locator(".years .result");
          assert.match(
            await link.textContent(),
            /Over the years, 2 scans worse \d+\u2009% \(yes\), better 0\u2009% \(no\)/,
          );
          assert.equal(await card.locator(".offered").count(), 0, "what was compared is not offered again");
          await look(page, `years-list-${name}`);
          await link.click();
        }
        await shown(page);
        const id = await page.evaluate(() => location.hash.split("/").pop());
        assert.match(id, /^ser_/);
        const { links } = await read(own.address, `/v1/serials/${id}`);
        const report = await read(own.address, links.report);
        const [pair] = report.pairs;

        const headlines = await page.textContent(".serial .headlines");
        assert.ok(headlines.includes(`Worse wall${pair.worse_percent.toFixed(0)}\u2009%`), headlines);
        const rows = await page.locator(".by-date tbody tr").allTextContents();
        assert.equal(rows.length, report.changes.length + 2);
        const names = { cavity_ml: "Cavity, ml", mass_g: "Mass, g", dark_percent: "Below the threshold, %" };
        for (const { figure, verdict, least_change: least } of report.changes) {
          const row = rows.find(text => text.startsWith(names[figure]));
          const values = report.scans.map(scan => scan[figure].toFixed(0)).join("");
          assert.ok(row.startsWith(names[figure] + values), `${figure} in ${row}`);
          assert.match(row, new RegExp(` to .*${words(verdict)}${least.toFixed(0)}\u2009`), row);
        }
        assert.match(rows.at(-2), new RegExp(`^Worse wall, %.*${words(pair.worse_verdict)}`));
        const changed = pair.segments.filter(one => one.change_verdict === "yes");
        assert.ok(changed.length >= LAD.length, `${changed.length} segments changed`);
        assert.deepEqual(
          await page.locator("table:has(caption:text-is('Segments that changed')) tbody th").allTextContents(),
          changed.map(one => `${one.segment} ${one.name}`),
        );
        const said = (await page.textContent(".serial .verdict")).toLowerCase();
        for (const { reason } of report.flags) assert.ok(said.includes(reason.toLowerCase()), reason);
        assert.deepEqual(
          (await page.locator(".serial-scans li").allTextContents()).map(text => /Scan \d \S+/.exec(text)[0]),
          ["Scan 1 2022-03-10", "Scan 2 2025-01-15"],
        );

        // Another figure is drawn, with what is told of it.
        await page.getByRole("region", { name: "Trend" }).getByRole("combobox").selectOption("dark_percent");
        assert.match(
          await page.locator(".chart.trend").getAttribute("aria-label"),
          /^Below the threshold by date\. Scan 1, 2022-03-10: 0\u2009%\. Scan 2, .* changed: yes$/,
        );
        // One cursor on all maps, by a press and by keys.
        const maps = page.locator(".serial-maps .polar canvas");
        assert.equal(await maps.count(), 3);
        await maps.first().scrollIntoViewIfNeeded();
        const box = await maps.first().boundingBox();
        await maps.first().click({ position: { x: box.width * 0.5, y: box.height * 0.2 } });
        await page.waitForFunction(() => /7 mid anterior/.test(document.querySelector(".readout").textContent));
        const readout = page.locator(".readout");
        assert.equal(await readout.locator("dt").count(), 4);
        assert.match(await readout.textContent(), /Segment, scan 1 to 2-\d+\u2009points, changed: yes$/);
        await maps.last().focus();
        for (let n = 0; n < 8; n++) await page.keyboard.press("ArrowDown");
        assert.doesNotMatch(await readout.textContent(), /7 mid anterior/);
        await look(page, `years-${name}`);

        if (name === "1280-light") {
          const [download] = await Promise.all([
            page.waitForEvent("download"),
            page.getByRole("button", { name: "Changes, CSV" }).click(),
          ]);
          assert.match(download.suggestedFilename(), /_changes\.csv$/);
          assert.match(
            readFileSync(await download.path(), "utf8"),
            new RegExp(`dark_percent.*${report.changes.find(one => one.figure === "dark_percent").verdict}`),
          );
          assert.equal(await page.locator(".takeaways a", { hasText: "Report" }).getAttribute("href"), links.page);
          await page.getByRole("button", { name: "Compare again …" }).click();
          const boxes = page.locator(".pair-form .pair-choice input");
          await boxes.first().uncheck();
          assert.ok(await page.getByRole("button", { name: "Compare over the years" }).isDisabled());
          await boxes.first().check();
          await look(page, "years-again-1280");
          await page.getByRole("button", { name: "Not now" }).click();
          // The view of a scan leads to it.
          await page.locator(".serial-scans a").last().click();
          await page.locator(".side a.result", { hasText: "Over the years, 2 scans" }).click();
          await shown(page);
        }
        assert.deepEqual(faults, []);
        await close();
      }
      await own.stop();
    },
  );

  await check("over the years: which scans are compared is said, and a refusal is mended", async () => {
    const files = data();
    const own = await service();
    const ids = {};
    for (const name of ["first", "last", "first gated", "last gated", "first rest", "last rest"])
      ids[name] = await store(own.address, files[name]);
    const { page, faults, close } = await tab(browser, own.address, { expected: [/status of 4\d\d/] });
    const years = study(page, "2025-01-15").locator(".years");
    await years.getByText("Takes the scans at stress, gated: 2022-03-10 and 2025-01-15.").waitFor();
    await years
      .getByText(/^No earlier study has one scan at rest of the same kind \(attenuation corrected\) and tracer\.$/)
      .waitFor();
    assert.equal(await years.getByRole("button").count(), 1);
    await look(page, "years-why-1280");
    // A study between them has no gated scan.
    await store(own.address, files.middle);
    await page.reload();
    await years.getByText("not corrected: 2022-03-10, 2023-04-05 and 2025-01-15.").waitFor();
    // The service refuses scans of two patients unless somebody says that they are one.
    const other = await store(own.address, files.other);
    const answer = await fetch(`${own.address}/v1/serials`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ scans: [ids.first, other] }),
    });
    assert.equal(answer.status, 202);
    await page.reload();
    const job = years.page().locator(".years .job.failed");
    await job.getByRole("button", { name: "Change and retry" }).first().click();
    await page.waitForFunction(() =>
      /Patient ID/.test(document.querySelector(".working [role=alert]")?.textContent ?? ""),
    );
    await look(page, "years-two-patients-1280");
    await page.getByLabel("These are scans of one patient").check();
    await page.getByRole("button", { name: "Compare over the years" }).click();
    await shown(page);
    assert.match(await page.textContent(".serial-scans"), /It was stated that all are of one patient/);
    assert.match(await page.textContent(".serial .verdict"), /headers differ in/i);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });
}
