// Readings on the page: scores by keyboard, offered sentences, signing, amending, sending, and who may not sign.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { gatedNm, nm } from "./nm.mjs";

const [PATIENT, ID] = ["Signed^Sina", "PH16"];
const TRACER = "Tetrofosmin Tc-99m";
/** Mid and apical segments of the LAD, which lack uptake at stress. */
const LAD = [7, 8, 13, 14];
const VIEWS = [
  ["1280-dark", 1280, true],
  ["390-light", 390, false],
  ["390-dark", 390, true],
];

/** Scans of one study as NM files, and normal limits of simulated people. */
function made({ PROGRAM, SCREENSHOTS }) {
  const run = (...all) => {
    const { status, stderr } = spawnSync(PROGRAM, all, { encoding: "utf8" });
    assert.equal(status, 0, stderr);
  };
  const at = (...parts) => join(SCREENSHOTS, "read", ...parts);
  const size = ["--size", "52", "--spacing", "5", "--seed", "4"];
  run("phantom", "-o", at("rest"), ...size);
  run("phantom", "-o", at("stress"), ...size, ...LAD.flatMap(segment => ["--defect", `${segment}:0.6`]));
  const file = (role, number) => {
    const path = at(`${role}.dcm`);
    const series = { number, description: `Cardiac ${role}`, tracer: TRACER };
    writeFileSync(path, nm(readFileSync(at(role, "spect.nii.gz")), PATIENT, ID, series));
    return path;
  };
  const gated = at("gated.dcm");
  const images = ["spect.nii.gz", "lv_truth.nii.gz"].map(name => readFileSync(at("rest", name)));
  writeFileSync(gated, gatedNm(...images, 8, PATIENT, { id: ID, series: { number: 3, description: "Gated rest" } }));
  run("phantom", "-o", at("healthy"), "--normal", "--cases", "13", "--size", "52", "--spacing", "5", "--seed", "5");
  run("normals", "build", at("healthy"), "-o", at("healthy.json"), "--mixed");
  return { stress: file("stress", 1), rest: file("rest", 2), gated, limits: at("healthy.json") };
}

/** An archive that takes nothing until it is mended. */
async function archive() {
  let takes = false;
  const server = createServer((request, answer) => {
    request.resume().on("end", () => {
      const stored = { "00081199": { vr: "SQ", Value: [{}] } };
      if (request.method === "GET") answer.writeHead(204).end();
      else if (!takes) answer.writeHead(503).end("The disk is full.");
      else answer.writeHead(200, { "content-type": "application/dicom+json" }).end(JSON.stringify(stored));
    });
  });
  await new Promise(done => server.listen(0, "127.0.0.1", done));
  return {
    url: `http://127.0.0.1:${server.address().port}/dicom-web`,
    mend: () => (takes = true),
    end: () => server.close(),
  };
}

export async function readings(tools) {
  const { PROGRAM, SCREENSHOTS, browser, service, tab, check, look } = tools;
  let files;
  const data = () => (files ??= made(tools));
  const read = async (address, path) => (await fetch(address + path)).json();
  const post = async (address, path, body, headers = {}) => {
    const answer = await fetch(address + path, { method: "POST", body, headers });
    assert.ok(answer.ok, await answer.clone().text());
    return answer.json();
  };
  const order = (address, path, given, headers = {}) =>
    post(address, path, JSON.stringify(given), { "content-type": "application/json", ...headers });
  const store = async (address, path, headers = {}) => {
    const sent = new FormData();
    sent.append("volume", new Blob([readFileSync(path)]), "scan.dcm");
    return (await post(address, "/v1/volumes", sent, headers)).id;
  };
  const until = async (address, { links }, headers = {}) => {
    for (;;) {
      const job = await (await fetch(address + links.self, { headers })).json();
      if (job.state === "succeeded") return job;
      assert.ok(["queued", "running"].includes(job.state), JSON.stringify(job.error));
      await new Promise(done => setTimeout(done, 200));
    }
  };
  const signed = page => page.locator(".reading .signed b");
  const cell = (page, scan, segment) => page.locator(`.scores input[aria-label^="${scan}, segment ${segment} "]`);

  await check("a reading of rest and stress is scored by keyboard, signed, sent, amended and listed", async () => {
    const { stress, rest, limits } = data();
    const pacs = await archive();
    const config = join(SCREENSHOTS, "read/archives.toml");
    writeFileSync(config, `[[archives]]\nname = "pacs"\ndicomweb = "${pacs.url}"\n`);
    const own = await service("--config", config, "--archive-attempts", "1");
    const json = { "content-type": "application/json" };
    const { id: normals } = await post(own.address, "/v1/normals?name=healthy", readFileSync(limits), json);
    const scans = { stress: await store(own.address, stress), rest: await store(own.address, rest) };
    const protocols = { stress_protocol: "phantom", rest_protocol: "phantom" };
    const filed = await order(own.address, "/v1/comparisons", { ...scans, normals, parameters: protocols });
    const { comparison: id } = await until(own.address, filed);
    const report = await read(own.address, `/v1/comparisons/${id}/report`);
    const automatic = report.segments.map(one => one.stress_score);
    assert.ok(automatic.some(score => score > 0) && report.impression.length > 1, "there is something to read");

    const { page, faults, close } = await tab(browser, own.address, { expected: [/status of 4\d\d/] });
    await page.goto(`${own.address}/#/comparison/${id}`);
    const panel = page.locator(".reading");
    await panel.getByText("Not read yet.").waitFor();
    await page.locator(".reading-state", { hasText: "Not read yet" }).getByRole("button").click();
    assert.equal(await page.evaluate(() => document.activeElement.textContent), "Reading");
    // Actions of a person, which the whole of it should not need more than ten of.
    let actions = 0;
    const act = async doing => {
      actions++;
      await doing;
    };
    await act(panel.getByRole("button", { name: "Read", exact: true }).click());
    assert.deepEqual(
      await page.locator('.scores input[aria-label^="Stress"]').evaluateAll(all => all.map(one => Number(one.value))),
      automatic,
      "scores begin as the automatic ones",
    );
    await look(page, "reading-begun-1280");
    await act(cell(page, "Stress", 1).click());
    await act(page.keyboard.type("20"));
    assert.equal(await page.evaluate(() => document.activeElement.dataset.cell), "2 0");
    const wanted = [2, 0, ...automatic.slice(2)];
    const sum = scores => scores.reduce((all, score) => all + score, 0);
    const atRest = report.segments.map(one => one.rest_score);
    const sds = sum(wanted.map((score, n) => Math.max(0, score - atRest[n])));
    const foot = page.locator(".scores tfoot");
    assert.deepEqual(await foot.locator("td").allTextContents(), [
      String(sum(wanted)),
      String(sum(automatic)),
      String(sum(atRest)),
      String(sum(atRest)),
      String(sds),
    ]);
    await page.keyboard.press("ArrowUp");
    await page.keyboard.press("ArrowRight");
    assert.equal(await page.evaluate(() => document.activeElement.dataset.cell), "1 1");
    // What is no score changes nothing.
    await page.keyboard.type("7x");
    assert.equal(await cell(page, "Rest", 2).inputValue(), String(atRest[1]));
    const [sentence] = report.impression;
    await act(panel.getByRole("button", { name: sentence, exact: true }).click());
    const impression = panel.getByLabel("Impression");
    assert.equal(await impression.inputValue(), sentence);
    // Another view does not lose it, and leaving the page asks.
    await page.getByRole("link", { name: "Glossary" }).click();
    await page.waitForSelector(".glossary");
    await page.goBack();
    await panel.getByText("Not signed yet.").waitFor();
    assert.equal(await impression.inputValue(), sentence);
    const [dialog] = await Promise.all([page.waitForEvent("dialog"), page.close({ runBeforeUnload: true })]);
    assert.equal(dialog.type(), "beforeunload");
    await dialog.dismiss();
    await act(panel.getByLabel("Send to the PACS").check());
    await act(panel.getByLabel("Name of the archive").fill("none"));
    await act(panel.getByLabel("Reader, family name").fill("Doe"));
    await act(panel.getByLabel("Given name").fill("Jane"));
    await act(panel.getByRole("button", { name: "Sign", exact: true }).click());
    assert.ok(actions <= 10, `${actions} actions`);
    // An archive that is not configured is told, and which ones are.
    await panel.getByText(/There is no archive none\. Known archives: pacs\./).waitFor();
    await panel.getByLabel("Name of the archive").fill("pacs");
    await look(page, "reading-1280-light");
    for (const [name, width, dark] of VIEWS) {
      await page.setViewportSize({ width, height: 850 });
      await page.emulateMedia({ colorScheme: dark ? "dark" : "light" });
      await look(page, `reading-${name}`);
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.emulateMedia({ colorScheme: "light" });
    await panel.getByRole("button", { name: "Sign", exact: true }).click();
    await signed(page).waitFor();
    assert.match(await signed(page).textContent(), /^Read by Doe, Jane on /);
    assert.equal(await page.locator(".reading-state span").textContent(), await signed(page).textContent());
    assert.equal(await page.evaluate(() => document.activeElement.textContent), "Reading", "focus stays in the panel");
    assert.equal(await page.locator(".reading-form").count(), 0);
    const [first] = (await read(own.address, "/v1/readings")).readings;
    const stated = await read(own.address, first.links.report);
    assert.deepEqual(stated.scores[0].segments, wanted);
    assert.equal(stated.sds, sds);
    assert.equal(stated.impression, sentence);
    assert.equal(stated.reader, "Doe^Jane");
    // The archive takes nothing, then it does.
    await panel.getByText(/Sending to pacs failed: /).waitFor();
    await look(page, "reading-not-sent-1280");
    pacs.mend();
    await panel.getByRole("button", { name: "Send again" }).click();
    await panel.getByText(/Delivered to pacs/).waitFor();
    const [paper] = await Promise.all([
      page.context().waitForEvent("page"),
      panel.getByRole("link", { name: "Printed page" }).click(),
    ]);
    await paper.waitForLoadState();
    assert.ok((await paper.textContent("body")).includes(sentence));
    await paper.close();
    for (const [name, ending] of [
      ["Structured report", /_reading_measurements\.dcm$/],
      ["FHIR", /_reading_fhir\.json$/],
    ]) {
      const [download] = await Promise.all([
        page.waitForEvent("download"),
        panel.getByRole("button", { name, exact: true }).click(),
      ]);
      assert.match(download.suggestedFilename(), ending);
    }

    // An amendment begins with what was read, and keeps it.
    await panel.getByRole("button", { name: "Amend" }).click();
    assert.equal(await impression.inputValue(), sentence);
    assert.equal(await cell(page, "Stress", 1).inputValue(), "2");
    assert.equal(await panel.getByLabel("Reader, family name").inputValue(), "Doe");
    await impression.fill(`Mrs. Sina. ${sentence}`);
    await panel.getByRole("button", { name: "Sign the amendment" }).click();
    await panel.locator("#reading-impression", { hasText: "patient" }).waitFor();
    assert.equal(await impression.getAttribute("aria-invalid"), "true");
    await impression.fill(`${sentence}\nNo dilation.`);
    // Somebody else signs meanwhile.
    const other = { result: id, reader: "Roe^Richard", impression: "Seen.", amends: first.id };
    await until(own.address, await order(own.address, "/v1/readings", other));
    await panel.getByRole("button", { name: "Sign the amendment" }).click();
    await panel.getByText(/This result was read meanwhile\. Read by Roe, Richard/).waitFor();
    await look(page, "reading-meanwhile-1280");
    await panel.getByRole("button", { name: "Amend that reading" }).click();
    await panel.getByRole("button", { name: "Sign the amendment" }).click();
    await page.waitForFunction(() => !document.querySelector(".reading-form"));
    assert.match(await signed(page).textContent(), /^Read by Doe, Jane on /);
    await panel.getByText("2 former readings").click();
    assert.match((await panel.locator(".former li").allTextContents()).join(), /Roe, Richard.*Doe, Jane/);
    const { readings: all } = await read(own.address, "/v1/readings");
    assert.deepEqual(
      all.map(one => one.links.amends?.split("/").pop()),
      [all[1].id, first.id, undefined],
    );
    await look(page, "read-1280-light");
    for (const [name, width, dark] of VIEWS) {
      await page.setViewportSize({ width, height: 850 });
      await page.emulateMedia({ colorScheme: dark ? "dark" : "light" });
      await look(page, `read-${name}`);
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.getByRole("link", { name: "Scans" }).click();
    assert.equal(await page.locator(".study-head .result .read").textContent(), "read");
    await look(page, "read-list-1280");
    assert.deepEqual(faults, []);
    await close();
    pacs.end();
    await own.stop();
  });

  await check("a reading of a fit: nothing is scored unasked, and a key that may not sign is told so", async () => {
    const { stress } = data();
    const own = await service();
    const keys = (...words) =>
      spawnSync(PROGRAM, ["keys", ...words, "--data-dir", own.data], { encoding: "utf8" }).stdout;
    const key = scope => /vf_\S+|[A-Za-z0-9_-]{30,}/.exec(keys("create", "--name", scope, "--scope", scope))[0];
    const [submit, signs] = [key("submit"), key("sign")];
    const as = { authorization: `Bearer ${submit}` };
    const volume = await store(own.address, stress, as);
    const fit = { kind: "segmentation", volume, parameters: { model: "auto" } };
    const { segmentation: id } = await until(own.address, await order(own.address, "/v1/jobs", fit, as), as);
    for (const [name, width, dark] of [["1280-light", 1280, false], ...VIEWS]) {
      const { page, faults, close } = await tab(browser, own.address, { width, dark, expected: [/status of 40[13]/] });
      const begin = async given => {
        await page.waitForSelector(".sign-in");
        await page.fill(".sign-in input", given);
        await page.keyboard.press("Enter");
        await page.waitForSelector(".list");
        await page.goto(`${own.address}/#/scan/${volume}/${id}`);
      };
      const panel = page.locator(".reading");
      if (name === "1280-light") {
        await begin(submit);
        await panel.getByRole("button", { name: "Read", exact: true }).click();
        assert.equal(await panel.getByLabel("Sign these scores").isChecked(), false);
        await panel.getByText("Without normal limits there are no automatic scores.").waitFor();
        assert.equal(await page.locator(".scores thead th").count(), 2);
        await panel.getByLabel("Reader, family name").fill("Doe");
        await panel.getByLabel("Impression").fill("No perfusion defect.");
        await look(page, `reading-fit-${name}`);
        await panel.getByRole("button", { name: "Sign", exact: true }).click();
        await panel.locator(".error[role=alert]", { hasText: /sign/i }).waitFor();
        await look(page, "reading-refused-1280");
        // Nothing is lost: another key signs it.
        await page.getByRole("button", { name: "Forget the key" }).click();
        await panel.getByRole("button", { name: "Sign", exact: true }).click();
        await page.waitForSelector(".sign-in");
        await page.fill(".sign-in input", signs);
        await page.keyboard.press("Enter");
        await signed(page).waitFor();
        await page.locator(".choices .read").waitFor();
      } else await begin(submit);
      await signed(page).waitFor();
      await panel.getByText("Not sent to the PACS.").waitFor();
      await panel.getByRole("button", { name: "Amend" }).click();
      assert.equal(await panel.getByLabel("Sign these scores").isChecked(), false);
      await look(page, `amending-fit-${name}`);
      await cell(page, "Score", 7).fill("3");
      assert.equal(await panel.getByLabel("Sign these scores").isChecked(), true);
      assert.equal(await page.locator(".scores tfoot output").textContent(), "3");
      await panel.getByRole("button", { name: "Discard" }).click();
      await page.locator(".reading .ask .danger").click();
      await page.waitForFunction(() => !document.querySelector(".reading-form"));
      const [download] = await Promise.all([
        page.waitForEvent("download"),
        panel.getByRole("button", { name: "Printed page" }).click(),
      ]);
      assert.match(readFileSync(await download.path(), "utf8"), /read by Doe[^]*No perfusion defect\./);
      await page.goto(`${own.address}/#/`);
      await page.locator(".scan .result .read").waitFor();
      assert.deepEqual(faults, []);
      await close();
    }
    await own.stop();
  });

  await check("a reading of a beat, which a job that failed leads back to", async () => {
    const { gated } = data();
    const own = await service();
    const volume = await store(own.address, gated);
    const wanted = { kind: "beat", volume, parameters: { model: "auto" } };
    const { beat: id } = await until(own.address, await order(own.address, "/v1/jobs", wanted));
    // A beat has no scores at rest, which its job finds.
    const wrong = { result: id, reader: "Doe^Jane", rest_scores: new Array(17).fill(0) };
    await order(own.address, "/v1/readings", wrong);
    const { page, faults, close } = await tab(browser, own.address);
    const line = page.locator(".scan .job.failed", { hasText: "Reading" });
    await line.getByRole("button", { name: "Change and retry" }).click();
    const panel = page.locator(".reading");
    await panel.getByRole("button", { name: "Read", exact: true }).click();
    await panel.getByRole("button", { name: /ejection fraction \d/ }).click();
    await panel.getByLabel("Quality of the study").selectOption("fair");
    await panel.getByLabel("Reader, family name").fill("Doe");
    await panel.getByRole("button", { name: "Sign", exact: true }).click();
    await panel.getByText("quality fair").waitFor();
    await page.locator(".choices .current .read").waitFor();
    const [{ links }] = (await read(own.address, "/v1/readings")).readings;
    const stated = await read(own.address, links.report);
    assert.match(stated.impression, /ejection fraction \d/);
    assert.deepEqual(stated.scores, [], "nothing is scored unasked");
    await look(page, "read-beat-1280");
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });
}
