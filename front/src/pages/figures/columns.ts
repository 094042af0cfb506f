// Columns of tables, and the small sums over columns that several pages need.
import type { Column, Num } from "../../lib/types";
import { fixed } from "../../parts/number";
import type { Covariance } from "../answers";

export const number = (key: string, label: string, unit: string, values: Num[], more: Partial<Column> = {}): Column => ({ key, label, unit, kind: "number", values, ...more });
export const text = (key: string, label: string, values: string[], kind: "text" | "long" | "hash" = "text"): Column => ({ key, label, unit: "", kind, values });

/** Key of the variance of an axis in a covariance. */
export const VARIANCE = { x: "xx", y: "yy", z: "zz" } as const;

export const times = (values: Num[], factor: number): Num[] => values.map((v) => (v === null ? null : v * factor));
export const known = (value: Num | undefined): value is number => typeof value === "number" && Number.isFinite(value);
export const root = (values: Num[]): Num[] => values.map((v) => (known(v) && v >= 0 ? Math.sqrt(v) : null));

/** A value without an uncertainty at a number of decimals, with its unit. */
export const decimal = (value: Num | undefined, digits: number, unit = ""): string => (known(value) ? `${fixed(value, digits)}${unit && `\u00a0${unit}`}` : "unknown");
export const degrees = (rad: Num | undefined, digits = 3): string => (known(rad) ? `${fixed((rad * 180) / Math.PI, digits)}°` : "unknown");

/** Median of the known values, or null. */
export function median(values: Num[]): Num {
  const sorted = values.filter(known).sort((a, b) => a - b);
  return sorted.length ? (sorted[sorted.length >> 1] ?? null) : null;
}

/** Lengths of vectors by columns. */
export function lengths(x: Num[], y: Num[], z: Num[]): Num[] {
  return x.map((a, i) => {
    const b = y[i], c = z[i];
    return known(a) && known(b) && known(c) ? Math.hypot(a, b, c) : null;
  });
}

/** Standard uncertainty of the length of a vector, along itself; where it is too short, of its largest axis' trace. */
export function alongU(d: [Num, Num, Num], c: Covariance, i: number): Num {
  const [x, y, z] = d, m = [c.xx[i], c.xy[i], c.xz[i], c.yy[i], c.yz[i], c.zz[i]];
  if (!known(x) || !known(y) || !known(z) || !m.every(known)) return null;
  const [xx, xy, xz, yy, yz, zz] = m as [number, number, number, number, number, number];
  const s = x * x + y * y + z * z;
  if (s === 0) return Math.sqrt((xx + yy + zz) / 3);
  return Math.sqrt(Math.max(0, (xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z)) / s));
}
