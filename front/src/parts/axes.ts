// Axes of a chart: where ticks stand and what they say.
import type { Axis } from "../lib/types";
import { scaled, ticks } from "./dom";
import { fixed } from "./number";
import { abs, ceil, max, round } from "./maths";

export interface Scale {
  title: string;
  factor: number; // of a value to its shown unit
  unit: string;
  at(most: number): { value: number; text: string }[];
}

const DAY = 86_400; // s
const STEPS = [1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 10_800, 21_600, 43_200, DAY, 2 * DAY, 7 * DAY, 30 * DAY, 91 * DAY, 365 * DAY]; // s

/** Instant of an MJD as 2026-11-27T04:05:06. */
export const instant = (mjd: number): string => new Date(round((mjd - 40_587) * DAY) * 1000).toISOString().slice(0, 19);

function clock(axis: Axis, low: number, high: number): Scale {
  const days = instant(low).slice(0, 10) === instant(high).slice(0, 10);
  return {
    factor: 1, unit: "",
    title: `${axis.label} (UTC${days ? ` on ${instant(low).slice(0, 10)}` : ""})`,
    at(most) {
      const step = STEPS.find((s) => ((high - low) * DAY) / s <= most) ?? (((high - low) * DAY) / max(most, 1));
      const marks = [];
      for (let i = ceil((low * DAY) / step); i * step <= high * DAY; i++) {
        const text = instant((i * step) / DAY);
        marks.push({ value: (i * step) / DAY, text: step >= DAY || (!days && text.endsWith("T00:00:00")) ? text.slice(step >= 365 * DAY ? 0 : 5, 10) : text.slice(11, step < 60 ? 19 : 16) });
      }
      return marks;
    },
  };
}

/** Axis over a range: categories, instants (unit MJD), or numbers with the prefix that reads best. */
export function scale(axis: Axis, low: number, high: number): Scale {
  if (axis.categories) {
    const names = axis.categories;
    return {
      factor: 1, unit: "", title: axis.label,
      at: () => names.map((text, value) => ({ value, text })).filter(({ value }) => value >= low && value <= high),
    };
  }
  if (axis.unit === "MJD") return clock(axis, low, high);
  const [factor, unit] = scaled(max(abs(low), abs(high)), axis.unit);
  return {
    factor, unit,
    title: unit ? `${axis.label} (${unit})` : axis.label,
    at(most) {
      const { at, digits } = ticks(low * factor, high * factor, most);
      return at.map((value) => ({ value: value / factor, text: fixed(value, digits) }));
    },
  };
}
