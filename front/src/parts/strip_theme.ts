// What strips have in common: colours of the scheme on a canvas, and the time axis.
import type uPlot from "uplot";
import "./strip.css";

/** Present value of a colour variable of theme.css, as a canvas takes it. */
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888888";
}

/** The same colour, seen through: six hex digits become eight. */
export function veil(name: string, opacity: number): string {
  const solid = colour(name);
  return /^#[0-9a-f]{6}$/i.test(solid) ? `${solid}${Math.round(255 * Math.max(0, Math.min(1, opacity))).toString(16).padStart(2, "0")}` : solid;
}

/** Call `handler` whenever the colour scheme changes; the answer ends that. */
export function onScheme(handler: () => void): () => void {
  const system = matchMedia("(prefers-color-scheme: dark)"), chosen = new MutationObserver(handler);
  chosen.observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
  system.addEventListener("change", handler);
  return () => {
    chosen.disconnect();
    system.removeEventListener("change", handler);
  };
}

const two = (n: number): string => String(n).padStart(2, "0");

/** "12:05", with seconds where the steps are shorter than a minute, the date under the first and at midnight. */
function clockTexts(at: number[]): string[] {
  const step = (at[1] ?? 60) - (at[0] ?? 0);
  return at.map((seconds, k) => {
    const date = new Date(seconds * 1000), hours = two(date.getUTCHours()), minutes = two(date.getUTCMinutes());
    const time = step < 1 ? `${hours}:${minutes}:${(date.getUTCSeconds() + date.getUTCMilliseconds() / 1000).toFixed(1).padStart(4, "0")}` : step < 60 ? `${hours}:${minutes}:${two(date.getUTCSeconds())}` : `${hours}:${minutes}`;
    return k === 0 || (date.getUTCHours() === 0 && date.getUTCMinutes() === 0 && step >= 60) ? `${time}\n${date.toISOString().slice(0, 10)}` : time;
  });
}

/** Look of an axis of values. */
export function plainAxis(): uPlot.Axis {
  const stroke = (): string => colour("--faint");
  return { stroke, font: "11px system-ui, sans-serif", grid: { stroke: () => veil("--line", 0.6), width: 1 }, ticks: { stroke: () => colour("--line"), width: 1, size: 4 } };
}

/** Axis of UTC. */
export const timeAxis = (): uPlot.Axis => ({ ...plainAxis(), space: 70, values: (_, at) => clockTexts(at) });
