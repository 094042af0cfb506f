// Displacements between two epochs: values with u, what is significant, arrows and tables.
import type { SiteFacts } from "../../lib/state";
import type { Num, Scene, Table } from "../../lib/types";
import type { Comparison, EpochDetail } from "../answers";
import { alongU, known, lengths, number, root, text, times, VARIANCE } from "./columns";
import { networkScene, type Component } from "./network";

const ARROWS = 400; // more would hide the network

/** Rows of a comparison by falling significance: length over its u. */
export function ranked(c: Comparison): { row: number; length: Num; u: Num }[] {
  const all = lengths(c.dx, c.dy, c.dz);
  const rows = all.map((length, row) => ({ row, length, u: c.covariance ? alongU([c.dx[row] ?? null, c.dy[row] ?? null, c.dz[row] ?? null], c.covariance, row) : null }));
  const size = (r: { row: number; length: Num; u: Num }): number => (known(c.w?.[r.row]) ? Math.abs(c.w?.[r.row] ?? 0) : known(r.length) && r.u ? r.length / r.u : -1);
  return rows.sort((a, b) => size(b) - size(a));
}

/** The second epoch's points coloured by displacement, with arrows `times` as long as what moved. */
export function comparisonScene(epoch: EpochDetail, site: SiteFacts | null, c: Comparison, component: Component, longer: number, only: boolean): Scene {
  const scene = networkScene(epoch, site, { colour: "displacement", component, beams: false, structure: true }, c);
  if (only && scene.value) {
    const moved = new Set(c.name.filter((_, i) => c.significant[i]));
    scene.value.values = scene.value.values.map((v, i) => (moved.has(scene.points.name[i] ?? "") ? v : null));
  }
  const place = new Map(scene.points.name.map((n, i) => [n, i]));
  const arrows = ranked(c).filter(({ row }) => c.significant[row]).slice(0, ARROWS).flatMap(({ row }) => {
    const i = place.get(c.name[row] ?? "") ?? -1;
    const from = [scene.points.x[i], scene.points.y[i], scene.points.z[i]], by = [c.dx[row], c.dy[row], c.dz[row]];
    return from.every(known) && by.every(known) ? [{ name: c.name[row] ?? "", ...arrow(from as number[], by.map((d) => (d ?? 0) * longer)) }] : [];
  });
  scene.lines = [...(scene.lines ?? []), ...arrows];
  return scene;
}

/** Shaft and two barbs as one polyline. */
function arrow(from: number[], by: number[]): { x: number[]; y: number[]; z: number[] } {
  const [x = 0, y = 0, z = 0] = from, [dx = 0, dy = 0, dz = 0] = by;
  const flat = Math.hypot(dx, dy), side = flat > 0 ? [-dy / flat, dx / flat, 0] : [1, 0, 0];
  const size = 0.12 * Math.hypot(dx, dy, dz);
  const barb = (sign: number): number[] => [x + 0.8 * dx + sign * size * (side[0] ?? 0), y + 0.8 * dy + sign * size * (side[1] ?? 0), z + 0.8 * dz];
  const path = [[x, y, z], [x + dx, y + dy, z + dz], barb(1), [x + dx, y + dy, z + dz], barb(-1)];
  return { x: path.map((p) => p[0] ?? 0), y: path.map((p) => p[1] ?? 0), z: path.map((p) => p[2] ?? 0) };
}

export function comparisonTable(c: Comparison): Table {
  const rows = ranked(c), pick = <T>(column: T[]): T[] => rows.map((r) => column[r.row] as T);
  const columns = [text("name", "point", pick(c.name)), number("length", "length", "mm", times(rows.map((r) => r.length), 1000), { u: "ulength" }), number("ulength", "u(length)", "mm", times(rows.map((r) => r.u), 1000), { digits: 3 }), c.w ? number("w", "w", "", pick(c.w), { digits: 2 }) : number("ratio", "length / u", "", rows.map((r) => (known(r.length) && r.u ? r.length / r.u : null)), { digits: 1 }), text("significant", "significant", rows.map((r) => (c.significant[r.row] ? "moved" : "no")))];
  for (const axis of ["x", "y", "z"] as const) {
    const variance = c.covariance?.[VARIANCE[axis]];
    columns.push(number(`d${axis}`, `d${axis}`, "mm", times(pick(c[`d${axis}`]), 1000), variance ? { u: `u${axis}` } : {}));
    if (variance) columns.push(number(`u${axis}`, `u(d${axis})`, "mm", times(pick(root(variance)), 1000), { digits: 3 }));
  }
  return { name: "name", columns };
}

/** Factor of 1, 2 or 5 times a power of ten that makes the largest significant displacement some twentieth of the scene. */
export function usualScale(c: Comparison, epoch: EpochDetail): number {
  const most = (values: Num[]): number => values.reduce((a: number, v) => (known(v) && Math.abs(v) > a ? Math.abs(v) : a), 0);
  const moved = most(lengths(c.dx, c.dy, c.dz).filter((_, i) => c.significant[i])), size = most(epoch.points.x);
  if (moved <= 0 || size <= 0) return 1000;
  const wanted = (0.1 * size) / moved, power = 10 ** Math.floor(Math.log10(wanted));
  return power * (wanted / power >= 5 ? 5 : wanted / power >= 2 ? 2 : 1);
}

