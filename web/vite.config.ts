import { defineConfig } from "vite";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";

// While developing: `SERVICE=http://127.0.0.1:8080 npm run dev`.
const service = process.env["SERVICE"] ?? "http://127.0.0.1:8080";

export default defineConfig({
  base: "/",
  esbuild: { jsx: "automatic", jsxImportSource: "preact", legalComments: "none" },
  server: { proxy: { "/v1": service, "/openapi.json": service, "/docs": service } },
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
      // Every file is committed beside its compressed forms, so the service compresses nothing.
      name: "compress",
      enforce: "post",
      generateBundle(_options, bundle) {
        for (const [name, file] of Object.entries(bundle)) {
          const source = Buffer.from(file.type === "asset" ? file.source : file.code);
          const level = { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } };
          this.emitFile({ type: "asset", fileName: `${name}.br`, source: brotliCompressSync(source, level) });
          this.emitFile({ type: "asset", fileName: `${name}.gz`, source: gzipSync(source, { level: 9 }) });
        }
      },
    },
  ],
});
