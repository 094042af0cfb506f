// Numbers as text: rounded by their standard uncertainty, with a true minus sign.
import type { Num } from "../lib/types";
import { abs, clamp, floor, log10, max, round } from "./maths";

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** Text with U+2212 for minus; a zero that rounding left has no sign. */
export function fixed(value: number, digits: number): string {
  const text = value.toFixed(clamp(digits, 0, 20));
  return text.startsWith("-") ? (/[1-9]/.test(text) ? "\u2212" : "") + text.slice(1) : text;
}

/** Value without an uncertainty: six significant digits, no zeros at the end. */
export function plain(value: Num): string {
  if (value === null || !Number.isFinite(value)) return "unknown";
  const size = abs(value);
  if (size && (size < 1e-4 || size >= 1e15)) {
    const [mantissa, power] = value.toExponential(4).split("e");
    return `${plain(Number(mantissa))} × ${tenTo(Number(power))}`;
  }
  return String(size < 1e6 ? Number(value.toPrecision(6)) : round(value)).replace("-", "\u2212");
}

/** Power of ten, as 10⁻⁶. */
export function tenTo(power: number): string {
  return "10" + (power < 0 ? "⁻" : "") + [...String(abs(power))].map((digit) => RAISED[Number(digit)]).join("");
}

/** Decimals that show two significant digits of u; below zero where u has no decimals. */
export function decimals(u: number): number {
  return 1 - Number(u.toExponential(1).split("e")[1]);
}

/** Value rounded to a decimal place; below zero to tens, hundreds, ... */
export function rounded(value: number, places: number): string {
  if (places >= 0) return fixed(value, places);
  const step = 10 ** -places;
  return fixed(round(value / step) * step, 0);
}

/** Value with its standard uncertainty and unit: "12.3457 ± 0.0012 m"; null is "unknown". */
export function shown(value: Num, u?: Num, unit = ""): string {
  if (value === null || !Number.isFinite(value)) return "unknown";
  const tail = unit && (/^[°′″]/.test(unit) && unit.length === 1 ? unit : "\u00a0" + unit);
  if (u === null || u === undefined || !(u > 0) || !Number.isFinite(u)) return plain(value) + tail;
  const places = decimals(u);
  if (places > 8) {
    const power = floor(log10(max(abs(value), u)));
    const [v, s] = [value / 10 ** power, u / 10 ** power];
    return `(${rounded(v, decimals(s))} ± ${rounded(s, decimals(s))}) × ${tenTo(power)}${tail}`;
  }
  const text = `${rounded(value, places)} ± ${rounded(u, places)}`;
  return unit === tail && unit ? `(${text})${tail}` : text + tail;
}
