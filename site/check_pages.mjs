// Every page of the site in Chromium: nothing is asked of another host, no script fails, and the search finds what it
// should, from a web server and from the disk.
//
//   node check_pages.mjs FOLDER       CHROMIUM: the browser
import { createReadStream, existsSync, readdirSync } from "node:fs";
import http from "node:http";
import { extname, join, relative, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import assert from "node:assert/strict";
import { chromium } from "playwright-core";

const folder = resolve(process.argv[2]);
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json", ".svg": "image/svg+xml", ".png": "image/png" };
/** What somebody looks for, and a page where it stands. */
const SOUGHT = [
  ["polar map", "command-line.html"],
  ["pickle", "python.html"],
  ["/v1/segmentations", "http-api.html"],
  ["build_normals", "python-reference.html"],
  ["storescu", "pacs.html"],
];

const server = http.createServer((request, response) => {
  const path = join(folder, decodeURIComponent(new URL(request.url, "http://x").pathname));
  if (!path.startsWith(folder) || !existsSync(path) || !extname(path)) return response.writeHead(404).end();
  response.writeHead(200, { "content-type": TYPES[extname(path)] ?? "application/octet-stream" });
  createReadStream(path).pipe(response);
});
await new Promise(done => server.listen(0, "127.0.0.1", done));
const address = `http://127.0.0.1:${server.address().port}/`;

const pages = readdirSync(folder, { recursive: true }).filter(path => path.endsWith(".html")).sort();
assert(pages.length > 20, `only ${pages.length} pages`);
const faults = [];
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });

async function tab(base) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  const told = text => faults.push(`${relative(base, page.url())}: ${text}`);
  page.on("request", request => {
    if (!request.url().startsWith(base) && !/^(data|blob):/.test(request.url())) told(`asks for ${request.url()}`);
  });
  page.on("console", message => message.type() === "error" && told(message.text()));
  page.on("pageerror", error => told(error.message));
  page.on("response", response => response.status() >= 400 && told(`${response.status()} ${response.url()}`));
  return page;
}

async function search(page, index, place) {
  for (const [words, wanted] of SOUGHT) {
    await page.goto(`${index}?q=${encodeURIComponent(words)}`);
    const result = page.locator(`.md-search-result a[href*="${wanted}"]`).first();
    await result.waitFor({ state: "attached", timeout: 20_000 }).catch(() => faults.push(`${place}: the search for "${words}" does not find ${wanted}`));
  }
}

const served = await tab(address);
for (const path of pages) {
  await served.goto(address + path, { waitUntil: "load" });
  if (path.endsWith("http-api.html")) {
    const operation = served.locator("details", { hasText: "Download one of a model's files" });
    await operation.locator("summary").click();
    await operation.getByText("distance.json").first().waitFor({ timeout: 20_000 });
  }
}
await search(served, `${address}index.html`, "from a server");

const base = `${pathToFileURL(folder)}/`;
const opened = await tab(base);
await search(opened, `${base}index.html`, "from the disk");

await browser.close();
server.close();
faults.forEach(fault => console.log(fault));
console.log(`${pages.length} pages, ${2 * SOUGHT.length} searches; ${faults.length} faults`);
process.exit(faults.length ? 1 : 0);
