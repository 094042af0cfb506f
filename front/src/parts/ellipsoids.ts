// 95 % ellipsoids of points: matrices of the unit sphere, their enlargement, which are capped or unknown.
import type { Scene } from "../lib/types";
import { quantile } from "./dom";
import { eigen } from "./eigen";
import { floor, log10, max, min, sqrt } from "./maths";

/** Radius of the 95 % ellipsoid in standard deviations: root of the chi-square quantile 7.8147 of 3 degrees of freedom. */
export const RADIUS = 2.7955;
const CAP = 8; // medians above which an ellipsoid is drawn smaller
const FLOOR = 0.02; // medians below which an axis is not drawn

export interface Ellipsoids {
  matrices: Float32Array; // n x 9: columns of the unit sphere's matrix, m, enlarged
  size: Float32Array; // mean half axis, m, enlarged; 0: undetermined
  axes: number[]; // longest half axis of the 95 % ellipsoid, m, true; NaN: undetermined
  capped: Uint8Array;
  known: boolean; // whether the scene has covariances
  factor: number; // enlargement: 1, 2 or 5 times a power of ten
}

/** Enlargement that makes the median ellipsoid well seen and not larger than the distance of neighbours. */
export function enlargement(median: number, extent: number, count: number): number {
  const raw = (extent * min(0.014, 0.3 / sqrt(max(count, 1)))) / median;
  if (!(raw > 0) || !Number.isFinite(raw)) return 1;
  const power = 10 ** floor(log10(raw) + 1e-9);
  return power * ([5, 2, 1].find((f) => f * power <= raw * (1 + 1e-9)) ?? 1);
}

export function ellipsoids(points: Scene["points"], extent: number): Ellipsoids {
  const n = points.name.length;
  const c = points.covariance;
  const result: Ellipsoids = { matrices: new Float32Array(9 * n), size: new Float32Array(n), axes: Array<number>(n).fill(NaN), capped: new Uint8Array(n), known: !!c, factor: 1 };
  if (!c) return result;
  const solved: (ReturnType<typeof eigen> | null)[] = [];
  for (let i = 0; i < n; i++) {
    const m = [c.xx[i], c.xy[i], c.xz[i], c.yy[i], c.yz[i], c.zz[i]];
    const solution = m.every((v): v is number => typeof v === "number" && Number.isFinite(v)) ? eigen(m) : null;
    solved.push(solution);
    if (solution) result.axes[i] = RADIUS * sqrt(max(...solution.values, 0));
  }
  const median = quantile(result.axes.filter((a) => a > 0), 0.5);
  if (!(median > 0)) return result;
  result.factor = enlargement(median, extent, n);
  solved.forEach((solution, i) => {
    if (!solution) return;
    const longest = result.axes[i]!;
    const shrink = longest > CAP * median ? (CAP * median) / longest : 1;
    result.capped[i] = shrink < 1 ? 1 : 0;
    const half = solution.values.map((v) => max(RADIUS * sqrt(max(v, 0)) * shrink, FLOOR * median) * result.factor);
    solution.vectors.forEach((axis, k) => result.matrices.set(axis.map((e) => e * half[k]!), 9 * i + 3 * k));
    result.size[i] = (half[0]! + half[1]! + half[2]!) / 3;
  });
  return result;
}
