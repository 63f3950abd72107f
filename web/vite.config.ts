import { defineConfig } from "vite";

// The built page is part of the Python package; it refers to nothing outside of its own server.
export default defineConfig({
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
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
