// Every page: its word in the address, its title, where it stands in the navigation, its key after "g".
import type { Component } from "svelte";

export type ServiceKind = "site" | "journal" | "result";
export interface Page {
  name: string;
  title: string;
  key: string; // "" for pages that are reached from others only
  group: "watch" | "measure" | "record" | "detail" | "self";
  kinds: ServiceKind[];
  load: () => Promise<{ default: Component }>;
}

const SITE: ServiceKind[] = ["site", "journal"];

export const pages: Page[] = [
  { name: "overview", title: "Overview", key: "o", group: "watch", kinds: SITE, load: () => import("./pages/Overview.svelte") },
  { name: "alarms", title: "Alarms", key: "a", group: "watch", kinds: SITE, load: () => import("./pages/Alarms.svelte") },
  { name: "commands", title: "Commands", key: "m", group: "watch", kinds: ["site"], load: () => import("./pages/Commands.svelte") },
  { name: "parameters", title: "Parameters", key: "v", group: "watch", kinds: ["site"], load: () => import("./pages/Parameters.svelte") },
  { name: "health", title: "Health", key: "h", group: "watch", kinds: ["site"], load: () => import("./pages/Health.svelte") },
  { name: "events", title: "Events", key: "e", group: "watch", kinds: SITE, load: () => import("./pages/Events.svelte") },
  { name: "network", title: "Network", key: "n", group: "measure", kinds: SITE, load: () => import("./pages/Network.svelte") },
  { name: "strips", title: "Strip charts", key: "s", group: "measure", kinds: SITE, load: () => import("./pages/Strips.svelte") },
  { name: "dish", title: "Dish", key: "d", group: "measure", kinds: SITE, load: () => import("./pages/Dish.svelte") },
  { name: "corrections", title: "Corrections", key: "x", group: "measure", kinds: SITE, load: () => import("./pages/Corrections.svelte") },
  { name: "residuals", title: "Residuals", key: "r", group: "measure", kinds: SITE, load: () => import("./pages/Residuals.svelte") },
  { name: "comparison", title: "Comparison", key: "c", group: "measure", kinds: SITE, load: () => import("./pages/Comparison.svelte") },
  { name: "air", title: "Air", key: "i", group: "measure", kinds: SITE, load: () => import("./pages/Air.svelte") },
  { name: "calibrations", title: "Calibrations", key: "k", group: "record", kinds: SITE, load: () => import("./pages/Calibrations.svelte") },
  { name: "replay", title: "Replay", key: "p", group: "record", kinds: SITE, load: () => import("./pages/Replay.svelte") },
  { name: "result", title: "Result", key: "u", group: "record", kinds: ["result"], load: () => import("./pages/Result.svelte") },
  { name: "ranger", title: "Ranger", key: "z", group: "detail", kinds: SITE, load: () => import("./pages/Ranger.svelte") },
  { name: "shot", title: "Shot", key: "", group: "detail", kinds: SITE, load: () => import("./pages/Shot.svelte") },
  { name: "point", title: "Point", key: "", group: "detail", kinds: SITE, load: () => import("./pages/Point.svelte") },
  { name: "settings", title: "Settings", key: "t", group: "self", kinds: ["site", "journal", "result"], load: () => import("./pages/Settings.svelte") },
];

export function home(kind: ServiceKind | null): string {
  return kind === "result" ? "result" : "overview";
}
