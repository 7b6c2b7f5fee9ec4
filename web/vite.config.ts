import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { type BuildOptions, defineConfig } from "vite";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";

// While developing: `SERVICE=http://127.0.0.1:8080 npm run dev`.
const service = process.env["SERVICE"] ?? "http://127.0.0.1:8080";

// Script and style of reports are built by `vite build --mode report` into one file each, which the library embeds and
// writes into them.
const report: BuildOptions = {
  outDir: "../crates/ventriform/assets",
  target: "es2022",
  emptyOutDir: false,
  lib: { entry: "src/report.tsx", formats: ["iife"], name: "report", fileName: () => "report.js", cssFileName: "report" },
};

const esbuild = { jsx: "automatic", jsxImportSource: "preact", legalComments: "none" } as const;

export default defineConfig(({ mode }) => (mode === "report" ? { build: report, esbuild } : {
  // Files are named relative to the page and to each other: a proxy may show the service under a path.
  base: "./",
  esbuild,
  server: { proxy: { "/v1": service, "/openapi.json": service, "/docs": service }, fs: { allow: [".", "../crates/ventriform/assets"] } },
  build: {
    target: "es2022",
    assetsDir: "assets",
    // No inline data: the policy of the page names only files of the service.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
  },
  plugins: [
    {
      // Every file is committed beside its compressed forms, so the service compresses nothing. They are made of the files as
      // they were written: other plugins still change the bundle while it is generated.
      name: "compress",
      writeBundle({ dir }, bundle) {
        for (const name of Object.keys(bundle)) {
          const path = join(dir ?? "dist", name);
          const source = readFileSync(path);
          const level = { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } };
          writeFileSync(`${path}.br`, brotliCompressSync(source, level));
          writeFileSync(`${path}.gz`, gzipSync(source, { level: 9 }));
        }
      },
    },
  ],
}));
