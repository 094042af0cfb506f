// Chart on a canvas: marks with uncertainties, hover, keyboard, zoom, downloads, paper.
import type { Axis, Chart, Column } from "../lib/types";
import { instant, scale, type Scale } from "./axes";
import { announce, button, el, extent, onPrint, onScheme, PAPER, palette, tip, type Options, type Palette, type Part } from "./dom";
import { csv, png } from "./download";
import { marksOf, type Mark } from "./marks";
import { fixed, plain, shown } from "./number";
import "./parts.css";

const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";
const NEAR = 24; // px from the pointer within which a mark is hovered
const DENSE = 2500; // marks above which they are small squares
const SHEET = 680; // px wide on paper
const KINDS = { scatter: "Scatter plot", line: "Line chart", bars: "Bar chart", histogram: "Histogram", normal: "Normal probability plot", map: "Map" };
type View = [x0: number, x1: number, y0: number, y1: number];

/** Outline of the marker of a group about 0, 0; size is half its width. */
function marker(g: CanvasRenderingContext2D, x: number, y: number, group: number, r: number): void {
  const polygon = (...points: number[]) => {
    g.moveTo(x + r * points[0]!, y + r * points[1]!);
    for (let i = 2; i < points.length; i += 2) g.lineTo(x + r * points[i]!, y + r * points[i + 1]!);
    g.closePath();
  };
  switch (group % 8) {
    case 1: return polygon(-0.9, -0.9, 0.9, -0.9, 0.9, 0.9, -0.9, 0.9);
    case 2: return polygon(0, -1.2, 1.1, 0.8, -1.1, 0.8);
    case 3: return polygon(0, -1.3, 1.3, 0, 0, 1.3, -1.3, 0);
    case 4: return polygon(0, 1.2, 1.1, -0.8, -1.1, -0.8);
    case 5: return polygon(-0.4, -1.2, 0.4, -1.2, 0.4, -0.4, 1.2, -0.4, 1.2, 0.4, 0.4, 0.4, 0.4, 1.2, -0.4, 1.2, -0.4, 0.4, -1.2, 0.4, -1.2, -0.4, -0.4, -0.4);
    case 6: return polygon(-1.2, 0, 0, -0.8, 1.2, 0, 0, 0.8);
    case 7: return polygon(-0.8, 0, 0, -1.2, 0.8, 0, 0, 1.2);
    default:
      g.moveTo(x + r, y);
      g.arc(x, y, r, 0, 7);
  }
}

export function chart(host: HTMLElement, data: Chart, options: Options = {}): Part<Chart> {
  const label = options.label ?? "Chart";
  const canvas = el("canvas.ce-live", { tabindex: "0", role: "img" });
  const plot = el("div.ce-plot", {}, canvas);
  const ring = el("div.ce-ring");
  const area = el("div.ce-area");
  const spoken = el("span.ce-hidden", { "aria-live": "polite" });
  const reset = button("Reset zoom", "Escape", () => zoom(null));
  const bar = el("div.ce-bar", {}, reset, button("PNG", "Download the picture", () => png(label, raster(Math.max(width, 640), 2))), button("CSV", "Download the numbers", download));
  const box = el("div.ce-chart", {}, plot, bar, spoken);
  const tooltip = tip(plot);
  plot.append(ring, area);

  let colours: Palette;
  let marks: Mark[] = [];
  let bounds: View = [0, 1, 0, 1];
  let view: View | null = null;
  let chosen: string | null = null;
  let current = -1;
  let width = 0;
  let frame = 0;
  let end = 1; // of the colours
  let axes: { x: Axis; y: Axis };
  // Of the last picture on the screen, for the pointer:
  let px: (v: number) => number, py: (v: number) => number;
  let inner = { left: 0, right: 1, top: 0, bottom: 1 };
  let scales: { x: Scale; y: Scale };

  const map = () => data.type === "map";
  const boxes = () => data.type === "bars" || data.type === "histogram";
  const grouped = () => (data.groups?.length ?? 0) > 1 && data.type !== "histogram";

  function measure(): void {
    marks = marksOf(data);
    const xs: number[] = [], ys: number[] = [];
    for (const m of marks) {
      xs.push(m.x);
      if (m.to !== undefined) xs.push(m.to);
      if (Number.isNaN(m.y)) continue;
      ys.push(m.y);
      if (m.u > 0 && data.type !== "normal") ys.push(m.y - m.u, m.y + m.u);
    }
    if (boxes()) ys.push(0);
    if (map()) for (const o of data.outline ?? []) xs.push(...o.x), ys.push(...o.y);
    else (data.type === "histogram" ? xs : ys).push(...(data.limits ?? []));
    const range = (values: number[], axis?: Axis): [number, number] => {
      if (axis?.categories) return [-0.5, axis.categories.length - 0.5];
      let low = Infinity, high = -Infinity;
      for (const v of values) (low = Math.min(low, v)), (high = Math.max(high, v));
      if (low > high) return [0, 1];
      const pad = high > low ? (high - low) * 0.05 : Math.abs(low) * 0.1 || 1;
      return [low - pad, high + pad];
    };
    axes = {
      x: data.type === "normal" ? { label: "expected of a normal distribution", unit: "σ" } : data.x,
      y: data.type === "normal" ? data.x : (data.y ?? { label: "number", unit: "" }),
    };
    bounds = [...range(xs, axes.x), ...range(ys, axes.y)];
    if (boxes() && bounds[2] < 0 && !ys.some((y) => y < 0)) bounds[2] = 0;
    if (data.type === "bars" && !axes.x.categories) (bounds[0] -= 0.5), (bounds[1] += 0.5);
    end = data.value ? extent(data.value.values) : 1;
    if (data.value && !end) end = 1;
  }

  function tall(w: number): number {
    if (!map()) return Math.round(Math.min(Math.max(w * 0.5, 250), 400));
    const [x0, x1, y0, y1] = bounds;
    return Math.round(Math.min(Math.max(((w - 70) * (y1 - y0)) / (x1 - x0) + 100, 260), Math.max(w * 0.8, 360), 640));
  }

  /** Draw the whole chart into a context of the given size, in CSS pixels; sets what the pointer needs. */
  function draw(g: CanvasRenderingContext2D, w: number, h: number, c: Palette): void {
    g.font = FONT;
    g.textBaseline = "middle";
    const [x0, x1, y0, y1] = view ?? bounds;
    // Legend, in lines as wide as the picture.
    let [lx, ly] = [4, 10];
    g.textAlign = "left";
    const entry = (text: string, size: number, symbol: (x: number) => void) => {
      const wide = g.measureText(text).width + size + 20;
      if (lx > 4 && lx + wide > w) (lx = 4), (ly += 18);
      symbol(lx);
      g.fillStyle = c.ink;
      g.fillText(text, lx + size + 4, ly);
      lx += wide;
    };
    if (grouped() && !data.value) data.groups!.forEach((name, i) => entry(name, 12, (x) => {
      g.fillStyle = c.group(i);
      g.beginPath();
      marker(g, x + 6, ly, i, 4.5);
      g.fill();
    }));
    if (data.value) {
      const v = scale({ label: data.value.label, unit: data.value.unit }, -end, end);
      const bound = plain(Number((end * v.factor).toPrecision(2)));
      entry(`\u2212${bound} to +${bound}: ${v.title}`, 90, (x) => {
        for (let i = 0; i < 90; i++) (g.fillStyle = c.diverging(i / 44.5 - 1)), g.fillRect(x + i, ly - 5, 1.5, 10);
      });
    }
    const legend = lx > 4 ? ly + 18 : 10;
    // Frame.
    const y = scale(axes.y, y0, y1);
    const yTicks = y.at(Math.max(2, Math.floor(h / 48)));
    const top = legend + 18;
    const left = Math.min(Math.ceil(Math.max(20, ...yTicks.map((t) => g.measureText(t.text).width))) + 10, w * 0.4);
    let right = w - 12;
    const x = scale(axes.x, x0, x1);
    let xTicks = x.at(8);
    const longest = (list: typeof xTicks) => Math.max(...list.map((t) => g.measureText(t.text).width), 1);
    const slot = (right - left) / Math.max(xTicks.length, 1);
    const tilted = !!axes.x.categories && longest(xTicks) + 8 > slot;
    if (!axes.x.categories) xTicks = x.at(Math.max(2, Math.floor((right - left) / (longest(xTicks) + 22))));
    const drop = tilted ? Math.min(longest(xTicks), 110) * 0.72 + 14 : 20;
    let bottom = h - drop - 20;
    // A map's frame has the shape of its area.
    const s = Math.min((right - left) / (x1 - x0), (bottom - top) / (y1 - y0));
    if (map()) (right = left + s * (x1 - x0)), (bottom = top + s * (y1 - y0));
    px = (v) => left + ((v - x0) / (x1 - x0)) * (right - left);
    py = (v) => bottom - ((v - y0) / (y1 - y0)) * (bottom - top);
    inner = { left, right, top, bottom };
    scales = { x, y };
    g.lineWidth = 1;
    g.strokeStyle = c.line;
    g.fillStyle = c.faint;
    g.beginPath();
    g.textAlign = "right";
    for (const t of yTicks) {
      const at = Math.round(py(t.value)) + 0.5;
      if (at > bottom + 1 || at < top - 1) continue;
      g.moveTo(left, at);
      g.lineTo(right, at);
      g.fillText(t.text, left - 6, at, left - 6);
    }
    let free = -Infinity;
    for (const t of xTicks) {
      const at = Math.round(px(t.value)) + 0.5;
      if (at < left - 1 || at > right + 1) continue;
      if (!axes.x.categories || data.type === "scatter") g.moveTo(at, top), g.lineTo(at, bottom);
      const wide = tilted ? 13 : g.measureText(t.text).width + 6;
      if (at - wide / 2 < free) continue;
      free = at + wide / 2;
      g.save();
      g.translate(at, bottom + 12);
      if (tilted) g.rotate(-0.8);
      g.textAlign = tilted ? "right" : "center";
      g.fillText(t.text, tilted ? 4 : Math.min(0, w - at - g.measureText(t.text).width / 2), 0, tilted ? 110 : undefined);
      g.restore();
    }
    g.stroke();
    g.strokeStyle = c.faint;
    g.strokeRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1);
    g.fillStyle = c.ink;
    g.textAlign = "right";
    g.fillText(x.title, right, bottom + drop + 11, w - 8);
    g.textAlign = "left";
    g.fillText(y.title, 4, legend + 6, w - 8);
    g.save();
    g.beginPath();
    g.rect(left, top, right - left, bottom - top);
    g.clip();
    content(g, c);
    g.restore();
  }

  const colour = (m: Mark, c: Palette) => (data.value ? (m.value === null ? c.faint : c.diverging(m.value / end)) : c.group(grouped() ? m.group : 0));

  function content(g: CanvasRenderingContext2D, c: Palette): void {
    g.strokeStyle = c.faint;
    for (const o of data.outline ?? []) {
      g.beginPath();
      o.x.forEach((v, i) => g.lineTo(px(v), py(o.y[i]!)));
      g.stroke();
    }
    const seen = marks.filter((m) => {
      const at = px(m.x);
      return at >= inner.left - 20 && at <= inner.right + 20 || m.to !== undefined || data.type === "line";
    });
    if (boxes()) {
      for (const m of seen) {
        const [a, b, t, z] = [...edges(m), py(m.y), py(0)];
        g.fillStyle = colour(m, c);
        g.fillRect(a, Math.min(t, z), Math.max(b - a, 1), Math.abs(z - t) || 1);
      }
    } else if (data.type === "line") {
      // A line for each group, broken where a value is unknown.
      for (let group = 0; group < (grouped() ? data.groups!.length : 1); group++) {
        g.strokeStyle = c.group(group);
        g.lineWidth = 1.6;
        g.beginPath();
        let pen = false;
        for (const m of seen) {
          if (grouped() && m.group !== group) continue;
          if (Number.isNaN(m.y)) pen = false;
          else if (pen) g.lineTo(px(m.x), py(m.y));
          else g.moveTo(px(m.x), py(m.y)), (pen = true);
        }
        g.stroke();
      }
    } else if (data.type === "normal" && seen.length > 2) {
      // Straight line through the quartiles.
      const [a, b] = [marks[Math.round((marks.length - 1) * 0.25)]!, marks[Math.round((marks.length - 1) * 0.75)]!];
      const slope = (b.y - a.y) / (b.x - a.x || 1);
      g.strokeStyle = c.faint;
      g.beginPath();
      for (const v of [-9, 9]) g.lineTo(px(v), py(a.y + slope * (v - a.x)));
      g.stroke();
    }
    g.lineWidth = 1;
    if (data.u && data.type !== "normal" && !map()) {
      g.globalAlpha = seen.length > 300 ? 0.35 : 0.9;
      g.strokeStyle = boxes() ? c.ink : c.faint;
      g.beginPath();
      for (const m of seen) if (m.u > 0) {
        const at = boxes() ? (edges(m)[0] + edges(m)[1]) / 2 : px(m.x);
        g.moveTo(at, py(m.y - m.u));
        g.lineTo(at, py(m.y + m.u));
        for (const end of [m.y - m.u, m.y + m.u]) g.moveTo(at - 2.5, py(end)), g.lineTo(at + 2.5, py(end));
      }
      g.stroke();
      g.globalAlpha = 1;
    }
    if (!boxes()) {
      const dense = seen.length > DENSE;
      const r = map() ? Math.min(Math.max(0.42 * Math.sqrt(((inner.right - inner.left) * (inner.bottom - inner.top)) / (seen.length || 1)), 2), 8) : seen.length > 400 ? 2.6 : 3.6;
      if (data.type !== "line" || seen.length < 80) {
        if (dense) g.globalAlpha = map() ? 1 : 0.7;
        for (const m of seen) {
          if (Number.isNaN(m.y)) continue;
          g.fillStyle = colour(m, c);
          if (dense && !map()) {
            g.fillRect(px(m.x) - 1.2, py(m.y) - 1.2, 2.4, 2.4);
            continue;
          }
          g.beginPath();
          marker(g, px(m.x), py(m.y), grouped() ? m.group : 0, r);
          g.fill();
          if (m.value === null && data.value) (g.strokeStyle = c.ink), g.stroke();
        }
        g.globalAlpha = 1;
      }
    }
    if (data.limits && !map()) {
      g.strokeStyle = c.bad;
      g.setLineDash([6, 4]);
      g.beginPath();
      for (const limit of data.limits) {
        const at = data.type === "histogram" ? px(limit) : py(limit);
        if (data.type === "histogram") g.moveTo(at, inner.top), g.lineTo(at, inner.bottom);
        else g.moveTo(inner.left, at), g.lineTo(inner.right, at);
      }
      g.stroke();
      g.setLineDash([]);
    }
    if (chosen !== null) {
      g.strokeStyle = c.ink;
      g.lineWidth = 2;
      for (const m of seen) if (m.name === chosen && m.name) {
        g.beginPath();
        if (boxes()) g.rect(edges(m)[0], Math.min(py(m.y), py(0)), edges(m)[1] - edges(m)[0], Math.abs(py(m.y) - py(0)));
        else g.arc(px(m.x), py(m.y), 7, 0, 7);
        g.stroke();
      }
    }
  }

  /** Left and right edge of a bar, px; bars of groups at one place stand side by side. */
  function edges(m: Mark): [number, number] {
    if (m.to !== undefined) return [px(m.x) + 0.5, px(m.to) - 0.5];
    const slot = Math.abs(px(1) - px(0)) * 0.8;
    const side = grouped() ? data.groups!.length : 1;
    const a = px(m.x) - slot / 2 + (grouped() ? (slot / side) * m.group : 0);
    return [a, a + Math.max(slot / side - 1, 1)];
  }

  function raster(w: number, ratio: number): HTMLCanvasElement {
    const picture = el("canvas");
    const h = tall(w);
    picture.width = w * ratio;
    picture.height = h * ratio;
    const g = picture.getContext("2d")!;
    const c = PAPER();
    g.scale(ratio, ratio);
    g.fillStyle = c.paper;
    g.fillRect(0, 0, w, h);
    draw(g, w, h, c);
    dirty(); // what the pointer needs belongs to the screen again
    return picture;
  }

  function paint(): void {
    frame = 0;
    width = plot.clientWidth;
    if (!width) return;
    const h = tall(width);
    const ratio = Math.min(devicePixelRatio || 1, 2);
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(h * ratio);
    canvas.style.height = `${h}px`;
    const g = canvas.getContext("2d")!;
    g.scale(ratio, ratio);
    draw(g, width, h, colours);
    if (current >= 0 && document.activeElement === canvas) point(current);
  }
  function dirty(): void {
    frame ||= requestAnimationFrame(paint);
  }

  const reading = (axis: Axis, s: Scale, v: number, u?: number) =>
    axis.categories ? (axis.categories[Math.round(v)] ?? "") : axis.unit === "MJD" ? instant(v).replace("T", " ") + " UTC"
      : shown(v * s.factor, u === undefined || Number.isNaN(u) ? null : u * s.factor, s.unit);

  function lines(m: Mark): string[] {
    if (m.to !== undefined) return [`${plain(m.y)} of ${data.x.values?.length}`, `${data.x.label} ${reading(axes.x, scales.x, m.x)} to ${reading(axes.x, scales.x, m.to)}`];
    const text = [`${axes.y.label} ${reading(axes.y, scales.y, m.y, data.type === "normal" ? NaN : m.u)}`];
    text.unshift(`${axes.x.label} ${data.type === "normal" ? fixed(m.x, 2) : reading(axes.x, scales.x, m.x)}`);
    if (data.value) text.push(`${data.value.label} ${shown(m.value, null, data.value.unit)}`);
    if (grouped()) text.push(data.groups![m.group] ?? "");
    return m.name ? [m.name, ...text] : text;
  }

  function nearest(x: number, y: number): number {
    let best = -1;
    let least = NEAR;
    marks.forEach((m, i) => {
      if (Number.isNaN(m.y)) return;
      let d = Math.hypot(px(m.x) - x, py(m.y) - y);
      if (boxes()) {
        const [a, b] = edges(m);
        d = x < a ? a - x : x > b ? x - b : 0;
      }
      if (d < least) (least = d), (best = i);
    });
    return best;
  }

  function place(m: Mark): [number, number] {
    return [boxes() ? (edges(m)[0] + edges(m)[1]) / 2 : px(m.x), py(m.y)];
  }

  function point(i: number): void {
    const m = marks[i];
    ring.hidden = !m;
    if (!m) return tooltip.hide();
    const [x, y] = place(m);
    ring.style.translate = `${x}px ${y}px`;
    tooltip.show(x, y, lines(m));
  }

  function zoom(next: View | null): void {
    view = next;
    reset.hidden = !next;
    point(-1);
    dirty();
  }

  function pick(i: number): void {
    const m = marks[i];
    if (!m?.name) return;
    chosen = m.name;
    announce(host, chosen, options.select);
    dirty();
  }

  function download(): void {
    const column = (key: string, axis: { label: string; unit: string }, values: Column["values"]): Column => ({ key, ...axis, kind: "number", values });
    const categories = data.x.categories;
    const xs = data.x.values ?? categories?.map((_, i) => i) ?? [];
    csv(label, { columns: [
      ...(data.name ? [column("name", { label: "name", unit: "" }, data.name)] : []),
      column("x", { label: data.x.label, unit: data.x.unit }, categories ? xs.map((v) => (v === null ? null : (categories[v] ?? v))) : xs),
      ...(data.y ? [column("y", { label: data.y.label, unit: data.y.unit }, data.y.values ?? [])] : []),
      ...(data.u ? [column("u", { label: "standard uncertainty", unit: (data.y ?? data.x).unit }, data.u)] : []),
      ...(data.value ? [column("value", data.value, data.value.values)] : []),
      ...(data.group ? [column("group", { label: "group", unit: "" }, data.group.map((k) => data.groups?.[k] ?? k))] : []),
    ] });
  }

  // Pointer: hover, click, drag to zoom.
  let from: [number, number] | null = null;
  const zooms = () => data.type === "scatter" || data.type === "line";
  const at = (event: PointerEvent): [number, number] => {
    const r = canvas.getBoundingClientRect();
    return [event.clientX - r.left, event.clientY - r.top];
  };
  const span = (a: [number, number], b: [number, number]) => {
    const [l, r] = [Math.max(Math.min(a[0], b[0]), inner.left), Math.min(Math.max(a[0], b[0]), inner.right)];
    const flat = Math.abs(a[1] - b[1]) < 12; // along x alone
    const [t, e] = flat ? [inner.top, inner.bottom] : [Math.max(Math.min(a[1], b[1]), inner.top), Math.min(Math.max(a[1], b[1]), inner.bottom)];
    return { l, r, t, e };
  };
  canvas.onpointerdown = (event) => {
    if (event.button) return;
    from = at(event);
    if (zooms()) canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = (event) => {
    if (!px) return;
    const to = at(event);
    if (from && zooms() && Math.abs(to[0] - from[0]) > 6) {
      const { l, r, t, e } = span(from, to);
      area.hidden = false;
      Object.assign(area.style, { left: `${l}px`, width: `${r - l}px`, top: `${t}px`, height: `${e - t}px` });
      point(-1);
    } else point((current = nearest(...to)));
  };
  canvas.onpointerup = (event) => {
    const to = at(event);
    if (!area.hidden && from) {
      const { l, r, t, e } = span(from, to);
      const [x0, x1, y0, y1] = view ?? bounds;
      const [vx, vy] = [(p: number) => x0 + ((p - inner.left) / (inner.right - inner.left)) * (x1 - x0), (p: number) => y0 + ((inner.bottom - p) / (inner.bottom - inner.top)) * (y1 - y0)];
      if (r - l > 6) zoom([vx(l), vx(r), vy(e), vy(t)]);
    } else if (from) pick((current = nearest(...to)));
    from = null;
    area.hidden = true;
  };
  canvas.onpointercancel = () => ((from = null), (area.hidden = true));
  canvas.onpointerleave = () => !from && point(-1);
  canvas.ondblclick = () => zoom(null);
  canvas.onblur = () => point(-1);
  canvas.onkeydown = (event) => {
    const moves: Record<string, number> = { ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity };
    const move = moves[event.key];
    if (event.key === "Escape" && view) zoom(null);
    else if (event.key === "Enter") pick(current);
    else if ((event.key === "+" || event.key === "-") && zooms()) {
      const [x0, x1, y0, y1] = view ?? bounds;
      const middle = marks[current]?.x ?? (x0 + x1) / 2;
      const f = event.key === "+" ? 0.5 : 2;
      zoom([middle + (x0 - middle) * f, middle + (x1 - middle) * f, y0, y1]);
    } else if (move !== undefined && marks.length) {
      // Along x, among the marks in sight.
      const [x0, x1] = view ?? bounds;
      const row = marks.map((_, i) => i).filter((i) => !Number.isNaN(marks[i]!.y) && marks[i]!.x >= x0 && marks[i]!.x <= x1).sort((i, j) => marks[i]!.x - marks[j]!.x);
      const k = row.indexOf(current);
      current = row[Math.min(Math.max(k < 0 && move > 0 ? 0 : k + move, 0), row.length - 1)] ?? -1;
      point(current);
      if (current >= 0) spoken.textContent = lines(marks[current]!).join(", ");
    } else return;
    event.preventDefault();
  };

  const sheet = el("img.ce-sheet", { alt: label });
  const stop = [
    onPrint(() => (sheet.src = raster(SHEET, 2.5).toDataURL()), () => sheet.removeAttribute("src")),
    onScheme(() => ((colours = palette(host)), dirty())),
  ];
  plot.append(sheet);
  const resize = new ResizeObserver(() => plot.clientWidth !== width && dirty());

  function update(next: Chart): void {
    data = next;
    measure();
    current = -1;
    box.classList.toggle("ce-zooms", zooms());
    canvas.setAttribute("aria-label", `${label}. ${KINDS[data.type]} of ${axes.y.label} against ${axes.x.label}, ${marks.length} marks. Left and right arrows move among them.`);
    point(-1);
    dirty();
  }
  host.append(box);
  area.hidden = true;
  reset.hidden = true;
  colours = palette(host);
  update(data);
  resize.observe(plot);
  return {
    update,
    select(name) {
      if (name === chosen) return;
      chosen = name;
      dirty();
    },
    destroy() {
      cancelAnimationFrame(frame);
      resize.disconnect();
      for (const end of stop) end();
      box.remove();
    },
  };
}
