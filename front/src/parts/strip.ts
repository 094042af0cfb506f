// A strip chart over time by uPlot: lines that break at gaps, bands of u or of a bin's extremes, marks of events, and a
// cursor in step with every other strip of the same group. Dashboard only; reports have their own charts.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { dateOf, mjdOf, utc } from "../lib/time";
import type { Num } from "../lib/types";
import { colour, onScheme, plainAxis, timeAxis, veil } from "./strip_theme";

export interface StripSeries {
  name: string; label: string; mjd: number[]; value: Num[];
  u?: Num[] | null; low?: Num[] | null; high?: Num[] | null; // u: 1 sigma; low and high: extremes of a bin
}
export interface Mark { mjd: number; kind: "alarm" | "warning" | "epoch" | "event"; text: string }
export interface StripData { label: string; unit: string; series: StripSeries[]; gap: number /* s without a value that break a line */; marks: Mark[]; span: [number, number] /* MJD */ }
export interface StripOptions {
  group: string; // strips of one group share the cursor
  label: string;
  height?: number;
  zoom: (span: [number, number] | null) => void; // null: all of it again
  cursor?: (mjd: number | null) => void;
}
export interface Strip { update(data: StripData): void; canvas(): HTMLCanvasElement; destroy(): void }

const DASHES = [undefined, [6, 3], [2, 3]];
const seconds = (mjd: number): number => (mjd - 40587) * 86400;
export const style = (k: number): { colour: string; dash: number[] | undefined } => ({
  colour: `--c${k % 8}`, dash: DASHES[Math.floor(k / 8) % DASHES.length],
});

/** Median step between instants, s. */
function usualStep(instants: number[]): number {
  const steps = instants.slice(1).map((t, i) => t - (instants[i] ?? t)).sort((a, b) => a - b);
  return 86400 * (steps[steps.length >> 1] ?? 0);
}

/** Columns for uPlot on one time axis: value, lower and upper edge of each series; a null breaks the line at a gap. */
export function aligned(data: StripData): uPlot.AlignedData {
  const tables = data.series.map((s): uPlot.AlignedData => {
    const gap = Math.max(data.gap, 3 * usualStep(s.mjd)) / 86400; // bins and epochs may stand further apart than the gap
    const t: number[] = [], value: Num[] = [], low: Num[] = [], high: Num[] = [];
    s.mjd.forEach((mjd, i) => {
      const before = s.mjd[i - 1];
      if (before !== undefined && mjd - before > gap) {
        t.push(seconds((mjd + before) / 2));
        for (const column of [value, low, high]) column.push(null);
      }
      const v = s.value[i] ?? null, u = s.u?.[i] ?? null;
      t.push(seconds(mjd));
      value.push(v);
      low.push(s.low ? (s.low[i] ?? null) : v !== null && u !== null ? v - u : v);
      high.push(s.high ? (s.high[i] ?? null) : v !== null && u !== null ? v + u : v);
    });
    return [t, value, low, high];
  });
  return tables.length ? uPlot.join(tables) : [[]];
}

/** Index of the last instant at or before `mjd`, or -1. */
export function indexAt(instants: number[], mjd: number): number {
  let low = -1, high = instants.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((instants[middle] ?? Infinity) <= mjd) low = middle;
    else high = middle;
  }
  return low;
}

function drawMarks(plot: uPlot, marks: Mark[]): void {
  const { ctx, bbox } = plot, ratio = uPlot.pxRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const mark of marks) {
    const x = plot.valToPos(seconds(mark.mjd), "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    const short = mark.kind === "epoch";
    ctx.strokeStyle = ctx.fillStyle = colour({ alarm: "--alarm", warning: "--doubtful", epoch: "--faint", event: "--faint" }[mark.kind]);
    ctx.lineWidth = ratio;
    ctx.setLineDash(mark.kind === "alarm" || short ? [] : [3 * ratio, 3 * ratio]);
    ctx.beginPath();
    ctx.moveTo(x, short ? bbox.top + bbox.height - 5 * ratio : bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    if (mark.kind === "alarm" || mark.kind === "warning") {
      ctx.beginPath(); // a triangle for an alarm, a square for a warning: never by colour alone
      const s = 5 * ratio;
      if (mark.kind === "alarm") ctx.moveTo(x - s, bbox.top), ctx.lineTo(x + s, bbox.top), ctx.lineTo(x, bbox.top + 1.6 * s);
      else ctx.rect(x - s / 2, bbox.top, s, s);
      ctx.fill();
    }
  }
  ctx.restore();
}

function configuration(data: () => StripData, options: StripOptions, width: number): uPlot.Options {
  const first = data();
  const series: uPlot.Series[] = [{}], bands: uPlot.Band[] = [];
  first.series.forEach((s, k) => {
    const look = style(k), stroke = (): string => colour(look.colour);
    series.push({ label: s.label, stroke, width: 1.25, ...(look.dash ? { dash: look.dash } : {}), points: { size: 4 } });
    for (const edge of ["low", "high"]) series.push({ label: `${s.label} ${edge}`, stroke: () => "transparent", width: 0, points: { show: false } });
    bands.push({ series: [3 * k + 3, 3 * k + 2], fill: () => veil(look.colour, 0.18) });
  });
  const span = (): [number, number] => [seconds(data().span[0]), seconds(data().span[1])];
  return {
    width, height: options.height ?? 180, series, bands, legend: { show: false },
    tzDate: (ts) => uPlot.tzDate(new Date(ts * 1000), "Etc/UTC"),
    scales: { x: { time: true, range: span }, y: { range: (_, low, high) => extent(low, high) } },
    axes: [timeAxis(), { ...plainAxis(), size: 76, space: 20, label: first.unit ? `${first.label}, ${first.unit}` : first.label, labelSize: 16, labelFont: "12px system-ui, sans-serif", values: (_, ticks) => ticks.map((tick) => short(tick, ticks)) }],
    cursor: {
      sync: { key: options.group, scales: ["x", null] }, drag: { x: true, y: false, setScale: false, dist: 6 },
      bind: { dblclick: () => () => { options.zoom(null); return null; } },
      points: { show: (_, k) => (k % 3 === 1 ? document.createElement("div") : undefined) as unknown as HTMLElement },
    },
    hooks: {
      drawAxes: [(plot) => drawMarks(plot, data().marks)], // beneath the lines
      setCursor: [(plot) => options.cursor?.(plot.cursor.left == null || plot.cursor.left < 0 ? null : mjdOf(new Date(plot.posToVal(plot.cursor.left, "x") * 1000)))],
      setSelect: [(plot) => {
        if (plot.select.width < 4) return;
        const at = (left: number): number => mjdOf(new Date(plot.posToVal(left, "x") * 1000));
        const wanted: [number, number] = [at(plot.select.left), at(plot.select.left + plot.select.width)];
        plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        options.zoom(wanted);
      }],
    },
  };
}

function extent(low: number | null, high: number | null): [number, number] {
  if (low == null || high == null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const pad = high > low ? (high - low) * 0.08 : Math.max(Math.abs(low) * 1e-6, 1e-9);
  return [low - pad, high + pad];
}

function short(tick: number, ticks: number[]): string {
  const step = Math.abs((ticks[1] ?? tick + 1) - (ticks[0] ?? tick)) || 1;
  return tick.toFixed(Math.max(0, Math.min(9, Math.ceil(-Math.log10(step) - 1e-9)))).replace(/^-/, "−");
}

/** Put a strip chart into a host; it follows the host's width and the colour scheme. */
export function strip(host: HTMLElement, data: StripData, options: StripOptions): Strip {
  let current = data, shape = key(data);
  host.classList.add("strip");
  host.tabIndex = 0;
  host.setAttribute("role", "group");
  host.setAttribute("aria-label", `${options.label}. Arrow keys move the cursor, plus and minus zoom, 0 shows all.`);
  const spoken = host.appendChild(document.createElement("p"));
  spoken.className = "spoken";
  spoken.setAttribute("aria-live", "polite");
  const make = (): uPlot => new uPlot(configuration(() => current, options, Math.max(200, host.clientWidth)), aligned(current), host);
  let plot = make();
  const watch = new ResizeObserver(() => plot.setSize({ width: Math.max(200, host.clientWidth), height: options.height ?? 180 }));
  watch.observe(host);
  const themed = onScheme(() => plot.redraw(false, true));
  const keyed = (event: KeyboardEvent): void => press(event, plot, current, options, spoken);
  host.addEventListener("keydown", keyed);
  return {
    update(next) {
      const moved = next.series === current.series; // the axis or the marks alone: the lines need not be joined again
      current = next;
      if (moved) return void plot.setScale("x", { min: seconds(next.span[0]), max: seconds(next.span[1]) });
      if (key(next) === shape) return void plot.setData(aligned(next), true);
      shape = key(next);
      plot.destroy();
      plot = make();
    },
    canvas: () => plot.ctx.canvas,
    destroy() {
      watch.disconnect();
      themed();
      host.removeEventListener("keydown", keyed);
      plot.destroy();
      spoken.remove();
    },
  };
}

const key = (data: StripData): string => [data.label, data.unit, ...data.series.map((s) => s.name)].join("\n");

function press(event: KeyboardEvent, plot: uPlot, data: StripData, options: StripOptions, spoken: HTMLElement): void {
  const [since, until] = data.span, x = plot.data[0];
  const at = plot.cursor.left != null && plot.cursor.left >= 0 ? plot.posToIdx(plot.cursor.left) : x.length - 1;
  const middle = x[at] === undefined ? (since + until) / 2 : mjdOf(new Date((x[at] ?? 0) * 1000));
  const moves: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, Home: -x.length, End: x.length };
  const zooms: Record<string, number> = { "+": 0.5, "=": 0.5, "-": 2 };
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const move = moves[event.key], zoom = zooms[event.key];
  if (move !== undefined && x.length) {
    const to = Math.max(0, Math.min(x.length - 1, at + move * (event.shiftKey ? 10 : 1))), t = x[to] ?? 0;
    plot.setCursor({ left: plot.valToPos(t, "x"), top: 10 });
    const mjd = mjdOf(dateOf(t / 86400 + 40587));
    const texts = data.series.map((s) => `${s.label} ${s.value[indexAt(s.mjd, mjd + 1e-9)]?.toPrecision(6) ?? "no value"} ${data.unit}`);
    spoken.textContent = `${utc(mjd)}: ${texts.join("; ")}`;
  } else if (zoom !== undefined) options.zoom([middle - (middle - since) * zoom, middle + (until - middle) * zoom]);
  else if (event.key === "0" || event.key === "Escape") options.zoom(null);
  else return;
  event.preventDefault();
}
