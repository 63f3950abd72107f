import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { defineConfig } from "vite";

/** Of all that the page is built from, so that a test can tell a build that is older: `tests/darkroom/test_built.py`. */
function sources(): string {
  const inside = (folder: string) => readdirSync(folder, { recursive: true, withFileTypes: true });
  const files = ["src", "public"].flatMap(inside).filter((entry) => entry.isFile());
  const names = files.map((entry) => `${entry.parentPath}/${entry.name}`);
  const hash = createHash("sha256");
  for (const name of [...names, "index.html", "package-lock.json", "vite.config.ts"].sort())
    hash.update(`${name}\n`).update(readFileSync(name));
  return hash.digest("hex");
}

// The built page is part of the Python package; it refers to nothing outside of its own server.
export default defineConfig({
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  plugins: [
    {
      name: "sources",
      generateBundle() {
        this.emitFile({ type: "asset", fileName: "sources.sha256", source: sources() });
      },
    },
  ],
  build: {
    outDir: "../src/materialist/darkroom/static",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rollupOptions: {
      output: {
        // Names without hashes of content keep the history of the repository small.
        entryFileNames: "assets/darkroom.js",
        assetFileNames: "assets/[name][extname]",
      },
    },
  },
});
