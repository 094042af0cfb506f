// Residuals of an epoch as charts and as a table, the worst first.
import type { Chart, Num, Table } from "../../lib/types";
import type { Residuals } from "../answers";
import { known, number, text, times } from "./columns";

export type Scale = "w" | "mm";
export interface Chosen { scale: Scale; ranger: string; target: string }

/** Rows of one ranger or target, or of all. */
export function filtered(r: Residuals, { ranger, target }: Chosen): Residuals {
  if (!ranger && !target) return r;
  const rows = r.shot.map((_, i) => i).filter((i) => (!ranger || r.ranger[i] === ranger) && (!target || r.target[i] === target));
  const pick = <T>(column: T[]): T[] => rows.map((i) => column[i] as T);
  return { shot: pick(r.shot), ranger: pick(r.ranger), target: pick(r.target), mjd: pick(r.mjd), elevation: pick(r.elevation), residual: pick(r.residual), u: pick(r.u), w: pick(r.w), status: pick(r.status), ...(r.by ? { by: r.by } : {}) };
}

export function values(r: Residuals, scale: Scale): { label: string; unit: string; values: Num[] } {
  return scale === "w" ? { label: "residual w", unit: "", values: r.w } : { label: "residual", unit: "mm", values: times(r.residual, 1000) };
}

const LIMITS = [-3, 3];

export function residualCharts(r: Residuals, scale: Scale): { key: string; title: string; chart: Chart; note: string }[] {
  const y = values(r, scale), name = r.shot.map(String), limits = scale === "w" ? LIMITS : undefined;
  const categories = (column: string[]): Chart["x"] => {
    const words = [...new Set(column)].sort(new Intl.Collator("en", { numeric: true }).compare), place = new Map(words.map((w, i) => [w, i]));
    return { label: "", unit: "", values: column.map((w) => place.get(w) ?? null), categories: words };
  };
  const start = r.mjd.find(known) ?? 0;
  const first = r.mjd.reduce((a: number, b) => (known(b) && b < a ? b : a), start);
  const GOOD = ["used", "ok"], words = [...new Set(r.status)].sort((a, b) => Number(GOOD.includes(b)) - Number(GOOD.includes(a)) || a.localeCompare(b)), shows = words.length > 1 && words.length <= 8;
  const scatter = (x: Chart["x"]): Chart => ({
    type: "scatter", x, y, name, ...(limits ? { limits } : {}),
    ...(shows ? { groups: words, group: r.status.map((s) => words.indexOf(s)) } : {}),
  });
  const many = new Set(r.target).size > 60;
  return [
    { key: "ranger", title: "By ranger", note: "", chart: scatter({ ...categories(r.ranger), label: "ranger" }) },
    { key: "target", title: "By target", note: many ? "Targets in the order of their names; the table has them." : "", chart: scatter(many ? { label: "target", unit: "", values: categories(r.target).values ?? [] } : { ...categories(r.target), label: "target" }) },
    { key: "elevation", title: "By elevation of the beam", note: "", chart: scatter({ label: "elevation", unit: "°", values: times(r.elevation, 180 / Math.PI) }) },
    { key: "time", title: "By time", note: "", chart: scatter({ label: "time since the first shot", unit: "s", values: r.mjd.map((t) => (known(t) ? (t - first) * 86400 : null)) }) },
    { key: "histogram", title: "Histogram", note: "", chart: { type: "histogram", x: y, ...(limits ? { limits } : {}) } },
    { key: "normal", title: "Normal plot", note: "Points on the line are normal; a bend at the ends is a heavy tail.", chart: { type: "normal", x: y, name } },
  ];
}

export function residualTable(r: Residuals): Table {
  const size = (i: number): number => (known(r.w[i]) ? Math.abs(r.w[i] ?? 0) : -1);
  const rows = r.shot.map((_, i) => i).sort((a, b) => size(b) - size(a));
  const pick = <T>(column: T[]): T[] => rows.map((i) => column[i] as T);
  return {
    name: "shot",
    columns: [
      { ...number("shot", "shot", "", pick(r.shot), { digits: 0 }) }, text("ranger", "ranger", pick(r.ranger)), text("target", "target", pick(r.target)),
      number("w", "w", "", pick(r.w), { digits: 2 }), number("residual", "residual", "mm", times(pick(r.residual), 1000), { u: "u" }),
      number("u", "u", "mm", times(pick(r.u), 1000), { digits: 3 }), number("elevation", "elevation", "°", times(pick(r.elevation), 180 / Math.PI), { digits: 1 }),
      text("status", "status", pick(r.status)),
    ],
  };
}

/** Root mean square, and shares beyond 2 and 3, of w. */
export function spread(w: Num[]): { rms: Num; two: Num; three: Num } {
  const own = w.filter(known);
  if (!own.length) return { rms: null, two: null, three: null };
  const share = (limit: number): number => (100 * own.filter((v) => Math.abs(v) > limit).length) / own.length;
  return { rms: Math.sqrt(own.reduce((sum, v) => sum + v * v, 0) / own.length), two: share(2), three: share(3) };
}
