// A map of dropped channels under the strips: a row for each ranger, a column for each stretch of time, and the same
// time axis, cursor and zoom as the strips of its group.
import uPlot from "uplot";
import { mjdOf } from "../lib/time";
import type { Strip } from "./strip";
import { colour, onScheme, plainAxis, timeAxis, veil } from "./strip_theme";

export interface DropMap { rangers: string[]; bins: number[] /* MJD of the starts, or all edges */; width?: number /* d */; good: number[][]; failed: number[][]; span: [number, number] }
export interface MapOptions { group: string; label: string; zoom: (span: [number, number] | null) => void; select?: (ranger: string) => void }
export interface MapStrip { update(data: DropMap): void; canvas: Strip["canvas"]; destroy(): void }

const ROW = 15;
const seconds = (mjd: number): number => (mjd - 40587) * 86400;

/** End of a bin: the next edge, or as long as the one before. */
function end({ bins, width }: DropMap, k: number): number {
  return bins[k + 1] ?? (width !== undefined ? (bins[k] ?? 0) + width : (bins[k] ?? 0) + ((bins[k] ?? 0) - (bins[k - 1] ?? (bins[k] ?? 0) - 1 / 1440)));
}

function drawCells(plot: uPlot, data: DropMap): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  data.rangers.forEach((_, row) => {
    const top = plot.valToPos(row + 0.08, "y", true), bottom = plot.valToPos(row + 0.92, "y", true);
    const columns = data.good[row]?.length ?? 0;
    for (let k = 0; k < columns; k++) {
      const good = data.good[row]?.[k] ?? 0, failed = data.failed[row]?.[k] ?? 0;
      if (good + failed === 0) continue; // nothing was tried: bare
      const left = plot.valToPos(seconds(data.bins[k] ?? 0), "x", true), right = plot.valToPos(seconds(end(data, k)), "x", true);
      if (right < bbox.left || left > bbox.left + bbox.width) continue;
      const share = failed / (good + failed), height = bottom - top;
      ctx.fillStyle = veil("--c5", 0.35);
      ctx.fillRect(left, top, right - left, height);
      ctx.fillStyle = colour("--high"); // height of the bar, not colour alone, is the share that failed
      ctx.fillRect(left, bottom - height * share, right - left, height * share);
    }
  });
  ctx.restore();
}

function configuration(data: () => DropMap, options: MapOptions, width: number): uPlot.Options {
  const rows = data().rangers.length;
  return {
    width, height: rows * ROW + 34, series: [{}, { stroke: () => "transparent", points: { show: false } }], legend: { show: false },
    tzDate: (ts) => uPlot.tzDate(new Date(ts * 1000), "Etc/UTC"),
    scales: { x: { time: true, range: () => [seconds(data().span[0]), seconds(data().span[1])] }, y: { range: () => [0, rows], dir: -1 } },
    axes: [timeAxis(), { ...plainAxis(), size: 92, grid: { show: false }, splits: () => data().rangers.map((_, k) => k + 0.5), filter: (_, at) => at, values: () => data().rangers }],
    cursor: { sync: { key: options.group, scales: ["x", null] }, drag: { x: true, y: false, setScale: false, dist: 6 }, points: { show: false }, bind: { dblclick: () => () => { options.zoom(null); return null; } } },
    hooks: {
      draw: [(plot) => drawCells(plot, data())],
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

function columns(data: DropMap): uPlot.AlignedData {
  const x = data.bins.map(seconds);
  return [x, x.map(() => 0)]; // uPlot draws no axis for a scale without values
}

/** Put a map of dropped channels into a host; its table is the caller's to show beside it. */
export function dropMap(host: HTMLElement, data: DropMap, options: MapOptions): MapStrip {
  let current = data;
  host.classList.add("strip");
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", options.label);
  const make = (): uPlot => new uPlot(configuration(() => current, options, Math.max(200, host.clientWidth)), columns(current), host);
  let plot = make();
  const watch = new ResizeObserver(() => plot.setSize({ width: Math.max(200, host.clientWidth), height: plot.height }));
  watch.observe(host);
  const themed = onScheme(() => plot.redraw(false, true));
  return {
    update(next) {
      const same = next.rangers.join() === current.rangers.join();
      current = next;
      if (same) return void plot.setData(columns(next), true);
      plot.destroy();
      plot = make();
    },
    canvas: () => plot.ctx.canvas,
    destroy() {
      watch.disconnect();
      themed();
      plot.destroy();
    },
  };
}
