// Samplers of the coordinator as rows, charts and tables: beam, focus, pose, surface, corrections, moves, health.
import { utc } from "../../lib/time";
import type { Chart, Num, Table } from "../../lib/types";
import { shown } from "../../parts/number";
import type { Sampler } from "../answers";
import { known, number, root, text, times } from "./columns";

export const ARCSECONDS = (180 * 3600) / Math.PI; // of a radian
const AXES = [["x", "m", 1e3], ["y", "m", 1e3], ["z", "m", 1e3], ["rx", "rad", ARCSECONDS], ["ry", "rad", ARCSECONDS], ["rz", "rad", ARCSECONDS]] as const;

export const numbers = (s: Sampler, column: string): Num[] => (s.columns[column] ?? []).map((v) => (typeof v === "number" ? v : null));
export const words = (s: Sampler, column: string): string[] => (s.columns[column] ?? []).map((v) => (v === null ? "unknown" : String(v)));

/** Values of the last row, by column; none without rows. */
export function last(s: Sampler): Record<string, Num | string> | null {
  const row = s.mjd.length - 1;
  return row < 0 ? null : { mjd: s.mjd[row] ?? null, ...Object.fromEntries(Object.entries(s.columns).map(([column, values]) => [column, values[row] ?? null])) };
}

/** A number of a row times a factor; null where it is unknown. */
export function scaled(row: Record<string, Num | string>, column: string, factor: number): Num {
  const value = row[column];
  return typeof value === "number" && known(value) ? value * factor : null;
}

/** A correction with its u; of the reference epoch it is zero by definition. */
export function correction(row: Record<string, Num | string>, column: string, factor: number, unit: string): string {
  if (row.epoch !== null && row.epoch === row.reference && row[column] !== null) return "0: this epoch is the zero";
  return shown(scaled(row, column, factor), scaled(row, `u_${column}`, factor), unit);
}

interface Line { name: string; value: Num[]; u: Num[] }

function overTime(s: Sampler, label: string, unit: string, lines: Line[]): Chart {
  const end = s.mjd.at(-1) ?? 0;
  return {
    type: "scatter", x: { label: `time before ${utc(end)}`, unit: "min", values: lines.flatMap(() => s.mjd.map((mjd) => (mjd - end) * 1440)) },
    y: { label, unit, values: lines.flatMap((line) => line.value) }, u: lines.flatMap((line) => line.u),
    name: lines.flatMap((line) => s.mjd.map((_, k) => `${line.name}, epoch ${s.columns.epoch?.[k] ?? "unknown"}`)),
    ...(lines.length > 1 ? { group: lines.flatMap((_, k) => s.mjd.map(() => k)), groups: lines.map((line) => line.name) } : {}),
  };
}

/** Beam offset in both directions, seconds of arc. */
export function beamChart(s: Sampler): Chart {
  const line = (name: string, column: string, variance: string): Line => ({ name, value: times(numbers(s, column), ARCSECONDS), u: times(root(numbers(s, variance)), ARCSECONDS) });
  return overTime(s, "beam offset", "″", [line("azimuth × cos E", "azimuth_cos_e_rad", "azimuth_azimuth_rad2"), line("elevation", "elevation_rad", "elevation_elevation_rad2")]);
}

/** Focus along the axis, mm. */
export const focusChart = (s: Sampler): Chart => overTime(s, "focus along the axis", "mm", [{ name: "focus", value: times(numbers(s, "along_axis_m"), 1e3), u: times(numbers(s, "u_along_axis_m"), 1e3) }]);

/** Root mean square of the dish's deviations, mm; u of a single deviation. */
export const surfaceChart = (s: Sampler): Chart => overTime(s, "rms of the deviations", "mm", [{ name: "rms", value: times(numbers(s, "rms_m"), 1e3), u: times(numbers(s, "u_deviation_m"), 1e3) }]);

export interface Motion { axis: string; value: Num; u: Num; unit: string }
export interface BodyPose { body: string; epoch: Num; reference: Num; mjd: number; motions: Motion[] }

/** Last motion of each body since the reference epoch: mm along x, y, z, seconds of arc about them. */
export function poses(s: Sampler): BodyPose[] {
  const rows = new Map(words(s, "body").map((body, row) => [body, row]));
  return [...rows].map(([body, row]) => ({
    body, mjd: s.mjd[row] ?? NaN, epoch: numbers(s, "epoch")[row] ?? null, reference: numbers(s, "reference")[row] ?? null,
    motions: AXES.map(([axis, unit, factor]) => {
      const value = numbers(s, `${axis}_${unit}`)[row] ?? null;
      if (value !== null && s.columns.epoch?.[row] === s.columns.reference?.[row]) return { axis, value: 0, u: null, unit: unit === "m" ? "mm" : "″" }; // zero by definition
      const variance = numbers(s, `${axis}_${axis}_${unit}2`)[row] ?? null;
      return { axis, value: value === null ? null : value * factor, u: variance === null ? null : factor * Math.sqrt(Math.max(0, variance)), unit: unit === "m" ? "mm" : "″" };
    }),
  }));
}

/** Last report of each ranger on itself. */
export function healthTable(s: Sampler): Table {
  const rows = new Map(words(s, "ranger").map((ranger, row) => [ranger, row]));
  const order = [...rows.keys()].sort(new Intl.Collator("en", { numeric: true }).compare).map((ranger) => rows.get(ranger) as number);
  const some = (column: string): string[] => order.map((row) => words(s, column)[row] ?? "unknown");
  const values = (column: string, factor = 1): Num[] => times(order.map((row) => numbers(s, column)[row] ?? null), factor);
  return {
    name: "ranger",
    columns: [
      text("ranger", "ranger", some("ranger")), text("time", "at", order.map((row) => utc(s.mjd[row]))), text("state", "state", some("state")), text("laser", "laser", some("laser")), text("supplies", "supplies", some("supplies")),
      number("temperature", "head", "°C", values("temperature_c"), { digits: 1 }),
      number("azimuth_error", "azimuth error", "counts", values("azimuth_error_counts"), { digits: 0 }), number("elevation_error", "elevation error", "counts", values("elevation_error_counts"), { digits: 0 }),
      text("azimuth_motor", "azimuth motor", some("azimuth_motor")), text("elevation_motor", "elevation motor", some("elevation_motor")),
      text("clock", "clock", some("clock")), number("clock_offset", "clock offset", "ms", values("clock_offset_s", 1e3), { digits: 2 }),
      number("round_trip", "round trip", "ms", values("round_trip_s", 1e3), { digits: 1 }), text("status", "status", some("status"), "long"),
    ],
  };
}

/** Recorded moves of other actuators, the last first. */
export function moveRows(s: Sampler): { mjd: number; actuator: string; value: string; by: string; reference: string }[] {
  const [actuator, value, unit, by, reference] = ["actuator", "value", "unit", "by", "reference"].map((column) => words(s, column));
  return s.mjd.map((mjd, k) => ({ mjd, actuator: actuator?.[k] ?? "", value: `${value?.[k] ?? ""}\u00a0${unit?.[k] ?? ""}`, by: by?.[k] ?? "", reference: reference?.[k] ?? "" })).reverse();
}
