// A patient's study on the page: one card, its series paired by kind, and earlier studies.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gatedNm, nm, small } from "./nm.mjs";

const [PATIENT, ID] = ["Several^Selma", "PH12"];
const TRACER = "Tetrofosmin Tc-99m";
/** The series of a study: the four usual ones, those of attenuation correction, and one that has no pair. */
const SERIES = {
  "gated stress": { number: 1, description: "Gated stress", position: "HFS" },
  "gated rest": { number: 2, description: "Gated rest", position: "HFS" },
  stress: { number: 3, description: "Stress NAC", position: "HFS" },
  rest: { number: 4, description: "Rest NAC", position: "HFS" },
  "corrected stress": { number: 5, description: "Stress IRAC", position: "HFS", corrected: ["ATTN", "SCAT"] },
  "corrected rest": { number: 6, description: "Rest IRAC", position: "HFS", corrected: ["ATTN", "SCAT"] },
  "prone stress": { number: 7, description: "Stress NAC prone", position: "HFP" },
  "gated rest again": { number: 10, description: "Gated rest", position: "HFS" },
  neither: { number: 11, description: "Cardiac", position: "HFS" },
  "earlier stress": { number: 8, description: "Stress", study: 2, day: "20240110" },
  "earlier rest": { number: 9, description: "Rest", study: 2, day: "20240110" },
};
const VIEWS = [
  ["1280-light", 1280, false],
  ["390-light", 390, false],
  ["390-dark", 390, true],
];

/** Each series as a file. */
function made({ PROGRAM, SCREENSHOTS }) {
  const folder = join(SCREENSHOTS, "study");
  const { status, stderr } = spawnSync(PROGRAM, ["phantom", "-o", folder, "--size", "40", "--spacing", "6"]);
  assert.equal(status, 0, String(stderr));
  const scan = readFileSync(join(folder, "spect.nii.gz"));
  const truth = readFileSync(join(folder, "lv_truth.nii.gz"));
  const files = Object.entries(SERIES).map(([name, own]) => {
    const series = { ...own, tracer: TRACER };
    const file = name.startsWith("gated")
      ? gatedNm(scan, truth, 8, PATIENT, { id: ID, series })
      : nm(scan, PATIENT, ID, series);
    const path = join(folder, `${name}.dcm`);
    writeFileSync(path, file);
    return [name, path];
  });
  return Object.fromEntries(files);
}

export async function studies(tools) {
  const { browser, service, tab, check, look, choose } = tools;
  const store = async (address, path) => {
    const sent = new FormData();
    sent.append("volume", new Blob([readFileSync(path)]), "scan.dcm");
    const answer = await fetch(`${address}/v1/volumes`, { method: "POST", body: sent });
    assert.equal(answer.status, 201, await answer.text());
  };
  const study = (page, day) => page.locator(".study", { has: page.locator("h2", { hasText: `study of ${day}` }) });
  const buttons = card => card.locator(".study-head button").allTextContents();
  const compare = (card, kind) => card.getByRole("button", { name: `Compare rest and stress: ${kind}`, exact: true });

  await check("a study is one card: scans are paired by kind, and what is not paired is said", async () => {
    const files = made(tools);
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    await page.getByLabel("then").selectOption("nothing");
    // The usual four: the gated pair is offered at once.
    await choose(page, ...["gated stress", "gated rest", "stress", "rest"].map(name => files[name]));
    await page.waitForSelector(".pair-form");
    assert.match(await page.textContent(".pair-choice:has(:checked)"), /Gated stress/);
    assert.match(await page.textContent(".pair-choice:not(:has(:checked))"), /Gated rest/);
    await page.getByRole("button", { name: "Not now" }).click();
    const card = study(page, "2025-01-15");
    assert.deepEqual(await buttons(card), [
      "Compare rest and stress: gated",
      "Compare rest and stress: not gated, not corrected",
    ]);
    assert.equal(await card.locator(".study > p").count(), 0, "nothing is left over");

    for (const name of ["corrected stress", "corrected rest", "prone stress"]) await store(own.address, files[name]);
    await page.reload();
    await page.waitForFunction(() => document.querySelectorAll(".study .scan").length === 7);
    assert.equal(await page.locator(".study").count(), 1);
    assert.deepEqual(await buttons(card), [
      "Compare rest and stress: gated",
      "Compare rest and stress: not gated, attenuation corrected",
      "Compare rest and stress: not gated, not corrected",
    ]);
    // Both scans of a pair stand beside each other.
    const rows = (await card.locator(".scan .what").allTextContents()).map(text =>
      /Gated|IRAC|NAC prone|NAC/.exec(text)?.[0].trim(),
    );
    assert.deepEqual(rows, ["Gated", "Gated", "IRAC", "IRAC", "NAC", "NAC", "NAC prone"]);
    await page.getByText("The scan at stress (not gated, not corrected, prone) has no such scan").waitFor();
    await compare(card, "not gated, attenuation corrected").press("Enter");
    await page.waitForSelector(".pair-form");
    assert.match(await page.textContent(".pair-choice:has(:checked)"), /Stress IRAC/);
    assert.match(await page.textContent(".pair-choice:not(:has(:checked))"), /Rest IRAC/);
    await page.waitForFunction(() => document.activeElement?.closest(".pair-form"));
    await page.getByRole("button", { name: "Not now" }).click();
    // A part of the list has the pairs of the whole study.
    await page.getByText("Filters").click();
    await page.getByLabel("Made at").selectOption("stress");
    await page.waitForFunction(() => document.querySelectorAll(".study .scan").length === 4);
    assert.equal((await buttons(card)).length, 3);
    await compare(card, "gated").click();
    assert.match(await page.textContent(".pair-choice:not(:has(:checked))"), /Gated rest/);
    assert.deepEqual(faults, []);
    await close();

    await store(own.address, files["earlier stress"]);
    await store(own.address, files["earlier rest"]);
    for (const [name, width, dark] of VIEWS) {
      const { page, faults, close } = await tab(browser, own.address, { width, dark });
      const [now, before] = [study(page, "2025-01-15"), study(page, "2024-01-10")];
      const link = now.getByRole("link", { name: "2024-01-10 (2 scans)" });
      await link.waitFor();
      await now.getByText("has no such scan at rest").waitFor();
      assert.equal(await before.locator(".earlier").count(), 0);
      await look(page, `study-card-${name}`);
      // Its card is on the list.
      await link.press("Enter");
      await page.waitForFunction(() => /2024-01-10/.test(document.activeElement?.textContent ?? ""));
      assert.match(page.url(), /^[^#]*(#\/)?$/);
      if (name === "1280-light") {
        // On a list without that card its scan is opened.
        await page.getByText("Filters").click();
        await page.getByLabel("Studies from").fill("2025-01-01");
        await page.waitForFunction(() => document.querySelectorAll(".study").length === 1);
        await link.click();
        await page.waitForFunction(() => /2024-01-10/.test(document.querySelector(".side header")?.textContent ?? ""));
      }
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("scans without a study stand alone, and two patients are never on one card", async () => {
    const own = await service();
    const ids = [];
    for (const n of [1, 2]) {
      const sent = new FormData();
      sent.append("volume", new Blob([small(n)]), "small.nii");
      ids.push((await (await fetch(`${own.address}/v1/volumes`, { method: "POST", body: sent })).json()).id);
    }
    const state = async identities => {
      for (const [at, identity] of identities.entries()) {
        const answer = await fetch(`${own.address}/v1/volumes/${ids[at]}/identity`, {
          method: "PUT",
          headers: { "content-type": "application/json" },
          body: JSON.stringify(identity),
        });
        assert.ok(answer.ok, await answer.text());
      }
    };
    const { page, faults, close } = await tab(browser, own.address);
    const shown = async (cards, alone) => {
      await page.reload();
      await page.waitForFunction(
        ([cards, alone]) =>
          document.querySelectorAll(".study").length === cards &&
          document.querySelectorAll(".list section > .scans > .scan").length === alone,
        [cards, alone],
      );
    };
    const [one, other] = ["PH12", "PH13"].map(patient_id => ({ patient_id, study_uid: "1.2.3.4" }));
    await shown(0, 2);
    await state([one, one]);
    await shown(1, 0);
    await state([one, other]);
    await shown(2, 0);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });

  await check("why scans of a study are not paired is said in a sentence", async () => {
    const files = made(tools);
    const own = await service();
    const { page, faults, close } = await tab(browser, own.address);
    await page.waitForSelector(".welcome");
    const said = async (name, sentence) => {
      await store(own.address, files[name]);
      await page.reload();
      await page.locator(".study > p", { hasText: sentence }).waitFor();
    };
    await said("gated stress", /^This study has no scan at rest\.$/);
    await said(
      "rest",
      /^The scan at stress \(gated\) has no such scan at rest\. The scan at rest \(not gated, .*\) has /,
    );
    await said("gated rest", /^The scan at rest \(not gated, not corrected\) has no such scan at stress\.$/);
    assert.deepEqual(await buttons(study(page, "2025-01-15")), ["Compare rest and stress"]);
    await said(
      "gated rest again",
      /^More than one pair is possible \(gated\): pick the two to compare\. The scan at rest/,
    );
    assert.deepEqual(await buttons(study(page, "2025-01-15")), []);
    await said("neither", / 1 scan says neither rest nor stress: pick the two to compare\.$/);
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });
}
