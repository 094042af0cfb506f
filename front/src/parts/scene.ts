// Scene: points with 95 % ellipsoids, beams and structure in three dimensions, in raw WebGL 2.
import type { Num, Scene } from "../lib/types";
import { axesOf, fitted, matrixOf, picked, projected, type Camera } from "./camera";
import { announce, brief, button, channels, context, el, extent as spread, fill, FONT, paper, pixels, segment, stroke, surface, ticks, type Options, type Palette, type Part } from "./dom";
import { png } from "./download";
import { ellipsoids, type Ellipsoids } from "./ellipsoids";
import { drawing, type Drawn } from "./gl";
import { plain, shown } from "./number";
import { abs, ceil, clamp, hypot, known, max, min, PI, round, sqrt } from "./maths";
import "./parts.css";

const MANY = 1000; // points above which spheres are coarser, and edges not smoothed without a graphics processor
const REACH = 12; // px from a point within which it is meant
const LABELLED = 40; // members up to which the points of a group have labels
const VIEWS = { Oblique: [-0.6, 0.45], Top: [0, PI / 2], Front: [0, 0], Side: [PI / 2, 0] } as const;
const ARROWS: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const SLOW = 120; // ms of a frame above which beams wait until the scene rests
const [WIDE, HIGH] = [680, 460]; // px of a picture on paper
type Entry = [text: string, colour: string, group?: number];

export function scene(host: HTMLElement, data: Scene, options: Options = {}): Part<Scene> {
  const label = options.label ?? "Scene";
  const legend = el("div.ce-legend");
  const live = el("canvas", { "aria-hidden": true });
  const self = surface(host, "scene", label, { paint, scheme: () => ((stale = true), keys()), raster: () => composed(2) });
  const { canvas: over, stage, spoken, dirty } = self;
  const withBeams = button("Beams", () => {
    beams = !beams;
    keys();
    dirty();
  });
  stage.prepend(live);
  spoken.before(legend);
  self.bar.append(...Object.entries(VIEWS).map(([name, [yaw, pitch]]) => button(name, () => {
    camera = view(yaw, pitch, width / height || 1.5);
    dirty();
  })), withBeams, button("PNG", () => png(label, composed(2))));

  let { points, value } = data;
  let gl: WebGL2RenderingContext | null = null;
  let drawn: Drawn | null = null;
  let shape: Ellipsoids;
  let positions = new Float32Array();
  let structure: number[] = []; // segments, both ends
  let centre = [0, 0, 0];
  let extent = 1;
  let camera: Camera | null = null;
  const hidden = new Set<number>(); // groups
  let beams = true;
  let selected = -1;
  let screen = new Float32Array();
  let width = 0;
  let height = 0;
  let end = 1; // of the colours
  let stale = true; // whether buffers are
  let slow = false;
  let moving = 0;
  let lastFrame = 0;

  const groupOf = (i: number) => points.group[i] ?? 0;
  const present = (i: number) => known(positions[3 * i]) && !hidden.has(groupOf(i));
  const undetermined = (i: number) => shape.known && Number.isNaN(shape.axes[i]);
  const grade = (w: Num | undefined) => (!known(w) ? -1 : abs(w) > 3 ? 2 : abs(w) > 2 ? 1 : 0);
  const gradeColour = (k: number, c: Palette) => [c.faint, c.doubtful, c.bad][max(k, 0)]!;

  function measure(): void {
    const { name, x, y, z } = points;
    const axes = [x, y, z];
    const lines = data.lines ?? [];
    const ranges = axes.map((own, k) => {
      let [low, high] = [Infinity, -Infinity];
      for (const values of [own, ...lines.map((l) => [l.x, l.y, l.z][k]!)]) for (const v of values) if (known(v)) (low = min(low, v)), (high = max(high, v));
      return low > high ? [0, 0] : [low, high];
    });
    const middle = ranges.map(([low, high]) => (low! + high!) / 2);
    // Positions about the middle: 32 bits are then enough, whatever the frame's origin.
    if (camera) camera.target = camera.target.map((v, k) => v + centre[k]! - middle[k]!) as Camera["target"];
    centre = middle;
    extent = hypot(...ranges.map(([low, high]) => high! - low!)) || 1;
    positions = Float32Array.from({ length: 3 * name.length }, (_, k) => (axes[k % 3]![(k / 3) | 0] ?? NaN) - middle[k % 3]!);
    structure = lines.flatMap((l) => l.x.slice(1).flatMap((_, i) => [i, i + 1].flatMap((j) => [l.x[j]! - middle[0]!, l.y[j]! - middle[1]!, l.z[j]! - middle[2]!])));
    shape = ellipsoids(points, extent);
    end = spread(value?.values ?? []);
    stale = true;
  }

  function upload(c: Palette): void {
    const n = positions.length / 3;
    const tints: number[] = [];
    for (let i = 0; i < n; i++) {
      const v = value?.values[i];
      const colour = channels(!value ? c.group(groupOf(i)) : known(v) ? c.diverging(v / end) : c.faint);
      // Capped ellipsoids are half way to the ground's colour.
      tints.push(...colour.map((tint, k) => (shape.capped[i] ? (tint + channels(c.paper)[k]!) / 2 : tint)), present(i) ? 255 : 0);
    }
    // Structure first, then beams with the largest |w| last, above the others.
    const { from = [], to = [], value: ws = [] } = data.beams ?? {};
    const order = from.map((_, k) => k).sort((i, j) => abs(ws[i] ?? 0) - abs(ws[j] ?? 0));
    const ends = [...structure], at: number[] = [], hues: number[] = [], wide: number[] = [];
    for (let i = 0; i < structure.length; i += 6) at.push(-2, -2), hues.push(...channels(c.faint), 200), wide.push(14);
    const opaque = [0, 1, 2].map((k) => 255 * min(1, [0.1, 0.3, 0.7][k]! + 60 / (1 + ws.filter((w) => max(grade(w), 0) === k).length)));
    for (const k of order) {
      const [f, t, g] = [from[k]!, to[k]!, max(grade(ws[k]), 0)];
      ends.push(...positions.subarray(3 * f, 3 * f + 3), ...positions.subarray(3 * t, 3 * t + 3));
      at.push(f, t);
      hues.push(...channels(gradeColour(g, c)), present(f) && present(t) ? opaque[g]! : 0);
      wide.push(10 + 5 * g);
    }
    drawn!.fill([
      positions.map((v) => v || 0), shape.matrices, new Uint8Array(tints), Uint8Array.from({ length: n }, (_, i) => Number(undetermined(i))),
      new Float32Array(ends), new Float32Array(at), new Uint8Array(hues), new Uint8Array(wide),
    ]);
    stale = false;
  }

  function begin(): void {
    const few = points.name.length <= MANY;
    const ask = (more: WebGLContextAttributes) => live.getContext("webgl2", { alpha: false, ...more });
    gl = ask({ failIfMajorPerformanceCaveat: true }) ?? ask({ antialias: few });
    drawn = gl && drawing(gl, few);
    stale = true;
    if (drawn) return;
    stage.replaceChildren(el("p.ce-none", {}, "No WebGL 2 in this browser: the table has all points."));
    self.bar.hidden = true;
  }

  /** Camera for all points and lines. */
  const view = (yaw: number, pitch: number, aspect: number) => fitted([...positions, ...structure], yaw, pitch, aspect);

  /** Draw into both canvases at a size and a ratio. */
  function render(w: number, h: number, ratio: number, c: Palette, all: boolean): void {
    if (!drawn) return;
    camera ??= view(...VIEWS.Oblique, w / h);
    const [across, down] = [round(w * ratio), round(h * ratio)];
    if (live.width !== across) live.width = across; // clears
    if (live.height !== down) live.height = down;
    if (stale) upload(c);
    const m = matrixOf(camera, w / h, extent);
    const { back } = axesOf(camera);
    const eye = camera.target.map((v, k) => v + back[k]! * camera!.distance);
    const n = positions.length / 3;
    drawn.draw(m, eye, [w, h], ratio, selected, structure.length / 6 + (beams && all ? (data.beams?.from.length ?? 0) : 0), shape.known ? 3 : n > MANY ? 4 : 7, channels(c.paper).map((v) => v / 255));
    screen = projected(m, positions, w, h) as Float32Array<ArrayBuffer>;
    overlay(w, h, ratio, c, (hypot(m[1]!, m[5]!, m[9]!) * h) / 2 / camera.distance);
  }

  /** Labels, rings, words and directions above the picture; scale in pixels per metre at the middle. */
  function overlay(w: number, h: number, ratio: number, c: Palette, scale: number): void {
    const g = context(over, w, h, ratio);
    const write = (text: string, x: number, y: number, colour = c.ink) => {
      g.lineJoin = "round";
      g.strokeStyle = c.paper;
      g.lineWidth = 3;
      g.strokeText(text, x, y);
      g.fillStyle = colour;
      g.fillText(text, x, y);
    };
    const places = (i: number) => [screen[4 * i]!, screen[4 * i + 1]!, max(6, shape.size[i]! * screen[4 * i + 3]! + 3)] as const;
    const seen = (i: number) => i >= 0 && screen[4 * i + 2]! > 0 && present(i);
    // Labels where they find room: the chosen point, then small groups (rangers), foremost first.
    const sizes = data.groups.map(() => 0);
    points.group.forEach((k) => sizes[k]!++);
    const rank = (i: number) => (i === selected ? 0 : sizes[groupOf(i)]! + screen[4 * i + 2]! / (12 * extent + screen[4 * i + 2]!));
    const taken = [[0, h - 64, 70, h], [0, 0, 260, 40]];
    for (const i of points.name.map((_, k) => k).filter((k) => seen(k) && (k === selected || sizes[groupOf(k)]! <= LABELLED)).sort((i, j) => rank(i) - rank(j)).slice(0, 40)) {
      const name = points.name[i]!;
      const [x, y, away] = places(i);
      const wide = g.measureText(name).width;
      for (const [lx, ly] of [[x + away, y], [x - away - wide, y], [x - wide / 2, y - away - 7], [x - wide / 2, y + away + 7]] as const) {
        if (lx < 2 || lx + wide > w - 2 || ly < 8 || ly > h - 8 || taken.some((r) => lx - 2 < r[2]! && lx + wide + 2 > r[0]! && ly - 7 < r[3]! && ly + 7 > r[1]!)) continue;
        taken.push([lx - 2, ly - 7, lx + wide + 2, ly + 7]);
        write(name, lx, ly, i === selected ? c.accent : c.ink);
        break;
      }
    }
    if (seen(selected)) {
      const [x, y, r] = places(selected);
      stroke(g, c.ink, 2.5, () => g.arc(x, y, r + 2, 0, 7));
    }
    write(`frame ${data.frame}`, 8, 12, c.faint);
    if (shape.known) write(`95 % ellipsoids × ${plain(shape.factor)}${shape.capped.includes(1) ? "; pale: capped, truly larger" : ""}`, 8, 28, c.faint);
    const { right, up, back } = axesOf(camera!);
    [..."xyz"].forEach((name, k) => {
      const [x, y] = [right[k]!, -up[k]!];
      stroke(g, c.ink, 1.5, () => segment(g, 34, h - 34, 34 + 22 * x, h - 34 + 22 * y));
      if (abs(back[k]!) < 0.97) write(name, 31 + 31 * x, h - 34 + 31 * y);
    });
    const length = ticks(0, 90 / scale, 1.2).step;
    const x = w - 12 - length * scale;
    stroke(g, c.ink, 2, () => [[x, 18], [x, 12], [w - 12, 12], [w - 12, 18]].forEach(([a, b]) => g.lineTo(a!, h - b!)));
    g.textAlign = "right";
    write(brief(length, "m"), w - 14, h - 24);
  }

  function paint(w: number, now: number): void {
    width = w;
    height = round(clamp(width * 0.62, 300, 560));
    if (drawn) stage.style.height = `${height}px`;
    // In a slow renderer beams wait while the scene moves.
    if (moving && lastFrame) slow = now - lastFrame > SLOW;
    lastFrame = moving ? now : 0;
    render(width, height, pixels(), self.colours, !(slow && moving));
  }
  function moved(): void {
    clearTimeout(moving);
    moving = setTimeout(() => {
      moving = 0;
      if (slow) dirty();
    }, 180);
    hover(-1);
    dirty();
  }

  /** Both canvases and the legend in one picture on paper. */
  function composed(ratio: number): HTMLCanvasElement {
    const c = paper(host);
    const picture = el("canvas");
    const entries = keyList(c).filter((entry) => !hidden.has(entry[2]!));
    const g = context(picture, WIDE, HIGH + 22 * ceil(entries.length / 3), ratio, c.paper);
    stale = true;
    render(WIDE, HIGH, ratio, c, true);
    if (drawn) for (const layer of [live, over]) g.drawImage(layer, 0, 0, WIDE, HIGH);
    g.font = FONT;
    entries.forEach(([text, colour], i) => {
      const [x, y] = [8 + (WIDE / 3) * (i % 3), HIGH + 12 + 22 * ((i / 3) | 0)];
      if (colour) fill(g, colour, () => g.rect(x, y - 6, 14, 10));
      g.fillStyle = c.ink;
      g.fillText(text, x + 20, y, WIDE / 3 - 30);
    });
    stale = true;
    dirty();
    return picture;
  }

  /** Texts and colours of the legend, and the group that an entry switches. */
  function keyList(c: Palette): Entry[] {
    const list: Entry[] = data.groups.map((name, k) => [name, value ? "" : c.group(k), k]);
    if (value) {
      const bound = brief(end, value.unit);
      list.push([`${value.label} \u2212${bound}`, c.low], ["0", c.mid], [`+${bound}`, c.high]);
    }
    if (shape.axes.some((_, i) => undetermined(i))) list.push(["○ undetermined: no ellipsoid", ""]);
    const values = beams ? (data.beams?.value ?? []) : [];
    ["w unknown", "|w| below 2", "|w| 2 to 3", "|w| above 3"].forEach((text, k) => {
      const count = values.filter((w) => grade(w) === k - 1).length;
      if (count) list.push([`${text} (${count})`, gradeColour(k - 1, c)]);
    });
    return list;
  }

  function keys(): void {
    withBeams.hidden = !data.beams?.from.length;
    withBeams.ariaPressed = `${beams}`;
    legend.replaceChildren(...keyList(self.colours).map(([text, colour, group]) => {
      const swatch = el("i");
      swatch.style.background = colour;
      swatch.hidden = !colour;
      if (group === undefined || data.groups.length < 2) return el("span", {}, swatch, text);
      const press = button(text, () => {
        if (!hidden.delete(group)) hidden.add(group);
        stale = true;
        state();
        dirty();
      });
      const state = () => (press.ariaPressed = `${!hidden.has(group)}`);
      state();
      press.prepend(swatch);
      return press;
    }));
  }

  function lines(i: number): string[] {
    const p = points;
    const list = [p.name[i]!, ...(["x", "y", "z"] as const).map((k) => {
      const variance = p.covariance?.[`${k}${k}` as "xx"][i];
      return `${k} ${shown(p[k][i]!, known(variance) ? sqrt(variance) : null, "m")}`;
    })];
    const axis = shape.axes[i]!;
    if (undetermined(i)) list.push("undetermined: no ellipsoid");
    else if (axis > 0) list.push(`95 % half axis ${brief(axis, "m")}${shape.capped[i] ? " (drawn smaller: capped)" : ""}`);
    if (value) list.push(`${value.label} ${shown(value.values[i]!, null, value.unit)}`);
    if (p.info?.[i]) list.push(p.info[i]);
    return list;
  }

  function mark(i: number): void {
    selected = i;
    spoken.textContent = i < 0 ? "" : lines(i).join(" · ");
    dirty();
  }
  function pick(i: number): void {
    mark(i);
    if (i >= 0) announce(host, points.name[i]!, options.select);
  }
  function hover(i: number): void {
    self.show(screen[4 * i] ?? 0, screen[4 * i + 1] ?? 0, i < 0 ? [] : lines(i));
    over.style.cursor = i < 0 ? "" : "pointer";
  }
  function turn(dx: number, dy: number): void {
    camera!.yaw -= dx;
    camera!.pitch = clamp(camera!.pitch + dy, -PI / 2, PI / 2);
    moved();
  }
  function shift(dx: number, dy: number): void {
    const { right, up } = axesOf(camera!);
    const s = (camera!.distance * 0.43) / height;
    camera!.target = camera!.target.map((v, k) => v - (dx * right[k]! - dy * up[k]!) * s) as Camera["target"];
    moved();
  }
  function zoom(f: number): void {
    camera!.distance = clamp(camera!.distance * f, extent * 1e-3, extent * 12);
    moved();
  }

  // Mouse, fingers, keys ----------------------------------------------------------------------------------------------
  const fingers = new Map<number, [number, number]>();
  let travelled = 0;
  const under = ([x, y]: [number, number]) => picked(screen, shape.size, x, y, REACH, present);
  over.onpointerdown = (event) => {
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    over.setPointerCapture(event.pointerId);
    if (fingers.size < 2) travelled = 0;
  };
  over.onpointermove = (event) => {
    const to: [number, number] = [event.offsetX, event.offsetY];
    const before = fingers.get(event.pointerId);
    if (!camera) return;
    if (!before) return hover(under(to));
    const [dx, dy] = [to[0] - before[0], to[1] - before[1]];
    travelled += hypot(dx, dy);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (p: [number, number]) => hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart(before) / apart(to));
      shift(dx / 2, dy / 2);
    } else if (travelled > 4) {
      if (event.shiftKey || event.buttons & 6) shift(dx, dy);
      else turn(dx * 0.008, dy * 0.008);
    }
    fingers.set(event.pointerId, to);
  };
  over.onpointerup = over.onpointercancel = (event) => {
    if (fingers.size < 2 && travelled <= 4 && event.type === "pointerup" && !event.button) pick(under([event.offsetX, event.offsetY]));
    fingers.delete(event.pointerId);
  };
  over.onpointerleave = () => hover(-1);
  over.oncontextmenu = (event) => event.preventDefault();
  // The wheel zooms once the scene was clicked; before, the page scrolls.
  over.addEventListener("wheel", (event) => {
    if (!camera || (document.activeElement !== over && !event.ctrlKey)) return;
    event.preventDefault();
    zoom(Math.exp(clamp(event.deltaY, -120, 120) * 0.0016));
  }, { passive: false });
  function step(by: number): void {
    const n = points.name.length;
    let i = selected < 0 && by < 0 ? 0 : selected;
    for (let k = 0; k < n; k++) {
      i = (i + by + n) % n;
      if (present(i)) return pick(i);
    }
  }
  over.onkeydown = (event) => {
    const { key } = event;
    if (!camera || event.ctrlKey || event.altKey || event.metaKey) return;
    const [x, y] = ARROWS[key] ?? [0, 0];
    const by = { PageDown: 1, PageUp: -1 }[key];
    const closer = { "+": 0.85, "=": 0.85, "-": 1.18 }[key];
    if (x || y) event.shiftKey ? shift(-30 * x, -30 * y) : turn(x / 10, y / 10);
    else if (by) step(by);
    else if (closer) zoom(closer);
    else if (key === "Escape") mark(-1);
    else if (key === "Home") (camera = null), dirty();
    else return;
    event.preventDefault();
  };
  live.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    drawn = null;
    spoken.textContent = "The browser lost the picture, waiting.";
  });
  live.addEventListener("webglcontextrestored", () => {
    begin();
    mark(selected);
  });

  function update(next: Scene): void {
    const name = points.name[selected];
    data = next;
    ({ points, value } = data);
    measure();
    mark(name === undefined ? -1 : points.name.indexOf(name));
    hover(-1);
    over.ariaLabel = `${label}. ${points.name.length} points in space; the table has their values. Arrow keys turn, + and − zoom, Home shows all, Page Down and Up choose a point.`;
    keys();
  }
  begin();
  update(data);
  return {
    update,
    select(name) {
      const i = name === null ? -1 : points.name.indexOf(name);
      if (i !== selected) mark(i);
    },
    destroy() {
      clearTimeout(moving);
      gl?.getExtension("WEBGL_lose_context")?.loseContext();
      self.destroy();
    },
  };
}
