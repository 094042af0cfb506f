import { defineConfig } from "vite";

// The script and style of reports: one file each, put into every report by the writers.
export default defineConfig({
  publicDir: false,
  build: {
    outDir: "../src/catseye/gateways/writers/static",
    emptyOutDir: true,
    target: "es2022",
    cssTarget: ["chrome120", "firefox117", "safari17.2"], // nested rules stay nested, which is shorter
    lib: { entry: "src/report.ts", formats: ["iife"], name: "catseyeReport", fileName: () => "report.js", cssFileName: "report" },
  },
});
