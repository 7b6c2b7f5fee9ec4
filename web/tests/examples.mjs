// Examples on the page: simulated scans for those who have none at hand.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";

export async function examples({ PROGRAM, browser, service, tab, check, look }) {
  const example = (page, name) => page.getByRole("button", { name, exact: true });
  const compared = async page => {
    await page.waitForSelector(".compared-maps .polar canvas");
    await page.waitForSelector(".heart-wall canvas");
  };

  await check(
    "an example leads from an empty list to a fit, a comparison and a beat, marked as simulated",
    async () => {
      const own = await service();
      const { page, faults, close } = await tab(browser, own.address);
      await page.waitForSelector(".welcome");
      await look(page, "examples-empty-1280");
      // One press.
      await example(page, "A scan").click();
      await page.waitForSelector(".polar canvas");
      await page.waitForSelector(".wall canvas");
      assert.match(await page.textContent(".figures"), /Cavity90 %: \d+ to \d+.ml/);
      assert.equal(await page.textContent(".side header .simulated"), "simulated");
      await look(page, "example-fit-1280");

      await page.goto(`${own.address}/#/`);
      await page.locator(".study-head .simulated").waitFor();
      assert.ok(!(await example(page, "Stress and rest").isVisible()), "folded where there are scans");
      await page.getByText("Try an example").click();
      await look(page, "examples-1280");
      await example(page, "Stress and rest").click();
      await page.waitForFunction(() => document.querySelectorAll(".tools button:disabled").length === 3);
      // Nothing is asked.
      await compared(page);
      assert.equal(await page.locator(".pair-form").count(), 0);
      assert.equal(await page.textContent(".comparison header .simulated"), "simulated");
      const id = await page.evaluate(() => location.hash.split("/").pop());
      const report = await (await fetch(`${own.address}/v1/comparisons/${id}/report`)).json();
      assert.ok(report.reversible_percent > 10 && report.fixed_percent < 3, `${report.reversible_percent} %`);
      const shown = await page.textContent(".compared-headlines");
      assert.ok(shown.includes(`Reversible${report.reversible_percent.toFixed(0)}`), shown);
      assert.match(await page.textContent(".verdict"), /% of the wall is reversible/);
      // Initials are spelled out.
      assert.match(await page.locator("dt", { hasText: "TID" }).getAttribute("title"), /ischaemic dilation/);
      await page.getByRole("button", { name: "Fit the beats" }).click();
      await page.waitForSelector(".compared-beat .volumes");
      await look(page, "example-comparison-1280");
      assert.deepEqual(faults, []);
      await close();

      for (const dark of [false, true]) {
        const { page, faults, close } = await tab(browser, own.address, { width: 390, dark });
        await page.waitForFunction(() => document.querySelectorAll(".study-head .simulated").length >= 2);
        await page.locator("abbr[title*='summed'], abbr[title*='dilation']").first().waitFor();
        await page.getByText("Try an example").click();
        await look(page, `examples-390-${dark ? "dark" : "light"}`);
        if (dark) {
          await example(page, "A gated scan").press("Enter");
          await page.waitForSelector(".beat-chart");
          await look(page, "example-beat-390-dark");
        }
        assert.deepEqual(faults, []);
        await close();
      }
      await own.stop();
    },
  );

  await check("an example that does not come, or may not be stored, is told as other files are", async () => {
    const closed = await service();
    const keys = (...words) =>
      spawnSync(PROGRAM, ["keys", ...words, "--data-dir", closed.data], { encoding: "utf8" }).stdout;
    const key = /vf_\S+|[A-Za-z0-9_-]{30,}/.exec(keys("create", "--name", "reader", "--scope", "read"))[0];
    const { page, faults, close } = await tab(browser, closed.address, { expected: [/status of (401|403|503)/] });
    await page.waitForSelector(".sign-in");
    await page.fill(".sign-in input", key);
    await page.keyboard.press("Enter");
    await page.waitForSelector(".welcome");
    const body = { type: "about:blank", title: "", status: 503, detail: "The service is being restarted." };
    await page.route(/examples\/gated/, route => route.fulfill({ status: 503, json: body }));
    await example(page, "A gated scan").click();
    await page.locator(".welcome .error", { hasText: "being restarted" }).waitFor();
    await example(page, "A scan").click();
    await page.waitForSelector(".uploads .refused .error");
    assert.match(await page.textContent(".uploads .name"), /simulated-scan\.dcm/);
    assert.ok(await example(page, "A scan").isEnabled());
    await look(page, "example-refused-1280");
    assert.deepEqual(faults, []);
    await close();
    await closed.stop();
  });
}
