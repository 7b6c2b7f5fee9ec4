import { type BuildOptions, defineConfig } from "vite";

// While developing: `SERVICE=http://127.0.0.1:8080 npm run dev`.
const service = process.env["SERVICE"] ?? "http://127.0.0.1:8080";

// Script and style of reports are built by `vite build --mode report` into one file each, which the library embeds and
// writes into them.
const report: BuildOptions = {
  outDir: "../crates/ventriform/assets",
  target: "es2022",
  emptyOutDir: false,
  lib: {
    entry: "src/report.tsx",
    formats: ["iife"],
    name: "report",
    fileName: () => "report.js",
    cssFileName: "report",
  },
};

const esbuild = { jsx: "automatic", jsxImportSource: "preact", legalComments: "none" } as const;

export default defineConfig(({ mode }) =>
  mode === "report"
    ? { build: report, esbuild }
    : {
        // Files are named relative to the page and to each other: a proxy may show the service under a path.
        base: "./",
        esbuild,
        server: {
          proxy: { "/v1": service, "/examples": service, "/openapi.json": service, "/docs": service },
          fs: { allow: [".", "../crates/ventriform/assets"] },
        },
        build: {
          target: "es2022",
          assetsDir: "assets",
          // No inline data: the policy of the page names only files of the service.
          assetsInlineLimit: 0,
          modulePreload: { polyfill: false },
          reportCompressedSize: false,
          // Names without a hash: the service shows the files under a path with a hash of them all.
          rollupOptions: {
            output: {
              entryFileNames: "assets/[name].js",
              chunkFileNames: "assets/[name].js",
              assetFileNames: "assets/[name][extname]",
            },
          },
        },
      },
);
