// Chart on a canvas: first version, marks only.
import type { Chart } from "../lib/types";
import { el, palette, type Options, type Part } from "./dom";
import "./parts.css";

export function chart(host: HTMLElement, data: Chart, options: Options = {}): Part<Chart> {
  const canvas = el("canvas", { role: "img", "aria-label": options.label ?? "Chart", width: "640", height: "320" });
  host.append(canvas);
  function update(next: Chart): void {
    data = next;
    const [xs, ys] = [data.x.values ?? [], data.y?.values ?? []];
    const span = (v: (number | null)[]) => v.reduce<[number, number]>(([a, b], x) => (x === null ? [a, b] : [Math.min(a, x), Math.max(b, x)]), [1e300, -1e300]);
    const [[x0, x1], [y0, y1]] = [span(xs), span(ys)];
    const g = canvas.getContext("2d")!;
    g.clearRect(0, 0, 640, 320);
    g.fillStyle = palette(host).accent;
    xs.forEach((x, i) => {
      const y = ys[i];
      if (x !== null && y !== null && y !== undefined) g.fillRect(10 + (620 * (x - x0)) / (x1 - x0 || 1), 310 - (300 * (y - y0)) / (y1 - y0 || 1), 3, 3);
    });
  }
  update(data);
  return { update, select() {}, destroy: () => canvas.remove() };
}
