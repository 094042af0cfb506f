// Chart on a canvas: marks with uncertainties, hover, keyboard, zoom, downloads, paper.
import type { Axis, Chart, Column } from "../lib/types";
import { instant, scale, type Scale } from "./axes";
import { announce, brief, button, context, el, extent, fill, paper, pixels, segment, stroke, surface, type Options, type Palette, type Part } from "./dom";
import { csv, png } from "./download";
import { marksOf, type Mark } from "./marks";
import { fixed, plain, shown } from "./number";
import { abs, ceil, clamp, floor, hypot, known, max, min, round, sqrt } from "./maths";
import "./parts.css";

const NEAR = 24; // px from the pointer within which a mark is hovered
const CROWDED = 1500; // marks above which they are small squares without uncertainties; those come with the zoom
const SHEET = 680; // px wide on paper
type View = [x0: number, x1: number, y0: number, y1: number];

// Outlines of the markers of groups: x, y in tenths of half the width; none: a circle.
const MARKERS = ["", "-9 -9 9 -9 9 9 -9 9", "0 -12 11 8 -11 8", "0 -13 13 0 0 13 -13 0", "0 12 11 -8 -11 -8", "-4 -12 4 -12 4 -4 12 -4 12 4 4 4 4 12 -4 12 -4 4 -12 4 -12 -4 -4 -4", "-12 0 0 -8 12 0 0 8", "-8 0 0 -12 8 0 0 12"]
  .map((text) => text.split(" ").map(Number));

function marker(g: CanvasRenderingContext2D, x: number, y: number, group: number, r: number): void {
  const outline = MARKERS[group % 8]!;
  if (outline.length < 2) return g.arc(x, y, r, 0, 7);
  for (let i = 0; i < outline.length; i += 2) g.lineTo(x + (r * outline[i]!) / 10, y + (r * outline[i + 1]!) / 10);
}

export function chart(host: HTMLElement, data: Chart, options: Options = {}): Part<Chart> {
  const label = options.label ?? "Chart";
  const self = surface(host, "chart", label, { paint, raster: () => raster(SHEET, 2.5) });
  const { canvas, stage, dirty } = self;
  const area = el("div.ce-area");
  const reset = button("Reset zoom", () => zoom(null));
  self.bar.append(reset, button("PNG", () => png(label, raster(900, 2))), button("CSV", download));
  self.spoken.classList.add("ce-hidden");
  stage.append(area);

  // Kinds of charts, set by the data:
  let scatter: boolean, line: boolean, bars: boolean, histogram: boolean, normal: boolean, map: boolean, boxes: boolean, grouped: boolean, zooms: boolean;
  let marks: Mark[] = [];
  let bounds: View = [0, 1, 0, 1];
  let view: View | null = null;
  let chosen: string | null = null;
  let current = -1;
  let end = 1; // of the colours
  let axes: { x: Axis; y: Axis };
  // Of the last picture on the screen, for the pointer:
  let px: (v: number) => number, py: (v: number) => number;
  let inner = { left: 0, right: 1, top: 0, bottom: 1 };
  let scales: { x: Scale; y: Scale };


  function measure(): void {
    [scatter, line, bars, histogram, normal, map] = ["scatter", "line", "bars", "histogram", "normal", "map"].map((type) => type === data.type) as [boolean, boolean, boolean, boolean, boolean, boolean];
    boxes = bars || histogram;
    zooms = scatter || line;
    grouped = (data.groups?.length ?? 0) > 1 && !histogram;
    marks = marksOf(data);
    const xs: number[] = [], ys: number[] = [];
    for (const m of marks) {
      xs.push(m.x);
      if (m.to !== undefined) xs.push(m.to);
      if (!known(m.y)) continue;
      ys.push(m.y);
      if (m.u > 0 && !normal) ys.push(m.y - m.u, m.y + m.u);
    }
    if (boxes) ys.push(0);
    if (map) for (const o of data.outline ?? []) xs.push(...o.x), ys.push(...o.y);
    else (histogram ? xs : ys).push(...(data.limits ?? []));
    const range = (values: number[], axis?: Axis): [number, number] => {
      if (axis?.categories) return [-0.5, axis.categories.length - 0.5];
      let low = Infinity, high = -Infinity;
      for (const v of values) (low = min(low, v)), (high = max(high, v));
      if (low > high) return [0, 1];
      const pad = high > low ? (high - low) * 0.05 : abs(low) * 0.1 || 1;
      return [low - pad, high + pad];
    };
    axes = {
      x: normal ? { label: "expected of a normal distribution", unit: "σ" } : data.x,
      y: normal ? data.x : (data.y ?? { label: "number", unit: "" }),
    };
    bounds = [...range(xs, axes.x), ...range(ys, axes.y)];
    if (boxes && bounds[2] < 0 && !ys.some((y) => y < 0)) bounds[2] = 0;
    if (bars && !axes.x.categories) (bounds[0] -= 0.5), (bounds[1] += 0.5);
    end = extent(data.value?.values ?? []);
  }

  function tall(w: number): number {
    if (!map) return round(clamp(w * 0.5, 250, 400));
    const [x0, x1, y0, y1] = bounds;
    return round(min(max(((w - 70) * (y1 - y0)) / (x1 - x0) + 100, 260), max(w * 0.8, 360), 640));
  }

  /** Draw the whole chart into a context of the given size, in CSS pixels; sets what the pointer needs. */
  function draw(g: CanvasRenderingContext2D, w: number, h: number, c: Palette): void {
    const [x0, x1, y0, y1] = view ?? bounds;
    const wide = (text: string) => g.measureText(text).width;
    const longest = (list: { text: string }[]) => max(...list.map((t) => wide(t.text)), 20);
    // Legend, in lines as wide as the picture.
    let [lx, ly] = [4, 10];
    g.textAlign = "left";
    const entry = (text: string, size: number, symbol: (x: number) => void) => {
      const room = wide(text) + size + 20;
      if (lx > 4 && lx + room > w) (lx = 4), (ly += 18);
      symbol(lx);
      g.fillStyle = c.ink;
      g.fillText(text, lx + size + 4, ly, w - size - 8);
      lx += room;
    };
    if (grouped && !data.value) data.groups!.forEach((name, i) => entry(name, 12, (x) => fill(g, c.group(i), () => marker(g, x + 6, ly, i, 4.5))));
    if (data.value) entry(`${data.value.label} ±${brief(end, data.value.unit)}`, 60, (x) => {
      for (let i = 0; i < 60; i++) fill(g, c.diverging(i / 30 - 1), () => g.rect(x + i, ly - 5, 2, 10));
    });
    const legend = lx > 4 ? ly + 18 : 10;
    // Frame.
    const y = scale(axes.y, y0, y1);
    const yTicks = y.at(max(2, floor(h / 48)));
    const top = legend + 18;
    const left = min(ceil(longest(yTicks)) + 10, w * 0.4);
    // A map's frame has the shape of its area.
    const right = map ? min(w - 12, left + ((h - 40 - top) * (x1 - x0)) / (y1 - y0)) : w - 12;
    const x = scale(axes.x, x0, x1);
    let xTicks = x.at(8);
    const slot = (right - left) / max(xTicks.length, 1);
    const tilted = !!axes.x.categories && longest(xTicks) + 8 > slot;
    if (!axes.x.categories) xTicks = x.at(max(2, floor((right - left) / (longest(xTicks) + 22))));
    const drop = tilted ? min(longest(xTicks), 110) * 0.72 + 14 : 20;
    const bottom = map ? top + ((right - left) * (y1 - y0)) / (x1 - x0) : h - drop - 20;
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
      const at = round(py(t.value)) + 0.5;
      if (at > bottom + 1 || at < top - 1) continue;
      segment(g, left, at, right, at);
      g.fillText(t.text, left - 6, at, left - 6);
    }
    let free = -Infinity;
    for (const t of xTicks) {
      const at = round(px(t.value)) + 0.5;
      if (at < left - 1 || at > right + 1) continue;
      const half = tilted ? 8 : wide(t.text) / 2 + 3;
      if (at - half < free) continue;
      free = at + half;
      if (!axes.x.categories || scatter) segment(g, at, top, at, bottom);
      g.save();
      g.translate(at, bottom + 12);
      if (tilted) g.rotate(-0.8);
      g.textAlign = tilted ? "right" : "center";
      g.fillText(t.text, tilted ? 4 : min(0, w - at - half), 0, tilted ? 110 : undefined);
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

  const colour = (m: Mark, c: Palette) => (data.value ? (m.value === null ? c.faint : c.diverging(m.value / end)) : c.group(grouped ? m.group : 0));

  function content(g: CanvasRenderingContext2D, c: Palette): void {
    const { left, right, top, bottom } = inner;
    for (const o of data.outline ?? []) stroke(g, c.faint, 1, () => o.x.forEach((v, i) => g.lineTo(px(v), py(o.y[i]!))));
    const seen = marks.filter((m) => line || boxes || abs(px(m.x) - (left + right) / 2) < (right - left) / 2 + 20);
    const solid = (m: Mark) => {
      const [[a, b], t, z] = [edges(m), py(m.y), py(0)];
      g.rect(a, min(t, z), max(b - a, 1), max(abs(z - t), 1));
    };
    if (boxes) for (const m of seen) fill(g, colour(m, c), () => solid(m));
    if (line) (grouped ? data.groups! : [""]).forEach((_, group) => stroke(g, c.group(group), 1.6, () => {
      // Broken where a value is unknown.
      let pen = false;
      for (const m of seen) if (!grouped || m.group === group) {
        if (pen && known(m.y)) g.lineTo(px(m.x), py(m.y));
        else g.moveTo(px(m.x), py(m.y));
        pen = known(m.y);
      }
    }));
    if (normal && seen.length > 2) {
      // Straight line through the quartiles.
      const [a, b] = [0.25, 0.75].map((q) => marks[round((marks.length - 1) * q)]!) as [Mark, Mark];
      const slope = (b.y - a.y) / (b.x - a.x || 1);
      stroke(g, c.faint, 1, () => [-9, 9].forEach((v) => g.lineTo(px(v), py(a.y + slope * (v - a.x)))));
    }
    if (!normal && !map && seen.length < CROWDED) {
      g.globalAlpha = seen.length > 300 ? 0.35 : 0.9;
      stroke(g, boxes ? c.ink : c.faint, 1, () => {
        for (const m of seen) if (m.u > 0) {
          const at = place(m)[0];
          const [low, high] = [py(m.y - m.u), py(m.y + m.u)];
          for (const [x, y, z] of [[0, low, high], [2.5, low, low], [2.5, high, high]] as const) segment(g, at - x, y, at + x, z);
        }
      });
      g.globalAlpha = 1;
    }
    if (!boxes && (!line || seen.length < 80)) {
      const dense = seen.length > CROWDED && !map;
      const r = map ? clamp(0.42 * sqrt(((right - left) * (bottom - top)) / (seen.length || 1)), 2, 8) : seen.length > 400 ? 2.6 : 3.6;
      for (const m of seen) if (known(m.y)) {
        const [x, y] = place(m);
        g.fillStyle = colour(m, c);
        if (dense) g.fillRect(x - 1, y - 1, 2, 2);
        else fill(g, g.fillStyle as string, () => marker(g, x, y, grouped ? m.group : 0, r));
      }
    }
    g.setLineDash([6, 4]);
    if (!map) stroke(g, c.bad, 1, () => (data.limits ?? []).forEach((limit) => {
      if (histogram) segment(g, px(limit), top, px(limit), bottom);
      else segment(g, left, py(limit), right, py(limit));
    }));
    g.setLineDash([]);
    if (chosen) for (const m of seen) if (m.name === chosen) stroke(g, c.ink, 2, () => (boxes ? solid(m) : g.arc(...place(m), 7, 0, 7)));
  }

  /** Left and right edge of a bar, px; bars of groups at one place stand side by side. */
  function edges(m: Mark): [number, number] {
    if (m.to !== undefined) return [px(m.x) + 0.5, px(m.to) - 0.5];
    const slot = abs(px(1) - px(0)) * 0.8;
    const side = grouped ? data.groups!.length : 1;
    const a = px(m.x) - slot / 2 + (grouped ? (slot / side) * m.group : 0);
    return [a, a + max(slot / side - 1, 1)];
  }

  function raster(w: number, ratio: number): HTMLCanvasElement {
    const picture = el("canvas");
    const c = paper(host);
    draw(context(picture, w, tall(w), ratio, c.paper), w, tall(w), c);
    dirty(); // what the pointer needs belongs to the screen again
    return picture;
  }

  function paint(width: number): void {
    const h = tall(width);
    canvas.style.height = `${h}px`;
    draw(context(canvas, width, h, pixels()), width, h, self.colours);
  }

  const reading = (axis: Axis, s: Scale, v: number, u?: number) =>
    axis.categories ? (axis.categories[round(v)] ?? "") : axis.unit === "MJD" ? instant(v).replace("T", " ") + " UTC"
      : shown(v * s.factor, u === undefined || Number.isNaN(u) ? null : u * s.factor, s.unit);

  function lines(m: Mark): string[] {
    if (m.to !== undefined) return [`${plain(m.y)} of ${data.x.values?.length}`, `${data.x.label} ${reading(axes.x, scales.x, m.x)} to ${reading(axes.x, scales.x, m.to)}`];
    const text = [`${axes.y.label} ${reading(axes.y, scales.y, m.y, normal ? NaN : m.u)}`];
    text.unshift(`${axes.x.label} ${normal ? fixed(m.x, 2) : reading(axes.x, scales.x, m.x)}`);
    if (data.value) text.push(`${data.value.label} ${shown(m.value, null, data.value.unit)}`);
    if (grouped) text.push(data.groups![m.group] ?? "");
    return m.name ? [m.name, ...text] : text;
  }

  function nearest(x: number, y: number): number {
    let best = -1;
    let least = NEAR;
    marks.forEach((m, i) => {
      if (!known(m.y)) return;
      let d = hypot(px(m.x) - x, py(m.y) - y);
      if (boxes) {
        const [a, b] = edges(m);
        d = x < a ? a - x : x > b ? x - b : 0;
      }
      if (d < least) (least = d), (best = i);
    });
    return best;
  }

  function place(m: Mark): [number, number] {
    const [a, b] = boxes ? edges(m) : [px(m.x), px(m.x)];
    return [(a + b) / 2, py(m.y)];
  }

  function point(i: number): void {
    const m = marks[i];
    if (m) self.show(...place(m), lines(m));
    else self.show(0, 0, []);
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
    const { x, y, value } = data;
    const xs = x.values ?? x.categories!.map((_, i) => i);
    const list: [label: string, unit: string, values?: Column["values"]][] = [
      ["name", "", data.name],
      [x.label, x.unit, x.categories ? xs.map((v) => x.categories![v!] ?? v) : xs],
      [y?.label ?? "", y?.unit ?? "", y?.values],
      ["standard uncertainty", (y ?? x).unit, data.u],
      [value?.label ?? "", value?.unit ?? "", value?.values],
      ["group", "", data.group?.map((k) => data.groups?.[k] ?? k)],
    ];
    csv(label, { columns: list.filter((c) => c[2]).map(([label, unit, values]) => ({ key: label, label, unit, kind: "number", values: values! })) });
  }

  // Pointer: hover, click, drag to zoom.
  let from: [number, number] | null = null;
  let drag: View | null = null; // px
  canvas.onpointerdown = (event) => {
    if (event.button) return;
    from = [event.offsetX, event.offsetY];
    if (zooms) canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = ({ offsetX: x, offsetY: y }) => {
    if (!px) return;
    if (from && zooms && abs(x - from[0]) > 6) {
      const { left, right, top, bottom } = inner;
      const [x0, x1] = [from[0], x].map((v) => clamp(v, left, right)).sort((a, b) => a - b) as [number, number];
      // A flat box zooms along x alone.
      const [y0, y1] = (abs(y - from[1]) < 12 ? [top, bottom] : [from[1], y]).map((v) => clamp(v, top, bottom)).sort((a, b) => a - b) as [number, number];
      drag = [x0, x1, y0, y1];
      area.hidden = false;
      Object.assign(area.style, { translate: `${x0}px ${y0}px`, width: `${x1 - x0}px`, height: `${y1 - y0}px` });
      point(-1);
    } else point((current = nearest(x, y)));
  };
  canvas.onpointerup = canvas.onpointercancel = ({ offsetX, offsetY, type }) => {
    if (type === "pointerup" && drag) {
      const { left, right, top, bottom } = inner;
      const [x0, x1, y0, y1] = view ?? bounds;
      const [vx, vy] = [(p: number) => x0 + ((p - left) / (right - left)) * (x1 - x0), (p: number) => y0 + ((bottom - p) / (bottom - top)) * (y1 - y0)];
      zoom([vx(drag[0]), vx(drag[1]), vy(drag[3]), vy(drag[2])]);
    } else if (type === "pointerup" && from) {
      point((current = nearest(offsetX, offsetY)));
      pick(current);
    }
    from = drag = null;
    area.hidden = true;
  };
  canvas.onpointerleave = ({ pointerType }) => pointerType === "mouse" && point(-1); // a finger's tool tip stays
  canvas.onblur = () => point(-1);
  canvas.onkeydown = (event) => {
    const moves: Record<string, number> = { ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity };
    const move = moves[event.key];
    if (event.key === "Escape" && view) zoom(null);
    else if (event.key === "Enter") pick(current);
    else if ((event.key === "+" || event.key === "-") && zooms) {
      const [x0, x1, y0, y1] = view ?? bounds;
      const middle = marks[current]?.x ?? (x0 + x1) / 2;
      const f = event.key === "+" ? 0.5 : 2;
      zoom([middle + (x0 - middle) * f, middle + (x1 - middle) * f, y0, y1]);
    } else if (move !== undefined && marks.length) {
      // Along x, among the marks in sight.
      const [x0, x1] = view ?? bounds;
      const row = marks.map((_, i) => i).filter((i) => known(marks[i]!.y) && marks[i]!.x >= x0 && marks[i]!.x <= x1).sort((i, j) => marks[i]!.x - marks[j]!.x);
      const k = row.indexOf(current);
      current = row[clamp(k < 0 && move > 0 ? 0 : k + move, 0, row.length - 1)] ?? -1;
      point(current);
      if (current >= 0) self.spoken.textContent = lines(marks[current]!).join(", ");
    } else return;
    event.preventDefault();
  };

  function update(next: Chart): void {
    data = next;
    measure();
    current = -1;
    stage.classList.toggle("ce-zooms", zooms);
    canvas.ariaLabel = `${label}. Chart (${data.type}): ${axes.y.label} against ${axes.x.label}, ${marks.length} marks. Left and right arrows move among them.`;
    point(-1);
    dirty();
  }
  area.hidden = true;
  reset.hidden = true;
  update(data);
  return {
    update,
    select(name) {
      if (name === chosen) return;
      chosen = name;
      dirty();
    },
    destroy: self.destroy,
  };
}
