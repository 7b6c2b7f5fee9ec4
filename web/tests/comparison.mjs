// Rest and stress on the page: from two files to the display, figures, normal limits, work list, paper.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gated, gatedNm, nm } from "./nm.mjs";

/** Mid and apical segments of the LAD, which lack uptake at stress. */
const LAD = [7, 8, 13, 14];
const FIGURES = [
  ["1440-light", 1440, false],
  ["1440-dark", 1440, true],
  ["400-light", 400, false],
  ["400-dark", 400, true],
];

const BEATING = [
  ["1280-light", 1280, 800, false],
  ["1920-dark", 1920, 1080, true],
  ["400-light", 400, 850, false],
];

/** Simulated scans of one patient, as NIfTI and as NM files of one study, and normal limits of simulated people. */
function made({ PROGRAM, SCREENSHOTS }) {
  const run = (...all) => {
    const { status, stderr } = spawnSync(PROGRAM, all, { encoding: "utf8" });
    assert.equal(status, 0, stderr);
  };
  const at = (...parts) => join(SCREENSHOTS, ...parts);
  const size = ["--size", "64", "--spacing", "5", "--seed", "4"];
  run("phantom", "-o", at("rest"), ...size);
  run("phantom", "-o", at("stress"), ...size, ...LAD.flatMap(segment => ["--defect", `${segment}:0.6`]));
  const files = {};
  for (const [number, role] of ["stress", "rest"].entries()) {
    const scan = readFileSync(at(role, "spect.nii.gz"));
    const series = { number, description: `Cardiac ${role}`, tracer: "Tetrofosmin Tc-99m" };
    files[role] = at(`${role}.dcm`);
    writeFileSync(files[role], nm(scan, "Compared^Clara", "PH9", series));
    files[`plain ${role}`] = at(`heart_${role}.nii.gz`);
    writeFileSync(files[`plain ${role}`], scan);
    files[`gated ${role}`] = at(`gated_${role}.nii.gz`);
    writeFileSync(files[`gated ${role}`], gated(scan, readFileSync(at(role, "lv_truth.nii.gz")), 8));
  }
  files.folder = at("patient");
  for (const role of ["stress", "rest"]) {
    mkdirSync(join(files.folder, role), { recursive: true });
    copyFileSync(at(role, "spect.nii.gz"), join(files.folder, role, "spect.nii.gz"));
  }
  files.other = at("other.dcm");
  writeFileSync(
    files.other,
    nm(readFileSync(at("rest", "spect.nii.gz")), "Other^Olga", "PH10", {
      number: 7,
      description: "Cardiac rest",
      tracer: "Tetrofosmin Tc-99m",
    }),
  );
  run("phantom", "-o", at("healthy"), "--normal", "--cases", "13", "--size", "52", "--spacing", "5", "--seed", "5");
  files.limits = at("healthy limits.json");
  run("normals", "build", at("healthy"), "-o", files.limits, "--mixed");
  return files;
}

const displayed = async page => {
  await page.waitForSelector(".compared-slices");
  await page.waitForSelector(".compared-maps .polar canvas");
  await page.waitForSelector(".heart-wall canvas");
};

/** Whether a canvas shows something: so many colours. */
const isDrawn = canvas =>
  canvas.evaluate(element => {
    const copy = Object.assign(document.createElement("canvas"), { width: element.width, height: element.height });
    const context = copy.getContext("2d");
    context.drawImage(element, 0, 0);
    return new Set(new Uint32Array(context.getImageData(0, 0, copy.width, copy.height).data.buffer)).size;
  });

/** What a canvas shows, as a number that other pictures hardly have, and how many pixels have the last colour. */
const looked = canvas =>
  canvas.evaluate(element => {
    // A copy: canvases of the page are not made to be read often.
    const copy = Object.assign(document.createElement("canvas"), { width: element.width, height: element.height });
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(element, 0, 0);
    const { data } = context.getImageData(0, 0, copy.width, copy.height);
    let [sum, last] = [0, 0];
    for (let at = 0; at < data.length; at += 4) {
      const [red, green, blue] = data.subarray(at, at + 3);
      sum = (Math.imul(sum, 31) + 65536 * red + 256 * green + blue) | 0;
      if (red > 248 && green > 250 && blue > 150 && blue < 175) last++;
    }
    return { sum, last };
  });

/**
 * The least correlation of a slice on the page with the same one in the service's picture: green, which rises with the
 * uptake in the colours of both.
 */
const likeness = (page, path) =>
  page.evaluate(async path => {
    const picture = await createImageBitmap(await (await fetch(path)).blob());
    const shown = document.querySelector(".compared-slices");
    // As `comparedslices.tsx` and `runs/rest_stress/slices.rs` lay their cells.
    const [aside, above, ratio] = [52, 19, shown.width / shown.clientWidth];
    const cell = Math.min((shown.clientWidth - aside) / 8, (shown.clientHeight - 3 * above) / 6);
    const left = aside + (shown.clientWidth - aside - 8 * cell) / 2;
    const cut = (source, x, y, size) => {
      const context = Object.assign(document.createElement("canvas"), { width: 22, height: 22 }).getContext("2d");
      context.imageSmoothingQuality = "high";
      // Without the border, which marks the chosen slice.
      context.drawImage(source, x + 0.06 * size, y + 0.06 * size, 0.88 * size, 0.88 * size, 0, 0, 22, 22);
      return context.getImageData(0, 0, 22, 22).data.filter((_, n) => n % 4 === 1);
    };
    let least = 1;
    for (let row = 0; row < 6; row++) {
      for (let n = 0; n < 8; n++) {
        const kind = Math.floor(row / 2);
        const a = cut(shown, (left + n * cell) * ratio, ((kind + 1) * above + row * cell) * ratio, cell * ratio);
        const b = cut(picture, 84 + n * 88, row * 88 + kind * 10, 88);
        const mean = values => values.reduce((sum, value) => sum + value, 0) / values.length;
        const [p, q] = [mean(a), mean(b)];
        let [both, one, other] = [0, 0, 0];
        for (let at = 0; at < a.length; at++) {
          both += (a[at] - p) * (b[at] - q);
          one += (a[at] - p) ** 2;
          other += (b[at] - q) ** 2;
        }
        least = Math.min(least, both / Math.sqrt(one * other));
      }
    }
    return least;
  }, path);

/** The height of what is printed that its pages cut off, px. */
async function cutOff(page) {
  const before = page.viewportSize();
  await page.emulateMedia({ media: "print" });
  await page.setViewportSize({ width: 703, height: 1040 });
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.waitForTimeout(300);
  const cut = await page.evaluate(() =>
    Math.max(...[...document.querySelectorAll(".paper")].map(paper => paper.scrollHeight - paper.clientHeight)),
  );
  await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  await page.emulateMedia({ media: null });
  await page.setViewportSize(before);
  return cut;
}

const number = (value, digits, unit = "") => value.toFixed(digits) + (unit && `\u2009${unit}`);

export async function comparisons(tools) {
  const { browser, service, tab, check, look, printed, choose } = tools;
  let files;
  const data = () => (files ??= made(tools));
  const read = async (address, path) => (await fetch(address + path)).json();
  const reportOf = async (address, id) => {
    const { links } = await read(address, `/v1/comparisons/${id}`);
    return (await fetch(address + links.report, { headers: { accept: "application/json" } })).json();
  };

  // A fit that is corrected after its scan was compared: list and comparison say so, and the next one keeps it.
  const corrected = async address => {
    const ask = async (path, order) => {
      const body = order && {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify(order),
      };
      return (await fetch(address + path, body)).json();
    };
    const [made] = (await ask("/v1/comparisons")).comparisons;
    const { base } = (await reportOf(address, made.id)).stress.long_axis;
    let job = await ask("/v1/jobs", { kind: "segmentation", volume: made.volume, parameters: { base } });
    while (!/succeeded|failed|cancelled/.test(job.state)) job = await ask(job.links.self);
    assert.equal(job.state, "succeeded", JSON.stringify(job.error));
    const { page, faults, close } = await tab(browser, address, { width: 1440, height: 900 });
    await page.waitForSelector(".study");
    assert.match(await page.textContent(".study-head .result"), /older than a correction/);
    await page.locator(".study-head .result").first().click();
    await displayed(page);
    assert.match(await page.textContent(".comparison .facts .warning"), /fit at stress was corrected/);
    await look(page, "comparison-outdated");
    await page.getByRole("button", { name: "Compare again" }).click();
    const choice = page.locator(".pair-form select[aria-label$='placed as in']");
    await choice.first().waitFor();
    assert.equal(await choice.count(), 1, "the other scan has no corrected fit");
    assert.match(await choice.locator("option:checked").textContent(), /^Corrected fit/);
    await look(page, "pair-form-corrected");
    await page.getByRole("button", { name: "Compare rest and stress", exact: true }).click();
    await page.waitForFunction(id => /cmp_/.test(location.hash) && !location.hash.includes(id), made.id);
    await displayed(page);
    assert.equal(await page.locator(".comparison .facts .warning").count(), 0);
    const [again] = (await ask("/v1/comparisons")).comparisons;
    assert.deepEqual(again.parameters.stress_base, base);
    assert.deepEqual(faults, []);
    await close();
  };
  await check("rest and stress: five actions from two files to the display, figures as the service says", async () => {
    const { stress, rest } = data();
    const own = await service();
    for (const [name, width, dark] of FIGURES) {
      const { page, faults, close } = await tab(browser, own.address, { width, height: 900, dark });
      await page.waitForSelector(".drop");
      if (name === "1440-light") {
        // A click, a choice of both files, and a press: headers say which is stress.
        const [chooser] = await Promise.all([
          page.waitForEvent("filechooser"),
          page.getByRole("button", { name: "Choose files" }).click(),
        ]);
        await chooser.setFiles([stress, rest]);
        await page.waitForSelector(".pair-form");
        assert.match(await page.textContent(".pair-form"), /Filled in from the headers/);
        assert.match(await page.textContent(".pair-choice:has(:checked)"), /Cardiac stress/);
        await look(page, `pair-form-${name}`);
        await page.getByRole("button", { name: "Compare rest and stress", exact: true }).first().click();
      } else {
        // The list has both under the name of their study.
        await page.waitForSelector(".study");
        assert.match(await page.textContent(".study-head"), /Compared Clara.*patient ID PH9.*study of 2025-01-15/);
        assert.deepEqual((await page.locator(".study .title .role").allTextContents()).sort(), ["rest", "stress"]);
        assert.match(await page.textContent(".study .scans"), /Cardiac stress · Tetrofosmin Tc-99m/);
        await look(page, `study-${name}`);
        await page.locator(".study-head .result").click();
      }
      await displayed(page);
      const id = await page.evaluate(() => location.hash.split("/").pop());
      assert.match(id, /^cmp_/);
      const report = await reportOf(own.address, id);
      assert.ok(report.reversible_percent > 8, `${report.reversible_percent} % reversible`);
      if (name === "1440-light") {
        const alike = await likeness(page, `/v1/comparisons/${id}/slices.png`);
        console.log(`  slices: correlation with the service's picture at least ${alike.toFixed(3)}`);
        assert.ok(alike > 0.98, `${alike}`);
      }
      const shown = await page.textContent(".compared-headlines");
      for (const figure of [
        `TID${number(report.tid, 2)}`,
        `Reversible${number(report.reversible_percent, 0, "%")}`,
        `Fixed${number(report.fixed_percent, 0, "%")}`,
      ])
        assert.ok(shown.includes(figure), `${figure} in ${shown}`);
      const words = await page.textContent(".verdict");
      for (const { reason } of report.flags) assert.ok(words.toLowerCase().includes(reason.toLowerCase()), reason);
      const territories = page.locator(".particulars summary", { hasText: "Territories" });
      await territories.click();
      const lad = report.territories.find(one => one.name === "LAD");
      assert.ok(
        (await page.locator(".particulars tr", { hasText: "LAD" }).first().textContent()).includes(
          number(lad.reversible_percent, 0),
        ),
      );
      await page.locator(".particulars summary", { hasText: "Segments" }).click();

      // A press on the map takes the cursor to all maps and slices; arrows choose another level.
      const map = page.locator(".compared-maps .polar canvas").first();
      await map.scrollIntoViewIfNeeded();
      const box = await map.boundingBox();
      await map.click({ position: { x: box.width * 0.5, y: box.height * 0.2 } });
      await page.waitForFunction(() => /7 mid anterior/.test(document.querySelector(".readout").textContent));
      const mid = report.segments.find(one => one.segment === 7);
      assert.ok(
        (await page.textContent(".readout")).includes(`Reversible part${number(mid.reversible_percent, 0, "%")}`),
      );
      const slices = page.locator(".compared-slices");
      await slices.focus();
      assert.equal(await slices.getAttribute("aria-valuetext"), "Short axis, slice 4 of 8");
      await page.keyboard.press("ArrowRight");
      await page.keyboard.press("ArrowDown");
      assert.equal(await slices.getAttribute("aria-valuetext"), "Vertical long axis, slice 5 of 8");
      assert.ok((await isDrawn(slices)) > 200, "slices are drawn");
      for (const wall of await page.locator(".heart-wall canvas[role=slider]").all())
        assert.ok((await isDrawn(wall)) > 50, "walls are drawn");
      await page.getByLabel("On the maps").selectOption("numbers");
      await look(page, `comparison-${name}`);
      await page.getByRole("button", { name: "Slice, large" }).click();
      await page.getByLabel("contours").check();
      await page.waitForSelector(".below .slice canvas");
      await look(page, `comparison-slice-${name}`);
      if (width === 1440) {
        for (const label of ["Report", "Print"]) {
          const place = await page.locator(".takeaways").getByText(label, { exact: true }).boundingBox();
          assert.ok(place.y > 0 && place.y + place.height < 900, `${label} above the fold`);
        }
        assert.equal(await printed(page, `comparison-${name}`), 1, "one page on paper");
        assert.equal(await cutOff(page), 0, "nothing is cut off");
      }
      assert.ok((await page.locator(".downloads summary", { hasText: "DICOM objects" }).count()) === 1);
      assert.deepEqual(faults, []);
      await close();
    }
    await corrected(own.address);
    await own.stop();
  });

  await check(
    "rest and stress: scans are picked from the list, names are only a guess, slips are said in words",
    async () => {
      const { stress, other, folder } = data();
      const own = await service();
      const { page, faults, close } = await tab(browser, own.address, {
        width: 1440,
        height: 900,
        expected: [/status of 4\d\d/],
      });
      await page.waitForSelector(".drop");
      await page.getByLabel("then").selectOption("nothing");
      // Files of one name in two folders are told apart by these.
      await page.setInputFiles("input[aria-label='Folder of scans']", folder);
      await page.waitForSelector(".pair-form");
      assert.match(await page.textContent(".pair-form"), /Guessed from the file names/);
      assert.match(await page.textContent(".pair-choice:has(:checked)"), /^stress spect\.nii\.gz/);
      await page.getByRole("button", { name: "Not now" }).click();
      // Scans of two patients are named, and compared once the person says that they are one.
      await choose(page, stress, other);
      await page.waitForFunction(() =>
        /name two patients/.test(document.querySelector(".pair-form")?.textContent ?? ""),
      );
      await page.getByRole("button", { name: "Compare rest and stress", exact: true }).first().click();
      await page.waitForFunction(() =>
        /Patient ID/.test(document.querySelector(".working [role=alert]")?.textContent ?? ""),
      );
      await look(page, "two-patients-1440");
      await page.getByLabel("These are scans of one patient").check();
      await page.getByRole("button", { name: "Compare rest and stress", exact: true }).first().click();
      await displayed(page);
      assert.match(await page.textContent(".verdict"), /not comparable as they are/);
      assert.equal(await cutOff(page), 0, "nothing is cut off");
      // Picked by hand, the other way round: the flag says so.
      await page.goto(`${own.address}/#/`);
      await page.getByRole("button", { name: /^Pick stress spect/ }).click();
      await page.getByRole("button", { name: /^Pick rest spect/ }).click();
      await page.waitForSelector(".pair-form");
      await page.locator(".pair-choice", { hasText: "rest spect" }).locator("input").check();
      await page.getByRole("button", { name: "Compare rest and stress", exact: true }).first().click();
      await displayed(page);
      assert.match(await page.textContent(".comparison header"), /stress\s*rest spect/);
      assert.deepEqual(faults, []);
      await close();
      await own.stop();
    },
  );

  await check("rest and stress of gated scans: the change of the ejection fraction", async () => {
    const { "gated stress": gatedStress, "gated rest": gatedRest } = data();
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address, { width: 1440, height: 900 });
    await page.waitForSelector(".drop");
    await page.getByLabel("then").selectOption("nothing");
    await choose(page, gatedStress, gatedRest);
    await page.waitForSelector(".pair-form");
    await page.getByRole("button", { name: "Compare rest and stress", exact: true }).click();
    await displayed(page);
    const { beat, segments } = await reportOf(own.address, await page.evaluate(() => location.hash.split("/").pop()));
    const points = Math.round(beat.ef_change_points);
    const shown = await page.textContent(".compared-headlines");
    const both = `${number(beat.stress_ef_percent, 0)} / ${number(beat.rest_ef_percent, 0, "%")}`;
    assert.ok(shown.includes(`EF change${points > 0 ? "+" : ""}${number(points, 0, "points")}${both}`), shown);
    assert.ok(
      (await page.textContent(".particulars")).includes(
        `End-diastolic volume${number(beat.stress_edv_ml, 0, "ml")}${number(beat.rest_edv_ml, 0, "ml")}`,
      ),
    );
    await page.locator(".particulars summary", { hasText: "Segments" }).click();
    const moved = Math.abs(segments[6].motion_change_mm).toFixed(1);
    assert.ok((await page.locator(".particulars tr", { hasText: "7 mid anterior" }).textContent()).includes(moved));
    await look(page, "comparison-gated-1440");
    assert.equal(await cutOff(page), 0, "nothing is cut off");
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  await check("rest and stress of gated scans: one player, one cursor, curves and maps of both beats", async () => {
    data();
    const own = await service();
    const order = new FormData();
    for (const [number, [role, gates]] of [
      ["stress", 16],
      ["rest", 8],
    ].entries()) {
      const at = (...parts) => readFileSync(join(tools.SCREENSHOTS, ...parts));
      const series = { number, description: `Gated ${role}`, tracer: "Tetrofosmin Tc-99m" };
      const scan = gatedNm(at(role, "spect.nii.gz"), at("rest", "lv_truth.nii.gz"), gates, "Compared^Clara", {
        id: "PH9",
        series,
      });
      order.append(role, new Blob([scan]), `${role}.dcm`);
    }
    const made = await fetch(`${own.address}/v1/comparisons`, {
      method: "POST",
      body: order,
      headers: { prefer: "wait=300" },
    });
    assert.equal(made.status, 200, await made.clone().text());
    const [{ id }] = (await read(own.address, "/v1/comparisons")).comparisons;
    const { beat } = await reportOf(own.address, id);
    const gateText = page => page.textContent(".player .gate");
    for (const [name, width, height, dark] of BEATING) {
      const { page, faults, close } = await tab(browser, `${own.address}/#/comparison/${id}`, { width, height, dark });
      await displayed(page);
      const slices = page.locator(".compared-slices");
      assert.match(await gateText(page), /sum of all gates/);
      await page.getByLabel("contours").check();
      await page.evaluate(() => document.activeElement.blur());
      const still = await looked(slices);
      // The space bar plays all rows; it stops them, too.
      await page.keyboard.press("Space");
      await page.waitForFunction(() => /gate \d+ of 16/.test(document.querySelector(".player .gate").textContent));
      await page.waitForFunction(() => !document.querySelector(".player [role=status]"));
      if (name === BEATING[0][0]) {
        // No beat is stored yet: the contours are those of the sum, and the view says so.
        assert.match(await page.textContent(".compared-stage"), /Contours at stress and at rest: the wall in the sum/);
        await look(page, "comparison-cine-no-beats");
        await page.getByRole("button", { name: "Fit the beats" }).click();
      }
      // Two beats are fitted, which takes minutes beside other work.
      await page.waitForSelector(".compared-beat .beat-chart", { timeout: 600_000 });
      await page.waitForFunction(
        () => !/the wall in the sum/.test(document.querySelector(".compared-stage").textContent),
      );
      const moving = await gateText(page);
      await page.waitForFunction(text => document.querySelector(".player .gate").textContent !== text, moving);
      await page.evaluate(() => document.activeElement.blur());
      await page.keyboard.press("Space");
      const held = await gateText(page);
      await page.waitForTimeout(400);
      assert.equal(await gateText(page), held);
      // Arrows go gate by gate; the scan with fewer gates is at the same moment of its cycle.
      const pictures = new Set();
      for (let step = 0; step < 16; step++) {
        await page.keyboard.press("ArrowRight");
        await page.waitForTimeout(120);
        const [, stress, rest] = /gate (\d+) of 16 .*rest (\d+) of 8/.exec(await gateText(page));
        assert.equal(Number(rest), Math.ceil(Number(stress) / 2));
        const { sum, last } = await looked(slices);
        pictures.add(sum);
        // The thick, bright wall of end systole has the last colour in few places; in the sum, a quarter of it has.
        assert.ok(last < 0.2 * still.last, `${last} pixels of the last colour in a gate, ${still.last} in the sum`);
      }
      assert.ok(pictures.size === 16, `${pictures.size} pictures of 16 gates`);
      await page.getByRole("button", { name: "Sum of gates" }).click();
      await page.waitForTimeout(200);
      assert.deepEqual(await looked(slices), still, "the sum is as it was");

      assert.equal(await page.locator(".compared-beat polyline").count(), 2, "curves");
      const figures = await page.textContent(".compared-beat table");
      for (const text of [
        `End-diastolic volume${number(beat.stress_edv_ml, 0, "ml")}90 %:`,
        `${beat.ef_change_points > 0 ? "+" : ""}${number(beat.ef_change_points, 0, "points")}`,
      ])
        assert.ok(figures.includes(text), `${text} in ${figures}`);
      assert.equal(await page.locator(".compared-beat .phases svg").count(), 2, "histograms");
      assert.deepEqual(
        await page
          .locator(".map-row")
          .evaluateAll(rows => rows.map(row => row.querySelectorAll("canvas[role=img]").length)),
        [3, 3, 3, 3],
      );

      // Pointing to a place marks it in maps, slices and tables; the cursor of a press comes back afterwards.
      const unmarked = await looked(slices);
      const map = page.locator(".map-row", { hasText: "Thickening" }).locator(".polar canvas").nth(2);
      await map.scrollIntoViewIfNeeded();
      const box = await map.boundingBox();
      const place = { x: box.width * 0.5, y: box.height * 0.2 };
      await map.click({ position: place });
      await page.waitForFunction(() => /7 mid anterior/.test(document.querySelector(".readout").textContent));
      await page.waitForTimeout(200);
      assert.notDeepEqual(await looked(slices), unmarked, "the place is marked on the slices");
      assert.match(
        (await page.locator(".readout tbody tr").allTextContents()).join(" "),
        /Uptake.*%.*Motion inward.*mm.*Thickening.*%.*Phase.*°/,
      );
      const segments = page.locator(".compared-beat summary", { hasText: "Segments" });
      // By the keyboard: the mouse would point to what opens under it.
      await page.mouse.move(5, 5);
      await segments.press("Enter");
      await page.waitForSelector(".compared-beat tr.marked");
      assert.match(await page.textContent(".compared-beat tr.marked"), /^7 mid anterior/);
      await page.locator(".compared-beat tbody tr", { hasText: "10 mid inferior" }).hover();
      await page.waitForFunction(() => /10 mid inferior/.test(document.querySelector(".readout").textContent));
      await page.locator(".compared-beat h2").first().hover();
      await page.waitForFunction(() => /7 mid anterior/.test(document.querySelector(".readout").textContent));
      await page.mouse.move(5, 5);
      await segments.press("Enter");
      // By keys.
      await map.focus();
      for (let step = 0; step < 20; step++) await page.keyboard.press("ArrowDown");
      assert.match(await page.textContent(".readout"), /mid inferior|basal inferior/);

      if (width >= 1920) {
        const used = await slices.evaluate(element => {
          const cell = Math.min((element.clientWidth - 52) / 8, (element.clientHeight - 3 * 19) / 6);
          return (8 * cell + 52) / element.clientWidth;
        });
        assert.ok(used > 0.95, `${used} of the width`);
        assert.equal(await page.locator(".maps-side .heart-wall").count(), 2, "walls stand beside the slices");
      }
      await page.keyboard.press("Escape");
      await look(page, `comparison-beat-${name}`);
      if (width === 1280) assert.equal(await printed(page, `comparison-beat-${name}`), 1, "one page on paper");
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("a heart is corrected in the comparison by handles and by two points of the valve plane", async () => {
    const { stress, rest } = data();
    const own = await service();
    const order = new FormData();
    for (const [role, path] of Object.entries({ stress, rest }))
      order.append(role, new Blob([readFileSync(path)]), `${role}.dcm`);
    const made = await fetch(`${own.address}/v1/comparisons`, {
      method: "POST",
      body: order,
      headers: { prefer: "wait=300" },
    });
    assert.equal(made.status, 200, await made.clone().text());
    const [{ id }] = (await read(own.address, "/v1/comparisons")).comparisons;
    const before = await reportOf(own.address, id);
    const { base, apex } = before.stress.long_axis;
    const length = Math.hypot(...apex.map((value, axis) => value - base[axis]));
    for (const [name, width, height] of [
      ["400", 400, 850],
      ["1920", 1920, 1080],
    ]) {
      const { page, faults, close } = await tab(browser, `${own.address}/#/comparison/${id}`, { width, height });
      await displayed(page);
      await page.getByRole("button", { name: "Correct stress" }).click();
      const panel = page.getByRole("group", { name: "Correct stress by hand" });
      const told = panel.getByText(/^Changed: |^Nothing changed/);
      assert.equal(await told.textContent(), "Nothing changed yet");
      assert.ok(await panel.getByRole("button", { name: "Fit and compare again" }).isDisabled());
      const slices = page.locator(".compared-slices");
      await slices.scrollIntoViewIfNeeded();
      const box = await slices.boundingBox();
      const aside = box.width < 500 ? 38 : 52;
      const cell = Math.min((box.width - aside) / 8, (box.height - 3 * 19) / 6);
      const left = aside + (box.width - aside - 8 * cell) / 2;
      /** A place in the fourth vertical long-axis slice of stress, mm from its middle. */
      const at = (right, down) => ({
        x: left + 3.5 * cell + (right * cell) / 114.4,
        y: 2 * 19 + 2.5 * cell + (down * cell) / 114.4,
      });
      const drag = async (from, to) => {
        const [a, b] = [at(...from), at(...to)];
        await page.mouse.move(box.x + a.x, box.y + a.y);
        await page.mouse.down();
        await page.mouse.move(box.x + b.x, box.y + b.y, { steps: 3 });
        await page.mouse.up();
      };
      const plain = await looked(slices);
      const distance = panel.getByLabel("Base, mm from the centre");
      const first = Number(await distance.inputValue());
      // The centre stands at 45 hundredths of the way from the base to the apex, which is half of the length away.
      const centre = length / 2 - (first * 0.55) / 0.45;
      await drag([centre, 0], [centre, 12]);
      assert.equal(await told.textContent(), "Changed: center");
      await page.waitForTimeout(200);
      assert.notDeepEqual(await looked(slices), plain, "the wall is shown where it goes");
      await panel.getByRole("button", { name: "Undo changes" }).click();
      assert.equal(await told.textContent(), "Nothing changed yet");
      // The valve plane goes through two points, eight millimetres nearer to the apex.
      await panel.getByRole("button", { name: "Valve plane by two points" }).click();
      const valve = centre - first + 8;
      await slices.click({ position: at(valve, -24) });
      assert.match(await panel.textContent(), /Press on the other side/);
      await slices.click({ position: at(valve, 24) });
      await page.waitForTimeout(200);
      assert.equal(await told.textContent(), "Changed: base");
      assert.ok(Math.abs(Number(await distance.inputValue()) - (first - 8)) <= 2, await distance.inputValue());
      await look(page, `comparison-correct-${name}`);
      if (name === "1920") {
        await panel.getByRole("button", { name: "Fit and compare again" }).click();
        await page.waitForFunction(id => /cmp_/.test(location.hash) && !location.hash.includes(id), id);
        await displayed(page);
        assert.match(await page.textContent(".comparison header"), /corrected by hand: base/);
        const [again] = (await read(own.address, "/v1/comparisons")).comparisons;
        assert.equal(again.parameters.stress_base.length, 3);
        assert.equal(again.parameters.stress_center ?? null, null);
        assert.equal(again.parameters.kept_model, before.stress.template);
        assert.equal(await page.locator(".comparison .facts .warning").count(), 0);
      }
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("normal limits are added, chosen, always called simulated, and erased", async () => {
    const { "plain stress": plainStress, "plain rest": plainRest, limits } = data();
    const own = await service();
    for (const [name, width, dark] of FIGURES) {
      const { page, faults, close } = await tab(browser, `${own.address}/#/limits`, {
        width,
        height: 900,
        dark,
        expected: [/status of 422/],
      });
      await page.waitForSelector(".limits h1");
      if (name === "1440-light") {
        await look(page, "limits-empty");
        await page.setInputFiles("input[aria-label='File of normal limits']", {
          name: "no.json",
          mimeType: "application/json",
          buffer: Buffer.from('{"format": "else"}'),
        });
        await page.waitForSelector(".limits [role=alert]");
        await page.setInputFiles("input[aria-label='File of normal limits']", limits);
      }
      await page.waitForSelector(".limits-item");
      assert.match(
        await page.textContent(".limits-item"),
        /healthy limits.*simulated people, not patients.*men and women together.*phantom.*13/,
      );
      await look(page, `limits-${name}`);
      await page.goto(`${own.address}/#/`);
      await page.waitForSelector(".drop");
      if (name === "1440-light") {
        await page.getByLabel("then").selectOption("nothing");
        await choose(page, plainStress, plainRest);
        await page.waitForSelector("#parameter-normals");
        await page.selectOption("#parameter-normals", { index: 1 });
        await page.selectOption("#parameter-stress_protocol", "phantom");
        await page.selectOption("#parameter-rest_protocol", "phantom");
        await look(page, "pair-limits-1440");
        await page.getByRole("button", { name: "Compare rest and stress", exact: true }).first().click();
      } else await page.locator(".scan .result", { hasText: "SSS" }).first().click();
      await displayed(page);
      const id = await page.evaluate(() => location.hash.split("/").pop());
      const report = await reportOf(own.address, id);
      const shown = await page.textContent(".compared-headlines");
      for (const score of ["sss", "srs", "sds"])
        assert.ok(shown.includes(`${score.toUpperCase()}${report[score]}`), `${score} ${report[score]} in ${shown}`);
      assert.ok(report.sss > report.srs, `${report.sss} and ${report.srs}`);
      assert.match(await page.textContent(".simulated-note"), /simulated people, not patients/);
      assert.equal(await page.locator(".compared-maps .polar").count(), 7);
      assert.ok(
        (await page.textContent(".particulars")).includes(number(report.stress.perfusion.deficit_percent, 1, "%")),
      );
      await page.getByLabel("On the maps").selectOption("scores");
      await look(page, `scored-${name}`);
      if (width === 1440) {
        assert.equal(await printed(page, `scored-${name}`), 1, "one page on paper");
        assert.equal(await cutOff(page), 0, "nothing is cut off");
      }
      // No word of a category or a diagnosis.
      assert.doesNotMatch(
        await page.textContent(".comparison"),
        /abnormal|ischa?emia|infarct|probable|low risk|high risk/i,
      );

      // A fit beside the same limits.
      await page.locator(".comparison header a").first().click();
      await page.waitForSelector(".side");
      if (name === "1440-light") {
        await page.getByRole("button", { name: "New fit or model" }).click();
        await page.waitForSelector("#parameter-normals");
        await page.selectOption("#parameter-normals", { index: 1 });
        await page.getByRole("button", { name: "Fit", exact: true }).click();
      }
      await page.waitForSelector(".perfusion .maps canvas");
      const [fit] = (await read(own.address, "/v1/segmentations")).segmentations;
      const { perfusion } = await (
        await fetch(own.address + fit.links.report, { headers: { accept: "application/json" } })
      ).json();
      const words = await page.textContent(".perfusion");
      for (const figure of [
        number(perfusion.deficit_percent, 1, "%"),
        `Summed score${number(perfusion.summed_score, 0, "of 68")}`,
        "simulated people, not patients",
      ])
        assert.ok(words.includes(figure), `${figure} in ${words}`);
      await look(page, `fit-limits-${name}`);
      if (width === 1440) assert.equal(await printed(page, `fit-limits-${name}`), 2, "pages on paper");
      if (width === 1440) assert.equal(await cutOff(page), 0, "nothing is cut off");
      assert.deepEqual(faults, []);
      await close();
    }
    const { page, faults, close } = await tab(browser, `${own.address}/#/limits`, { width: 1440, height: 900 });
    await page.waitForSelector(".limits-item");
    await page.getByRole("button", { name: "Erase healthy limits" }).click();
    await page.locator(".ask .danger").click();
    await page.waitForFunction(() => !document.querySelector(".limits-item"));
    assert.deepEqual((await read(own.address, "/v1/normals")).normals, []);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });
}
