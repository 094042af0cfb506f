// A value rounded by its standard uncertainty: "12.3457 ± 0.0012 m".
import type { Num } from "./types";

export function shown(value: Num, u?: Num, unit = ""): string {
  if (value == null || !Number.isFinite(value)) return "no value";
  const tail = unit ? ` ${unit}` : "";
  if (u == null || !Number.isFinite(u) || u <= 0) {
    const digits = value === 0 ? 0 : Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(Math.abs(value)))));
    return `${value.toFixed(digits)}${tail}`.replace(/^-/, "−");
  }
  const digits = Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(u))));
  return `${value.toFixed(digits)} ± ${u.toFixed(digits)}${tail}`.replace(/^-/, "−");
}
