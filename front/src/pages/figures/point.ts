// A point over time: coordinates less their median, its covariance ellipsoid, its neighbours, its shots.
import type { SiteFacts } from "../../lib/state";
import { utc } from "../../lib/time";
import type { Num, Table } from "../../lib/types";
import { eigen } from "../../parts/eigen";
import { RADIUS } from "../../parts/ellipsoids";
import type { StripSeries } from "../../parts/strip";
import type { PointHistory, Shots } from "../answers";
import { known, median, number, root, text, times, VARIANCE } from "./columns";

export const AXES = ["x", "y", "z"] as const;

/** Index of the last instant at which the point had coordinates, or -1. */
export const lastRow = (p: PointHistory): number => p.x.reduce((last: number, x, i) => (known(x) ? i : last), -1);

export function coordinate(p: PointHistory, axis: (typeof AXES)[number], row: number): { value: Num; u: Num } {
  const variance = p.covariance?.[VARIANCE[axis]]?.[row];
  return { value: p[axis][row] ?? null, u: known(variance) ? Math.sqrt(Math.max(0, variance)) : null };
}

/** Changes about the median in mm, with u. */
export function changes(p: PointHistory, axis: (typeof AXES)[number]): { about: Num; series: StripSeries } {
  const about = median(p[axis]);
  const variance = p.covariance?.[VARIANCE[axis]];
  return { about, series: { name: `point:${p.name}:${axis}`, label: `${axis} less its median`, mjd: p.mjd, value: p[axis].map((v) => (known(v) && about !== null ? (v - about) * 1000 : null)), u: variance ? times(root(variance), 1000) : null } };
}

export interface SemiAxis { u: number; wide: number; direction: number[] }

/** Semi-axes of the covariance ellipsoid in m, the longest first: standard, 95 %, and the direction's x, y, z. */
export function ellipsoid(p: PointHistory, row: number): SemiAxis[] | null {
  const c = p.covariance;
  if (!c || row < 0) return null;
  const [xx, xy, xz, yy, yz, zz] = [c.xx[row], c.xy[row], c.xz[row], c.yy[row], c.yz[row], c.zz[row]];
  if (![xx, xy, xz, yy, yz, zz].every(known)) return null;
  const { values, vectors } = eigen([xx, xy, xz, yy, yz, zz] as number[]);
  return values
    .map((value, k) => ({ u: Math.sqrt(Math.max(0, value)), wide: RADIUS * Math.sqrt(Math.max(0, value)), direction: vectors[k] ?? [] }))
    .sort((a, b) => b.u - a.u);
}

export function neighbours(site: SiteFacts, name: string, most = 8): { name: string; body: string; distance: number }[] {
  const t = site.targets, own = t.name.indexOf(name);
  const at = (i: number): number[] | null => { const p = [t.x[i], t.y[i], t.z[i]]; return p.every(known) ? (p as number[]) : null; };
  const from = at(own);
  if (!from) return [];
  return t.name
    .flatMap((n, i) => { const p = at(i); return i === own || !p ? [] : [{ name: n, body: t.body[i] ?? "", distance: Math.hypot(...p.map((v, k) => v - (from[k] ?? 0))) }]; })
    .sort((a, b) => a.distance - b.distance).slice(0, most);
}

/** Coordinates with u at each epoch. */
export function pointTable(p: PointHistory): Table {
  const columns = [number("mjd", "MJD", "d", p.mjd), text("utc", "UTC", p.mjd.map((t) => utc(t, "full")))];
  for (const axis of AXES) {
    columns.push(number(axis, axis, "m", p[axis]));
    if (p.covariance) columns.push(number(`u${axis}`, `u(${axis})`, "m", root(p.covariance[VARIANCE[axis]])));
  }
  return { columns };
}

export function shotsTable(s: Shots): Table {
  return {
    name: "number",
    columns: [number("number", "shot", "", s.number, { digits: 0 }), text("utc", "UTC", s.mjd.map((t) => utc(t, "full"))), text("ranger", "ranger", s.ranger), text("target", "target", s.target), text("status", "status", s.status), number("range", "range", "m", s.range, { u: "u" }), number("u", "u", "m", s.u_range), number("misfit", "misfit", "mm", times(s.misfit, 1000), { digits: 3 })],
  };
}
