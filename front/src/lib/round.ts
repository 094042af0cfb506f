// Numbers rounded by another number's uncertainty, or to a fixed number of decimals.
import { decimals, fixed, rounded } from "../parts/number";
import type { Num } from "./types";

/** A value at the decimals of its u, without the u beside it: where u stands in the line above. */
export function byU(value: Num, u: Num, unit: string): string {
  if (value == null) return "unknown";
  return u != null && u > 0 ? `${rounded(value, decimals(u))} ${unit}` : `${fixed(value, 3)} ${unit}`;
}

/** A value of an instrument whose uncertainty is not known here, at its resolution. */
export function atDigits(value: Num | undefined, digits: number, unit: string): string {
  return value == null ? "unknown" : `${fixed(value, digits)}${unit === "°" ? "" : "\u00a0"}${unit}`;
}
