// Marks of a chart: what is drawn, hovered and chosen, from its columns.
import type { Chart, Num } from "../lib/types";
import { quantile, ticks } from "./dom";
import { abs, clamp, floor, known, max, min, sqrt } from "./maths";

export interface Mark { x: number; y: number; u: number; value: Num; group: number; name: string; to?: number /* right edge of a bin */ }

/** Quantile of the standard normal distribution. Source: Abramowitz and Stegun 26.2.23, error below 4.5e-4. */
export function normalQuantile(p: number): number {
  const t = sqrt(-2 * Math.log(min(p, 1 - p)));
  const z = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  return p < 0.5 ? -z : z;
}

/** Edges and counts of bins of a round width, by the rule of Freedman and Diaconis. */
export function bins(values: number[]): { edges: number[]; counts: number[] } {
  if (!values.length) return { edges: [0, 1], counts: [0] };
  const [low, high] = values.reduce(([a, b], v) => [min(a, v), max(b, v)], [Infinity, -Infinity]);
  const span = high - low || abs(low) || 1;
  const wide = (2 * (quantile(values, 0.75) - quantile(values, 0.25))) / Math.cbrt(values.length) || span / 10;
  const { step } = ticks(0, span, clamp(span / wide, 5, 60));
  const first = floor(low / step + 1e-9);
  const count = max(1, floor(high / step - first + 1e-9) + 1);
  const counts = Array<number>(count).fill(0);
  for (const v of values) counts[min(count - 1, max(0, floor(v / step - first + 1e-9)))]!++;
  return { edges: Array.from({ length: count + 1 }, (_, i) => (first + i) * step), counts };
}

/** Marks in drawing order. A line keeps marks of unknown value: it breaks there (y is NaN). */
export function marksOf(data: Chart): Mark[] {
  const xs = data.x.values ?? data.x.categories?.map((_, i) => i) ?? [];
  const ys = data.y?.values ?? [];
  const make = (row: number, x: number, y: number): Mark => ({
    x, y, u: data.u?.[row] ?? NaN, value: data.value?.values[row] ?? null, group: data.group?.[row] ?? 0, name: data.name?.[row] ?? "",
  });
  if (data.type === "histogram") {
    const { edges, counts } = bins(xs.filter(known));
    return counts.map((count, i) => ({ ...make(-1, edges[i]!, count), to: edges[i + 1]! }));
  }
  if (data.type === "normal") {
    const rows = xs.map((_, i) => i).filter((i) => known(xs[i])).sort((i, j) => xs[i]! - xs[j]!);
    return rows.map((row, i) => make(row, normalQuantile((i + 0.625) / (rows.length + 0.25)), xs[row]!));
  }
  const line = data.type === "line";
  // Marks of one category stand side by side, so that thousands are not one column.
  const many = data.type === "scatter" && data.x.categories && xs.length > 3 * data.x.categories.length;
  const marks: Mark[] = [];
  xs.forEach((x, row) => {
    const y = ys[row];
    if (!known(x)) return;
    if (known(y)) marks.push(make(row, many ? x + (((row * 0.618034) % 1) - 0.5) * 0.6 : x, y));
    else if (line) marks.push(make(row, x, NaN));
  });
  return marks;
}
