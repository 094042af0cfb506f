// Air along each path of an epoch as charts and tables.
import type { Chart, Num, Table } from "../../lib/types";
import type { Weather } from "../../lib/state";
import type { Air, Station } from "../answers";
import { known, number, text } from "./columns";

export type Quantity = "refractivity" | "temperature";

export const pathName = (ranger: string | undefined, target: string | undefined): string => `${ranger ?? ""} to ${target ?? ""}`;

export function pathChart(a: Air, quantity: Quantity, against: "length" | "ranger"): Chart {
  const p = a.paths, rangers = [...new Set(p.ranger)].sort(new Intl.Collator("en", { numeric: true }).compare);
  const place = new Map(rangers.map((r, i) => [r, i])), name = p.ranger.map((r, i) => pathName(r, p.target[i]));
  const y = quantity === "refractivity" ? { label: "refractivity", unit: "ppm", values: p.refractivity_ppm } : { label: "temperature", unit: "°C", values: p.temperature_c };
  return {
    type: "scatter", y, name, ...(quantity === "refractivity" ? { u: p.u } : {}),
    x: against === "length" ? { label: "length of the path", unit: "m", values: p.length } : { label: "ranger", unit: "", values: p.ranger.map((r) => place.get(r) ?? null), categories: rangers },
  };
}

export function pathTable(a: Air): Table {
  const p = a.paths;
  const columns = [
    text("path", "path", p.ranger.map((r, i) => pathName(r, p.target[i]))), number("length", "length", "m", p.length, { digits: 2 }),
    number("refractivity", "refractivity", "ppm", p.refractivity_ppm, { u: "u" }), number("u", "u", "ppm", p.u, { digits: 3 }),
    number("delay", "delay", "mm", p.length.map((l, i) => (known(l) && known(p.refractivity_ppm[i]) ? (l * (p.refractivity_ppm[i] ?? 0)) / 1000 : null)), { digits: 3 }),
  ];
  if (p.temperature_c?.some(known)) columns.push(number("temperature", "temperature", "°C", p.temperature_c, { digits: 2 }));
  return { name: "path", columns };
}

/** Mean of the paths' refractivity and its spread, ppm. */
export function meanPath(a: Air): { mean: Num; spread: Num } {
  const own = a.paths.refractivity_ppm.filter(known);
  if (!own.length) return { mean: null, spread: null };
  const mean = own.reduce((s, v) => s + v, 0) / own.length;
  return { mean, spread: own.length > 1 ? Math.sqrt(own.reduce((s, v) => s + (v - mean) ** 2, 0) / (own.length - 1)) : null };
}

export interface StationRow { name: string; read: Weather | null; offset: Num; u: Num }

/** Stations with their readings and what the adjustment adds to each, °C. */
export const stationRows = (stations: Station[]): StationRow[] =>
  stations.map((s) => ({ name: s.name ?? s.station ?? "", read: s.read ?? (s.mjd === undefined ? null : (s as Weather)), offset: s.offset_c ?? null, u: s.u_offset_c ?? null }));

/** Parameters of the profile that have a value with u. */
export function estimates(a: Air): { name: string; value: Num; u: Num }[] {
  return Object.entries(a.profile ?? {}).flatMap(([name, v]) => {
    if (!v || typeof v !== "object" || !("value" in v)) return [];
    const { value, u } = v as { value: unknown; u?: unknown };
    return [{ name, value: typeof value === "number" ? value : null, u: typeof u === "number" ? u : null }];
  });
}

export const hasTemperatures = (a: Air): boolean => a.paths.temperature_c.some(known);

const PROFILES: [key: string, label: string, unit: string][] = [["temperature_c", "temperature", "°C"], ["refractivity_ppm", "refractivity", "ppm"]];

/** Profile over height, where the answer has one. */
export function profileChart(a: Air): Chart | null {
  const height = a.profile?.height;
  if (!Array.isArray(height)) return null;
  for (const [key, label, unit] of PROFILES) {
    const values = a.profile?.[key], u = a.profile?.u;
    if (Array.isArray(values)) return { type: "line", x: { label: "height", unit: "m", values: height as Num[] }, y: { label, unit, values: values as Num[] }, ...(Array.isArray(u) ? { u: u as Num[] } : {}) };
  }
  return null;
}
