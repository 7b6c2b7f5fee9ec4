// Pulling the contour: in the slices of a scan and of a comparison, kept in the result, taken back, repeated on the other
// scan.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";

const sub = (a, b) => a.map((part, n) => part - b[n]);
const dot = (a, b) => a.reduce((sum, part, n) => sum + part * b[n], 0);
const along = (a, way, by) => a.map((part, n) => part + by * way[n]);
const norm = a => Math.hypot(...a);
const unit = a => a.map(part => part / norm(a));
const cross = (a, b) => [0, 1, 2].map(n => a[(n + 1) % 3] * b[(n + 2) % 3] - a[(n + 2) % 3] * b[(n + 1) % 3]);

/** The middle of a heart's axis, and its lateral direction, as the page counts them. */
function lateralOf({ base, apex }, superior) {
  const axis = unit(sub(apex, base));
  const anterior = unit(along(superior, axis, -dot(superior, axis)));
  return { middle: base.map((part, n) => (part + apex[n]) / 2), lateral: cross(anterior, axis) };
}

/** How far a ray goes until it leaves the mesh for good, mm. */
function outermost({ vertices, triangles }, start, way) {
  const hits = triangles.map(corners => {
    const [p, q, r] = corners.map(at => vertices[at]);
    const [e, f, s] = [sub(q, p), sub(r, p), sub(start, p)];
    const h = cross(way, f);
    const [u, k] = [dot(s, h) / dot(e, h), cross(s, e)];
    const v = dot(way, k) / dot(e, h);
    return u >= 0 && v >= 0 && u + v <= 1 ? dot(f, k) / dot(e, h) : -Infinity;
  });
  return Math.max(...hits);
}

/** How far a place is from a mesh, mm. */
function distance({ vertices, triangles }, place) {
  const parts = 12;
  let least = Infinity;
  for (const corners of triangles) {
    const [p, q, r] = corners.map(at => vertices[at]);
    for (let i = 0; i <= parts; i++)
      for (let j = 0; i + j <= parts; j++)
        least = Math.min(least, norm(sub(place, along(along(p, sub(q, p), i / parts), sub(r, p), j / parts))));
  }
  return least;
}

/** Drags the mouse on a canvas. */
async function drag(page, canvas, from, to) {
  const box = await canvas.boundingBox();
  await page.mouse.move(box.x + from[0], box.y + from[1]);
  await page.mouse.down();
  await page.mouse.move(box.x + to[0], box.y + to[1], { steps: 5 });
  await page.mouse.up();
}

const cursorOf = canvas => canvas.evaluate(element => element.style.cursor);

export async function pulls({ PROGRAM, SCREENSHOTS, browser, service, tab, check, look, choose }) {
  const read = async path => (await fetch(path)).json();

  await check(
    "the contour is pulled: the fit goes through the point, and no more when the pull is removed",
    async () => {
      const own = await service();
      const newest = async () => {
        const [result] = (await read(`${own.address}/v1/segmentations`)).segmentations;
        const file = name => read(own.address + result.files.find(one => one.name === name).href);
        return { ...result, mesh: await file("mesh.json"), report: await file("report.json") };
      };
      for (const [name, width, dark] of [
        ["400-dark", 400, true],
        ["1440-light", 1440, false],
      ]) {
        const { page, faults, close } = await tab(browser, own.address, { width, height: 900, dark });
        await page.waitForSelector(".drop");
        if (width === 400) await choose(page, join(SCREENSHOTS, "phantom/spect.nii.gz"));
        else await page.locator(".scan .result").first().click();
        await page.waitForSelector(".polar canvas");
        const panel = page.getByRole("group", { name: "Correct by hand" });
        const told = panel.locator("> [role=status]");
        await page.getByRole("button", { name: "Correct by hand" }).click();
        const first = await newest();
        const { middle, lateral } = lateralOf(first.report.fit.long_axis, first.report.posture.superior);
        const edge = outermost(first.mesh, middle, lateral);
        const short = page.locator(".slice canvas").first();
        await short.scrollIntoViewIfNeeded();
        const box = await short.boundingBox();
        const factor = Math.min(box.width, box.height) / 140;
        const at = mm => [box.width / 2 + mm * factor, box.height / 2];
        await page.mouse.move(box.x + at(edge)[0], box.y + at(edge)[1]);
        assert.equal(await cursorOf(short), "grab", "the contour can be taken");
        await page.mouse.move(box.x + at(edge + 25)[0], box.y + at(edge + 25)[1]);
        assert.equal(await cursorOf(short), "");
        // A press that does not drag takes the cursor there.
        await short.click({ position: { x: at(edge)[0], y: at(edge)[1] } });
        assert.equal(await told.textContent(), "Nothing changed yet");
        await drag(page, short, at(edge), at(edge + 6));
        assert.equal(await told.textContent(), "Changed: contour");
        const list = panel.getByRole("list", { name: "Pulls of the contour" });
        assert.match(await list.textContent(), /^1: outer wall, [56]\.\d mm out/);
        await look(page, `pull-${name}`);
        // The point that was left is taken again.
        await drag(page, short, at(edge + 6), at(edge + 8));
        assert.match(await list.textContent(), /^1: outer wall, [78]\.\d mm out/);
        assert.equal(await list.locator("li").count(), 1);
        await panel.getByRole("button", { name: "Undo changes" }).click();
        assert.equal(await told.textContent(), "Nothing changed yet");
        assert.equal(await list.count(), 0);
        if (width === 400) {
          assert.deepEqual(faults, []);
          await close();
          continue;
        }
        await drag(page, short, at(edge), at(edge + 6));
        await page.getByRole("button", { name: "Fit from here" }).click();
        await page.waitForSelector(".choices .other");
        assert.match(await page.textContent(".choices .current"), /Corrected fit[^]*by hand: contour/);
        const pulled = await newest();
        const point = pulled.parameters.outer_through;
        assert.equal(point.length, 3, JSON.stringify(pulled.parameters));
        assert.equal(pulled.parameters.inner_through ?? null, null);
        assert.ok(norm(sub(point, along(middle, lateral, edge + 6))) < 1.5, "the point is where it was left");
        const [was, is] = [distance(first.mesh, point), distance(pulled.mesh, point)];
        console.log(`  the contour is ${was.toFixed(1)} mm from the point before, ${is.toFixed(2)} mm after the fit`);
        assert.ok(was > 4 && is < 1.5, `${was} and ${is}`);
        await page.waitForFunction(() =>
          /Nothing changed/.test(document.querySelector(".correction > [role=status]").textContent),
        );
        assert.match(await list.textContent(), /^1: outer wall, pulled before/);
        await look(page, "pulled-1440-light");
        // Another correction keeps it.
        const base = panel.locator("label", { hasText: "Base" }).locator("input");
        await base.fill(String(Number(await base.inputValue()) + 3));
        await base.press("Tab");
        await page.getByRole("button", { name: "Fit from here" }).click();
        const fits = async count =>
          page.waitForFunction(
            count =>
              document.querySelectorAll(".choices li").length === count &&
              /Nothing changed/.test(document.querySelector(".correction > [role=status]")?.textContent ?? ""),
            count,
          );
        await fits(3);
        assert.deepEqual((await newest()).parameters.outer_through, point);
        await list.getByRole("button", { name: /^Remove pull 1/ }).click();
        assert.equal(await told.textContent(), "Changed: contour");
        await page.getByRole("button", { name: "Fit from here" }).click();
        await fits(4);
        const without = await newest();
        assert.equal(without.parameters.outer_through ?? null, null);
        assert.ok(distance(without.mesh, point) > 3, "the wall is back where the image has it");
        // Without a pointer: to the cursor.
        await panel.getByRole("button", { name: /^Pull the (inner|outer) contour to the cursor/ }).click();
        assert.equal(await list.locator("li").count(), 1);
        await list.getByRole("button", { name: /^Remove pull 1/ }).click();
        assert.equal(await told.textContent(), "Nothing changed yet");
        // Points are of the apparent wall: the anatomical one is not pulled.
        await panel.getByLabel("Wall shown").selectOption("anatomical");
        await page.getByRole("button", { name: "Fit from here" }).click();
        await panel.getByText("can be pulled where the apparent wall is shown").waitFor();
        assert.equal(await panel.getByRole("button", { name: /contour to the cursor/ }).count(), 0);
        assert.deepEqual(faults, []);
        await close();
      }
      await own.stop();
    },
  );

  await check("the contour is pulled in a comparison, and repeated on the other scan", async () => {
    const own = await service();
    for (const [role, seed] of [
      ["stress", "4"],
      ["rest", "7"],
    ]) {
      const folder = join(SCREENSHOTS, `pull-${role}`);
      const made = spawnSync(PROGRAM, ["phantom", "-o", folder, "--size", "64", "--spacing", "5", "--seed", seed]);
      assert.equal(made.status, 0, String(made.stderr));
    }
    const body = new FormData();
    for (const role of ["stress", "rest"])
      body.append(role, new Blob([readFileSync(join(SCREENSHOTS, `pull-${role}`, "spect.nii.gz"))]), `${role}.nii.gz`);
    const answer = await fetch(`${own.address}/v1/comparisons`, {
      method: "POST",
      body,
      headers: { prefer: "wait=300" },
    });
    assert.equal(answer.status, 200, await answer.clone().text());
    const newest = async () => {
      const [result] = (await read(`${own.address}/v1/comparisons`)).comparisons;
      const file = name => read(own.address + result.files.find(one => one.name === name).href);
      return {
        ...result,
        report: await file("comparison.json"),
        meshes: { stress: await file("mesh_stress.json"), rest: await file("mesh_rest.json") },
      };
    };
    const first = await newest();
    const { stress } = first.report;
    const { page, faults, close } = await tab(browser, `${own.address}/#/comparison/${first.id}`, {
      width: 1920,
      height: 1080,
    });
    await page.waitForSelector(".compared-maps .polar canvas");
    await page.getByRole("button", { name: "Correct stress" }).click();
    const panel = page.getByRole("group", { name: "Correct stress by hand" });
    const slices = page.locator(".compared-slices");
    const box = await slices.boundingBox();
    const cell = Math.min((box.width - 52) / 8, (box.height - 3 * 19) / 6);
    const left = 52 + (box.width - 52 - 8 * cell) / 2;
    // The fourth slice of the short axis at stress, whose levels are those of `STANDARD_ROWS`.
    const { base, apex } = stress.long_axis;
    const level = apex.map((part, n) => part + (0.06 + (0.88 * 3) / 7) * (base[n] - part));
    const turned = -(first.report.turn_degrees * Math.PI) / 180;
    const { lateral } = lateralOf(stress.long_axis, stress.posture?.superior ?? [0, 0, 1]);
    const axis = unit(sub(apex, base));
    const aside = cross(axis, lateral);
    const right = lateral.map((part, n) => Math.cos(turned) * part - Math.sin(turned) * aside[n]);
    const edge = outermost(first.meshes.stress, level, right);
    const at = mm => [left + 3.5 * cell + (mm * cell) / 114.4, 19 + cell / 2];
    await drag(page, slices, at(edge), at(edge + 6));
    assert.match(await panel.getByRole("list").first().textContent(), /^1: outer wall, [567]\.\d mm out/);
    await panel.getByRole("button", { name: "Repeat on the scan at rest" }).click();
    const beside = panel.getByRole("region", { name: "Pulls at rest" });
    assert.match(await beside.textContent(), /1: outer wall, \d+\.\d mm (out|in)/);
    assert.ok(await panel.getByRole("button", { name: "Repeat on the scan at rest" }).isDisabled(), "only once");
    await look(page, "pull-comparison-1920");
    await panel.getByRole("button", { name: "Fit and compare again" }).click();
    await page.waitForFunction(id => /cmp_/.test(location.hash) && !location.hash.includes(id), first.id);
    await page.waitForSelector(".compared-maps .polar canvas");
    const again = await newest();
    assert.match(await page.textContent(".comparison header"), /corrected by hand: outer contour[^]*outer contour/);
    for (const scan of ["stress", "rest"]) {
      const point = again.parameters[`${scan}_outer_through`];
      assert.equal(point?.length, 3, `${scan}: ${JSON.stringify(again.parameters)}`);
      const off = distance(again.meshes[scan], point);
      console.log(`  ${scan}: the contour is ${off.toFixed(2)} mm from the point`);
      assert.ok(off < 1.5, `${scan}: ${off}`);
    }
    await look(page, "pulled-comparison-1920");
    assert.deepEqual(faults, []);
    await close();
    await own.stop();
  });
}
