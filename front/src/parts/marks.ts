// Marks of a chart: what is drawn, hovered and chosen, from its columns.
import type { Chart, Num } from "../lib/types";
import { quantile, ticks } from "./dom";

export interface Mark { x: number; y: number; u: number; value: Num; group: number; name: string; row: number; to?: number /* right edge of a bin */ }

const finite = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);

/** Quantile of the standard normal distribution. Source: Abramowitz and Stegun 26.2.23, error below 4.5e-4. */
export function normalQuantile(p: number): number {
  const t = Math.sqrt(-2 * Math.log(Math.min(p, 1 - p)));
  const z = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  return p < 0.5 ? -z : z;
}

/** Edges and counts of bins of a round width, by the rule of Freedman and Diaconis. */
export function bins(values: number[]): { edges: number[]; counts: number[] } {
  if (!values.length) return { edges: [0, 1], counts: [0] };
  const [low, high] = values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
  const span = high - low || Math.abs(low) || 1;
  const wide = (2 * (quantile(values, 0.75) - quantile(values, 0.25))) / Math.cbrt(values.length) || span / 10;
  const { step } = ticks(0, span, Math.min(Math.max(span / wide, 5), 60));
  const first = Math.floor(low / step + 1e-9);
  const count = Math.max(1, Math.floor(high / step - first + 1e-9) + 1);
  const counts = Array<number>(count).fill(0);
  for (const v of values) counts[Math.min(count - 1, Math.max(0, Math.floor(v / step - first + 1e-9)))]!++;
  return { edges: Array.from({ length: count + 1 }, (_, i) => (first + i) * step), counts };
}

/** Marks in drawing order. A line keeps marks of unknown value: it breaks there (y is NaN). */
export function marksOf(data: Chart): Mark[] {
  const xs = data.x.values ?? data.x.categories?.map((_, i) => i) ?? [];
  const ys = data.y?.values ?? [];
  const make = (row: number, x: number, y: number): Mark => ({
    x, y, row, u: data.u?.[row] ?? NaN, value: data.value?.values[row] ?? null, group: data.group?.[row] ?? 0, name: data.name?.[row] ?? "",
  });
  if (data.type === "histogram") {
    const { edges, counts } = bins(xs.filter(finite));
    return counts.map((count, i) => ({ ...make(-1, edges[i]!, count), to: edges[i + 1]! }));
  }
  if (data.type === "normal") {
    const rows = xs.map((_, i) => i).filter((i) => finite(xs[i])).sort((i, j) => xs[i]! - xs[j]!);
    return rows.map((row, i) => make(row, normalQuantile((i + 0.625) / (rows.length + 0.25)), xs[row]!));
  }
  const line = data.type === "line";
  // Marks of one category stand side by side, so that thousands are not one column.
  const many = data.type === "scatter" && data.x.categories && xs.length > 3 * data.x.categories.length;
  const marks: Mark[] = [];
  xs.forEach((x, row) => {
    const y = ys[row];
    if (!finite(x)) return;
    if (finite(y)) marks.push(make(row, many ? x + (((row * 0.618034) % 1) - 0.5) * 0.6 : x, y));
    else if (line) marks.push(make(row, x, NaN));
  });
  return marks;
}
