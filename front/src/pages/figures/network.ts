// The network of an epoch as a scene and as a table.
import type { SiteFacts } from "../../lib/state";
import type { Num, Scene, Table } from "../../lib/types";
import type { Comparison, EpochDetail, Polyline } from "../answers";
import { known, lengths, number, root, text, VARIANCE } from "./columns";

export type Colour = "none" | "w" | "displacement";
export type Component = "x" | "y" | "z" | "length";
export interface Look { colour: Colour; component: Component; beams: boolean; structure: boolean }

/** Residual w of the largest size at each point, by its name. */
export function worst(epoch: EpochDetail): Map<string, number> {
  const held = new Map<string, number>();
  epoch.beams.target.forEach((name, i) => {
    const w = epoch.beams.w[i];
    if (known(w) && Math.abs(w) > Math.abs(held.get(name) ?? 0)) held.set(name, w);
  });
  return held;
}

/** Displacement in mm of each point by its name. */
export function displacements(moved: Comparison | null, component: Component): Map<string, Num> {
  if (!moved) return new Map();
  const values = component === "length" ? lengths(moved.dx, moved.dy, moved.dz) : moved[`d${component}`];
  return new Map(moved.name.map((name, i) => [name, known(values[i]) ? (values[i] ?? 0) * 1000 : null]));
}

export function posed(epoch: EpochDetail): Polyline[] {
  return epoch.structure ?? [];
}

export function networkScene(epoch: EpochDetail, site: SiteFacts | null, look: Look, moved: Comparison | null): Scene {
  const bodies = new Map(site?.targets.name.map((name, i) => [name, site.targets.body[i] ?? "other"]) ?? []);
  const p = epoch.points, groups: string[] = [];
  const groupOf = (body: string): number => (groups.includes(body) ? groups.indexOf(body) : groups.push(body) - 1);
  const rangers = (site?.rangers ?? []).filter((r) => !p.name.includes(r.name));
  const own = new Set(site?.rangers.map((r) => r.name) ?? []);
  const name = [...p.name, ...rangers.map((r) => r.name)];
  const group = name.map((n) => groupOf(own.has(n) ? "rangers" : (bodies.get(n) ?? "points")));
  const index = new Map(name.map((n, i) => [n, i]));
  const points: Scene["points"] = {
    name, group,
    x: [...p.x, ...rangers.map((r) => r.x)], y: [...p.y, ...rangers.map((r) => r.y)], z: [...p.z, ...rangers.map((r) => r.z)],
  };
  if (p.covariance) {
    const c = p.covariance, none = rangers.map((): Num => null);
    points.covariance = { xx: [...c.xx, ...none], xy: [...c.xy, ...none], xz: [...c.xz, ...none], yy: [...c.yy, ...none], yz: [...c.yz, ...none], zz: [...c.zz, ...none] };
  }
  const scene: Scene = { frame: "ground", points, groups };
  if (look.beams) {
    const rows = epoch.beams.ranger.map((_, i) => i).filter((i) => index.has(epoch.beams.ranger[i] ?? "") && index.has(epoch.beams.target[i] ?? ""));
    const pick = <T>(column: T[]): T[] => rows.map((i) => column[i] as T);
    scene.beams = {
      from: pick(epoch.beams.ranger).map((n) => index.get(n) ?? 0), to: pick(epoch.beams.target).map((n) => index.get(n) ?? 0),
      value: pick(epoch.beams.w), name: rows.map((i) => `${epoch.beams.ranger[i]} to ${epoch.beams.target[i]}, shot ${epoch.beams.shot[i] ?? "unknown"}`),
    };
  }
  if (look.structure) scene.lines = posed(epoch);
  if (look.colour === "w") {
    const w = worst(epoch);
    scene.value = { label: "largest w", unit: "", values: name.map((n) => w.get(n) ?? null) };
  } else if (look.colour === "displacement") {
    const d = displacements(moved, look.component);
    scene.value = { label: look.component === "length" ? "displacement" : `displacement along ${look.component}`, unit: "mm", values: name.map((n) => d.get(n) ?? null) };
  }
  return scene;
}

export function networkTable(epoch: EpochDetail, site: SiteFacts | null, moved: Comparison | null, component: Component): Table {
  const p = epoch.points, c = p.covariance;
  const bodies = new Map(site?.targets.name.map((name, i) => [name, site.targets.body[i] ?? ""]) ?? []);
  const w = worst(epoch), d = displacements(moved, component);
  const columns = [text("name", "point", p.name), text("body", "body", p.name.map((n) => bodies.get(n) ?? ""))];
  for (const axis of ["x", "y", "z"] as const) {
    columns.push(number(axis, axis, "m", p[axis], c ? { u: `u${axis}` } : { digits: 5 }));
    if (c) columns.push(number(`u${axis}`, `u(${axis})`, "m", root(c[VARIANCE[axis]]), { digits: 6 }));
  }
  if (p.shots) columns.push(number("shots", "shots", "", p.shots, { digits: 0 }));
  columns.push(number("w", "largest w", "", p.name.map((n) => w.get(n) ?? null), { digits: 2 }));
  if (moved) columns.push(number("d", component === "length" ? "displacement" : `d${component}`, "mm", p.name.map((n) => d.get(n) ?? null), { digits: 3 }));
  return { name: "name", columns };
}

export function rejectedTable(epoch: EpochDetail): Table {
  const r = epoch.rejected, of = (key: "ranger" | "target" | "reason"): string[] => r.map((row) => row[key] ?? "unknown");
  return { name: "shot", columns: [number("shot", "shot", "", r.map((row) => row.shot), { digits: 0 }), text("ranger", "ranger", of("ranger")), text("target", "target", of("target")), text("reason", "reason", of("reason"), "long")] };
}

/** Zeros of the rangers, parameters of the air and jitter of each body, as the epoch estimated them. */
export function estimateTable(epoch: EpochDetail): Table | null {
  const rows: { name: string; value: Num; u: Num; unit: string }[] = [];
  const mm = (v: Num | undefined): Num => (known(v) ? v * 1000 : null);
  epoch.zeros?.ranger.forEach((name, i) => rows.push({ name: `zero of ${name}`, value: mm(epoch.zeros?.value[i]), u: mm(epoch.zeros?.u[i]), unit: "mm" }));
  epoch.air?.name.forEach((name, i) => rows.push({ name: `air: ${name}`, value: epoch.air?.value[i] ?? null, u: epoch.air?.u[i] ?? null, unit: "" }));
  const jitter = typeof epoch.jitter_mm === "number" ? { all: epoch.jitter_mm } : (epoch.jitter_mm ?? {});
  for (const [name, value] of Object.entries(jitter)) rows.push({ name: `jitter of ${name}`, value, u: null, unit: "mm" });
  if (!rows.length) return null;
  return { name: "name", columns: [text("name", "estimate", rows.map((r) => r.name)), number("value", "value", "", rows.map((r) => r.value), { u: "u" }), number("u", "u", "", rows.map((r) => r.u)), text("unit", "unit", rows.map((r) => r.unit))] };
}
