// Series of the service as strips: one strip for each quantity and unit, and what is downloaded of them.
import { utc } from "../../lib/time";
import type { Num, Table } from "../../lib/types";
import type { Mark, StripSeries } from "../../parts/strip";
import type { Dropped, Events, Series } from "../answers";
import { number, text } from "./columns";

export interface Panel { key: string; label: string; unit: string; series: StripSeries[] }

const QUANTITIES: Record<string, string> = {
  range: "Range", correction: "Misfit", amplitude: "Amplitude", temperature: "Air temperature", pressure: "Air pressure", humidity: "Relative humidity",
  azimuth: "Azimuth", elevation: "Elevation", refractivity: "Refractivity", variance_factor: "Variance factor", point: "Coordinate", zero: "Zero",
};
export const quantity = (name: string): string => name.split(":")[0] ?? name;
export const title = (kind: string): string => QUANTITIES[kind] ?? kind;

/** Whole lengths have strips of their own: two ranges share no scale that shows their changes. */
const panelKey = (name: string): string => (/^(range|point):/.test(name) ? name : quantity(name));

export function panels(series: Series["names"]): Panel[] {
  const held = new Map<string, Panel>();
  for (const s of series) {
    const key = panelKey(s.name);
    const alone = key === s.name && s.name.includes(":");
    const panel = held.get(key) ?? { key, label: alone ? s.name.split(":").slice(1).join(" ") : title(quantity(s.name)), unit: s.unit, series: [] };
    panel.series.push({ name: s.name, label: s.label, mjd: s.mjd, value: s.value, u: s.u, low: s.low, high: s.high });
    held.set(key, panel);
  }
  return [...held.values()];
}

/** Answer to a request since the last value, put behind what was there before and not older than `since`. */
export function appended(before: Series, after: Series, since: number): Series {
  const names = before.names.map((s) => {
    const more = after.names.find((n) => n.name === s.name);
    const last = s.mjd.at(-1) ?? -Infinity;
    const old = s.mjd.findIndex((t) => t >= since), fresh = more ? more.mjd.findIndex((t) => t > last) : -1;
    const join = <T>(a: T[], b: T[] | undefined): T[] => [...(old < 0 ? [] : a.slice(old)), ...(fresh < 0 || !b ? [] : b.slice(fresh))];
    const extremes = s.low !== null || (fresh >= 0 && more?.low != null);
    return {
      ...s, mjd: join(s.mjd, more?.mjd), value: join(s.value, more?.value),
      u: s.u && (!more || more.u) ? join(s.u, more?.u ?? undefined) : null,
      low: extremes ? join(s.low ?? s.value, more?.low ?? more?.value) : null,
      high: extremes ? join(s.high ?? s.value, more?.high ?? more?.value) : null,
    };
  });
  return { names, gaps: after.gaps || before.gaps };
}

export function marks(events: Events | null, epochs: { mjd: number; number: number }[]): Mark[] {
  const own: Mark[] = (events?.mjd ?? []).map((mjd, i) => {
    const severity = events?.severity[i] ?? "";
    const kind = /alarm|critical|error|failed/i.test(severity) ? "alarm" : /warn|doubtful/i.test(severity) ? "warning" : "event";
    return { mjd, kind, text: `${events?.who[i] ?? ""}: ${events?.text[i] ?? ""}` };
  });
  return [...own, ...epochs.map((e): Mark => ({ mjd: e.mjd, kind: "epoch", text: `epoch ${e.number}` }))].sort((a, b) => a.mjd - b.mjd);
}

/** All values within a span, a row each. */
export function seriesTable(series: Series["names"], [since, until]: [number, number]): Table {
  const columns: { [key: string]: (Num | string)[] } = { name: [], mjd: [], utc: [], value: [], unit: [], u: [], low: [], high: [] };
  for (const s of series)
    s.mjd.forEach((mjd, i) => {
      if (mjd < since || mjd > until) return;
      const row = { name: s.name, mjd, utc: utc(mjd, "full"), value: s.value[i] ?? null, unit: s.unit, u: s.u?.[i] ?? null, low: s.low?.[i] ?? null, high: s.high?.[i] ?? null };
      for (const [key, value] of Object.entries(row)) columns[key]?.push(value);
    });
  const of = (key: string): Num[] => columns[key] as Num[], words = (key: string): string[] => columns[key] as string[];
  return { columns: [text("name", "series", words("name")), number("mjd", "MJD", "d", of("mjd")), text("utc", "UTC", words("utc")), number("value", "value", "", of("value")), text("unit", "unit", words("unit")), number("u", "u", "", of("u")), number("low", "least in bin", "", of("low")), number("high", "most in bin", "", of("high"))] };
}

export function droppedTable(map: Dropped): Table {
  const sums = (rows: number[][]): number[] => map.rangers.map((_, k) => (rows[k] ?? []).reduce((a, b) => a + b, 0));
  const good = sums(map.good), failed = sums(map.failed);
  return {
    name: "ranger",
    columns: [text("ranger", "ranger", map.rangers), number("good", "good shots", "", good, { digits: 0 }), number("failed", "failed", "", failed, { digits: 0 }), number("share", "failed", "%", good.map((g, k) => (g + (failed[k] ?? 0) ? (100 * (failed[k] ?? 0)) / (g + (failed[k] ?? 0)) : null)), { digits: 1 })],
  };
}

/** Canvases one below the other, each with a line of text above it, on a ground of one colour. */
export function stacked(parts: { title: string; canvas: HTMLCanvasElement }[], ground: string, ink: string): HTMLCanvasElement {
  const ratio = devicePixelRatio || 1, head = Math.round(22 * ratio), sheet = document.createElement("canvas");
  sheet.width = Math.max(1, ...parts.map((p) => p.canvas.width));
  sheet.height = Math.max(1, parts.reduce((sum, p) => sum + head + p.canvas.height, 0));
  const pen = sheet.getContext("2d");
  if (!pen) return sheet;
  pen.fillStyle = ground;
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.font = `${Math.round(12 * ratio)}px system-ui, sans-serif`;
  let y = 0;
  for (const p of parts) {
    pen.fillStyle = ink;
    pen.fillText(p.title, 6 * ratio, y + 0.7 * head);
    pen.drawImage(p.canvas, 0, y + head);
    y += head + p.canvas.height;
  }
  return sheet;
}
