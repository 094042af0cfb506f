import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

// The dashboard. Names without hashes: the files are committed, and the server says when they changed (ETag).
export default defineConfig({
  plugins: [svelte()],
  base: "/",
  build: {
    outDir: "../src/catseye/web/static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false, // its loader would be an inline script
    assetsInlineLimit: 0, // nor any data: address
    rollupOptions: {
      output: {
        entryFileNames: "assets/[name].js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
      },
    },
  },
  server: { proxy: { "/api": { target: "http://127.0.0.1:5261", ws: true }, "/metrics": "http://127.0.0.1:5261" } },
});
