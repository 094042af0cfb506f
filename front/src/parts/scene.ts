// Scene: points with 95 % ellipsoids, beams and structure in three dimensions, in raw WebGL 2.
import type { Scene } from "../lib/types";
import { axesOf, fitted, matrixOf, picked, projected, type Camera } from "./camera";
import { announce, button, channels, el, extent as spread, onPrint, onScheme, PAPER, palette, scaled, ticks, tip, type Options, type Palette, type Part } from "./dom";
import { png } from "./download";
import { ellipsoids, type Ellipsoids } from "./ellipsoids";
import { drawing, type Drawn } from "./gl";
import { plain, shown, rounded } from "./number";
import "./parts.css";

const MANY = 1000; // points above which spheres are coarser and edges not smoothed
const REACH = 12; // px
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";
const VIEWS: [name: string, yaw: number, pitch: number][] = [["Oblique", -0.6, 0.45], ["Top", 0, Math.PI / 2], ["Front", 0, 0], ["Side", Math.PI / 2, 0]];
const SLOW = 120; // ms of a frame above which beams wait until the scene rests
const PRINT = [680, 460] as const; // px

export function scene(host: HTMLElement, data: Scene, options: Options = {}): Part<Scene> {
  const label = options.label ?? "Network";
  const live = el("canvas", { "aria-hidden": "true" });
  const over = el("canvas.ce-live", { tabindex: "0", role: "img" });
  const stage = el("div.ce-stage", {}, live, over);
  const spoken = el("p.ce-said", { "aria-live": "polite" });
  const legend = el("div.ce-legend");
  const sheet = el("img.ce-sheet", { alt: label });
  const withBeams = button("Beams", "Show or hide beams", () => ((beams = !beams), keys(), dirty()));
  const bar = el("div.ce-bar", {}, ...VIEWS.map(([name, yaw, pitch]) => button(name, `View: ${name.toLowerCase()}`, () => look(yaw, pitch))), withBeams, button("PNG", "Download the picture", () => png(label, composed(2))));
  const box = el("div.ce-scene", {}, stage, bar, legend, spoken, sheet);
  const tooltip = tip(stage);

  let gl: WebGL2RenderingContext | null = null;
  let drawn: Drawn | null = null;
  let shape: Ellipsoids;
  let positions = new Float32Array();
  let centre = [0, 0, 0];
  let extent = 1;
  let camera: Camera | null = null;
  let colours: Palette = palette(host);
  let hidden = new Set<number>(); // groups
  let beams = true;
  let selected = -1;
  let hovered = -1;
  let screen = new Float32Array();
  let width = 0;
  let height = 0;
  let frame = 0;
  let end = 1;
  let stale = true; // buffers
  let slow = false;
  let moving = 0;
  let lastFrame = 0;

  const present = (i: number) => Number.isFinite(positions[3 * i]!) && !hidden.has(data.points.group[i] ?? 0);
  const colourOf = (i: number, c: Palette) => {
    if (!data.value) return c.group(data.points.group[i] ?? 0);
    const v = data.value.values[i];
    return v === null || v === undefined ? c.faint : c.diverging(v / end);
  };
  const grade = (w: number | null | undefined) => (w === null || w === undefined ? -1 : Math.abs(w) > 3 ? 2 : Math.abs(w) > 2 ? 1 : 0);
  const gradeColour = (k: number, c: Palette) => (k === 2 ? c.bad : k === 1 ? c.c1 : c.faint);

  function measure(): void {
    const { x, y, z, name } = data.points;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const grow = (...p: (number | null | undefined)[]) => {
      if (p.some((v) => v === null || v === undefined || !Number.isFinite(v))) return;
      p.forEach((v, k) => ((low[k] = Math.min(low[k]!, v!)), (high[k] = Math.max(high[k]!, v!))));
    };
    name.forEach((_, i) => grow(x[i], y[i], z[i]));
    for (const line of data.lines ?? []) line.x.forEach((v, i) => grow(v, line.y[i], line.z[i]));
    const solid = low[0]! <= high[0]!;
    const middle = solid ? low.map((v, k) => (v + high[k]!) / 2) : [0, 0, 0];
    // Positions about the middle: 32 bits are then enough, whatever the frame's origin.
    if (camera) camera.target = camera.target.map((v, k) => v + centre[k]! - middle[k]!) as Camera["target"];
    centre = middle;
    extent = (solid && Math.hypot(...low.map((v, k) => high[k]! - v))) || 1;
    positions = Float32Array.from({ length: 3 * name.length }, (_, k) => {
      const v = [x, y, z][k % 3]![Math.floor(k / 3)];
      return v === null || v === undefined ? NaN : v - centre[k % 3]!;
    });
    shape = ellipsoids(data.points, extent);
    end = data.value ? spread(data.value.values) : 1;
    stale = true;
  }

  function fill(c: Palette): void {
    const n = data.points.name.length;
    const paint = new Map<string, number[]>();
    const rgb = (colour: string) => paint.get(colour) ?? (paint.set(colour, channels(colour)), paint.get(colour)!);
    const ground = channels(c.paper);
    const cloud = new Uint8Array(4 * n);
    const hollow = new Uint8Array(n);
    for (let i = 0; i < n; i++) {
      // Capped ellipsoids are half way to the ground's colour.
      const colour = rgb(colourOf(i, c));
      cloud.set([...colour.map((v, k) => (shape.capped[i] ? (v + ground[k]!) / 2 : v)), present(i) ? 255 : 0], 4 * i);
      hollow[i] = shape.known && Number.isNaN(shape.axes[i]) ? 1 : 0;
    }
    const b = data.beams;
    // Largest |w| last, above the others.
    const order = (b?.from ?? []).map((_, k) => k).sort((i, j) => Math.abs(b!.value[i] ?? 0) - Math.abs(b!.value[j] ?? 0));
    const light = Math.min(0.5, 0.12 + 60 / (order.length + 1));
    const [ends, at, tint, wide] = [new Float32Array(6 * order.length), new Float32Array(2 * order.length), new Uint8Array(4 * order.length), new Uint8Array(order.length)];
    order.forEach((k, i) => {
      const [f, t] = [b!.from[k]!, b!.to[k]!];
      const g = grade(b!.value[k]);
      ends.set([...positions.subarray(3 * f, 3 * f + 3), ...positions.subarray(3 * t, 3 * t + 3)], 6 * i);
      at.set([f, t], 2 * i);
      tint.set([...rgb(gradeColour(g, c)), present(f) && present(t) ? 255 * (g === 2 ? 1 : g === 1 ? 0.8 : light) : 0], 4 * i);
      wide[i] = g === 2 ? 20 : g === 1 ? 14 : 10;
    });
    const segments: number[] = [];
    for (const line of data.lines ?? []) for (let i = 1; i < line.x.length; i++) {
      for (const j of [i - 1, i]) segments.push(line.x[j]! - centre[0]!, line.y[j]! - centre[1]!, line.z[j]! - centre[2]!);
    }
    drawn?.fill({
      positions: positions.map((v) => (Number.isNaN(v) ? 0 : v)), matrices: shape.matrices, colours: cloud, hollow,
      ellipsoids: shape.known, dot: shape.known ? 3 : n > MANY ? 4 : 7,
      beams: ends, beamEnds: at, beamColours: tint, beamWide: wide, lines: new Float32Array(segments), lineColour: rgb(c.faint).map((v) => v / 255),
    });
    stale = false;
  }

  function begin(): void {
    gl = live.getContext("webgl2", { antialias: data.points.name.length <= MANY, alpha: false, preserveDrawingBuffer: false });
    drawn = gl && drawing(gl, data.points.name.length <= MANY);
    stale = true;
    if (!drawn) {
      stage.replaceChildren(el("p.ce-none", { role: "note" }, "This browser cannot draw in three dimensions (WebGL 2). The table has all points with their coordinates and uncertainties."));
      for (const child of [...bar.children]) (child as HTMLElement).hidden = true;
    }
  }

  /** Draw into both canvases at a size and a ratio. */
  function render(w: number, h: number, ratio: number, c: Palette, all: boolean): void {
    if (!drawn) return;
    camera ??= view(VIEWS[0]![1], VIEWS[0]![2], w / h);
    for (const canvas of [live, over]) {
      const [cw, ch] = [Math.round(w * ratio), Math.round(h * ratio)];
      if (canvas.width !== cw || canvas.height !== ch) (canvas.width = cw), (canvas.height = ch);
    }
    if (stale) fill(c);
    const m = matrixOf(camera, w / h, extent);
    const { back } = axesOf(camera);
    drawn.draw(m, camera.target.map((v, k) => v + back[k]! * camera!.distance), [w, h], ratio, selected, beams && all, channels(c.paper).map((v) => v / 255));
    screen = projected(m, positions, w, h) as Float32Array<ArrayBuffer>;
    overlay(w, h, ratio, c);
  }

  function overlay(w: number, h: number, ratio: number, c: Palette): void {
    const g = over.getContext("2d")!;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    g.font = FONT;
    g.textBaseline = "middle";
    g.lineJoin = "round";
    const write = (text: string, x: number, y: number, colour = c.ink) => {
      g.strokeStyle = c.paper;
      g.lineWidth = 3;
      g.strokeText(text, x, y);
      g.fillStyle = colour;
      g.fillText(text, x, y);
    };
    // Labels where they find room: the chosen point, then small groups first (rangers), foremost first.
    const sizes = data.groups.map((_, k) => data.points.group.filter((v) => v === k).length);
    const order = data.points.name.map((_, i) => i).filter((i) => screen[4 * i + 2]! > 0 && present(i) && (i === selected || sizes[data.points.group[i]!]! <= 40));
    order.sort((i, j) => Number(j === selected) - Number(i === selected) || sizes[data.points.group[i]!]! - sizes[data.points.group[j]!]! || screen[4 * i + 2]! - screen[4 * j + 2]!);
    const taken: number[][] = [[0, h - 64, 70, h], [0, 0, 240, 40]];
    for (const i of order.slice(0, 90)) {
      const [x, y, wide] = [screen[4 * i]!, screen[4 * i + 1]!, g.measureText(data.points.name[i]!).width];
      const away = Math.max(6, shape.size[i]! * screen[4 * i + 3]! + 3);
      for (const [lx, ly] of [[x + away, y], [x - away - wide, y], [x - wide / 2, y - away - 7], [x - wide / 2, y + away + 7]] as const) {
        const room = [lx - 2, ly - 7, lx + wide + 2, ly + 7];
        if (lx < 2 || lx + wide > w - 2 || ly < 8 || ly > h - 8 || taken.some((r) => room[0]! < r[2]! && room[2]! > r[0]! && room[1]! < r[3]! && room[3]! > r[1]!)) continue;
        taken.push(room);
        write(data.points.name[i]!, lx, ly, i === selected ? c.accent : c.ink);
        break;
      }
    }
    for (const [i, dash] of [[selected, []], [hovered, [3, 3]]] as [number, number[]][]) {
      if (i < 0 || !(screen[4 * i + 2]! > 0) || !present(i)) continue;
      g.strokeStyle = c.ink;
      g.lineWidth = 2;
      g.setLineDash(dash);
      g.beginPath();
      g.arc(screen[4 * i]!, screen[4 * i + 1]!, Math.max(8, shape.size[i]! * screen[4 * i + 3]! + 3), 0, 7);
      g.stroke();
      g.setLineDash([]);
    }
    // In words: frame and enlargement; length and directions.
    write(`frame ${data.frame}`, 8, 12, c.faint);
    if (shape.known) write(`95 % ellipsoids × ${plain(shape.factor)}${shape.capped.some(Boolean) ? "; pale: capped, true size larger" : ""}`, 8, 28, c.faint);
    const { right, up, back } = axesOf(camera!);
    [0, 1, 2].sort((i, j) => back[i]! - back[j]!).forEach((k) => {
      const [x, y] = [34 + 22 * right[k]!, h - 34 - 22 * up[k]!];
      g.strokeStyle = g.fillStyle = c.ink;
      g.lineWidth = 1.5;
      g.beginPath();
      g.moveTo(34, h - 34);
      g.lineTo(x, y);
      g.stroke();
      g.textAlign = "center";
      if (Math.abs(back[k]!) < 0.97) write("xyz"[k]!, 34 + 31 * right[k]!, h - 34 - 31 * up[k]!);
      g.textAlign = "left";
    });
    const scaleAt = (Math.hypot(...[1, 5, 9].map((k) => matrixOf(camera!, w / h, extent)[k]!)) * h) / 2 / camera!.distance;
    const length = ticks(0, 90 / scaleAt, 1.2).step;
    const [factor, unit] = scaled(length, "m");
    const x = w - 12 - length * scaleAt;
    g.strokeStyle = c.ink;
    g.beginPath();
    for (const [px, py] of [[x, h - 18], [x, h - 12], [w - 12, h - 12], [w - 12, h - 18]] as const) g.lineTo(px, py);
    g.stroke();
    g.textAlign = "right";
    write(`${plain(length * factor)} ${unit}`, w - 14, h - 24);
    g.textAlign = "left";
  }

  function paint(now: number): void {
    frame = 0;
    width = stage.clientWidth;
    if (!width || !drawn) return;
    height = Math.round(Math.min(Math.max(width * 0.62, 300), 560));
    stage.style.height = `${height}px`;
    // In a slow renderer beams wait while the scene moves.
    if (moving && lastFrame) slow = now - lastFrame > SLOW;
    lastFrame = moving ? now : 0;
    render(width, height, Math.min(devicePixelRatio || 1, 2), colours, !(slow && moving));
  }
  function dirty(): void {
    frame ||= requestAnimationFrame(paint);
  }
  function move(): void {
    clearTimeout(moving);
    moving = setTimeout(() => ((moving = 0), slow && dirty()), 180);
    tooltip.hide();
    hovered = -1;
    dirty();
  }

  /** Both canvases and the legend in one picture on paper. */
  function composed(ratio: number): HTMLCanvasElement {
    const c = PAPER();
    const picture = el("canvas");
    const [w, h] = PRINT;
    const entries = keyList(c);
    picture.width = w * ratio;
    picture.height = (h + 22 * Math.ceil(entries.length / 3)) * ratio;
    const g = picture.getContext("2d")!;
    g.fillStyle = c.paper;
    g.fillRect(0, 0, picture.width, picture.height);
    stale = true;
    render(w, h, ratio, c, true);
    for (const canvas of [live, over]) if (drawn) g.drawImage(canvas, 0, 0);
    g.scale(ratio, ratio);
    g.font = FONT;
    entries.forEach(([text, colour], i) => {
      const [x, y] = [8 + (w / 3) * (i % 3), h + 14 + 22 * Math.floor(i / 3)];
      g.fillStyle = colour || c.paper;
      g.fillRect(x, y - 8, 16, 10);
      g.fillStyle = c.ink;
      g.fillText(text, x + 22, y, w / 3 - 30);
    });
    stale = true;
    dirty();
    return picture;
  }

  /** Texts and colours of the legend; the group where an entry can be switched off. */
  function keyList(c: Palette): [text: string, colour: string, group: number | null][] {
    const list: [string, string, number | null][] = data.groups.map((name, k) => [name, data.value ? c.faint : c.group(k), k]);
    if (data.value) {
      const [factor, unit] = scaled(end, data.value.unit);
      for (const s of [-1, 0, 1]) list.push([`${data.value.label} ${s ? (s < 0 ? "≤ \u2212" : "≥ +") + plain(Number((end * factor).toPrecision(2))) : 0} ${unit}`, c.diverging(s), null]);
    }
    if (data.points.name.some((_, i) => shape.known && Number.isNaN(shape.axes[i]))) list.push(["○ undetermined: no ellipsoid", "", null]);
    const values = beams ? (data.beams?.value ?? []) : [];
    const count = (k: number) => values.filter((w) => grade(w) === k).length;
    if (values.length) {
      list.push([`|w| below 2 (${count(0)})`, gradeColour(0, c), null], [`|w| 2 to 3 (${count(1)})`, gradeColour(1, c), null], [`|w| above 3 (${count(2)})`, gradeColour(2, c), null]);
      if (count(-1)) list.push([`w unknown (${count(-1)})`, c.faint, null]);
    }
    return list;
  }

  function keys(): void {
    withBeams.hidden = !data.beams?.from.length;
    withBeams.setAttribute("aria-pressed", String(beams));
    legend.replaceChildren(...keyList(colours).map(([text, colour, group]) => {
      const swatch = el("i");
      swatch.style.background = colour;
      swatch.hidden = !colour;
      if (group === null || data.groups.length < 2) return el("span", {}, swatch, text);
      const press = button("", "Show or hide this group", () => {
        if (!hidden.delete(group)) hidden.add(group);
        stale = true;
        keys();
        (legend.children[group] as HTMLElement | undefined)?.focus();
        dirty();
      });
      press.append(swatch, text);
      press.setAttribute("aria-pressed", String(!hidden.has(group)));
      return press;
    }));
  }

  function lines(i: number): string[] {
    const p = data.points;
    const c = p.covariance;
    const place = (["x", "y", "z"] as const).map((k) => {
      const variance = c?.[(k + k) as "xx"][i];
      return `${k} ${shown(p[k][i] ?? null, variance && variance > 0 ? Math.sqrt(variance) : null, "m")}`;
    });
    const out = [p.name[i]!, ...place];
    if (shape.known) {
      const longest = shape.axes[i]!;
      const [f, unit] = scaled(longest, "m");
      out.push(Number.isNaN(longest) ? "undetermined: no ellipsoid" : `95 % half axis ${longest > 0 ? rounded(longest * f, Math.max(0, 1 - Math.floor(Math.log10(longest * f)))) : 0} ${unit}${shape.capped[i] ? " (drawn smaller: capped)" : ""}`);
    }
    if (data.value) out.push(`${data.value.label} ${shown(data.value.values[i] ?? null, null, data.value.unit)}`);
    if (p.info?.[i]) out.push(p.info[i]);
    return out;
  }

  function mark(i: number): void {
    selected = i;
    spoken.textContent = i < 0 ? "" : lines(i).join(" · ");
    dirty();
  }
  function pick(i: number): void {
    mark(i);
    if (i >= 0) announce(host, data.points.name[i]!, options.select);
  }
  function look(yaw: number, pitch: number): void {
    camera = view(yaw, pitch, width / height || 1.5);
    dirty();
  }
  /** Camera for all points and lines. */
  function view(yaw: number, pitch: number, aspect: number): Camera {
    const structure = (data.lines ?? []).flatMap((l) => l.x.flatMap((v, i) => [v - centre[0]!, l.y[i]! - centre[1]!, l.z[i]! - centre[2]!]));
    return fitted([...positions, ...structure], yaw, pitch, aspect);
  }
  function turn(dx: number, dy: number): void {
    camera!.yaw -= dx;
    camera!.pitch = Math.min(Math.max(camera!.pitch + dy, -Math.PI / 2), Math.PI / 2);
    move();
  }
  function shift(dx: number, dy: number): void {
    const { right, up } = axesOf(camera!);
    const s = (camera!.distance * 0.43) / height;
    camera!.target = camera!.target.map((v, k) => v - (dx * right[k]! - dy * up[k]!) * s) as Camera["target"];
    move();
  }
  function zoom(f: number): void {
    camera!.distance = Math.min(Math.max(camera!.distance * f, extent * 1e-3), extent * 12);
    move();
  }

  // Mouse and fingers -------------------------------------------------------------------------------------------------
  const fingers = new Map<number, [number, number]>();
  let travelled = 0;
  const at = (event: PointerEvent): [number, number] => {
    const r = over.getBoundingClientRect();
    return [event.clientX - r.left, event.clientY - r.top];
  };
  const under = ([x, y]: [number, number]) => picked(screen, shape.size, x, y, REACH, present);
  over.onpointerdown = (event) => {
    fingers.set(event.pointerId, at(event));
    over.setPointerCapture(event.pointerId);
    if (fingers.size === 1) travelled = 0;
  };
  over.onpointermove = (event) => {
    const to = at(event);
    const before = fingers.get(event.pointerId);
    if (!before) {
      const i = under(to);
      if (i >= 0) tooltip.show(...to, lines(i));
      else tooltip.hide();
      if (i !== hovered) (hovered = i), over.width && overlay(width, height, over.width / width, colours);
      over.style.cursor = i >= 0 ? "pointer" : "grab";
      return;
    }
    const [dx, dy] = [to[0] - before[0], to[1] - before[1]];
    travelled += Math.hypot(dx, dy);
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)![1];
      const apart = (p: [number, number]) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart(before) / apart(to));
      shift(dx / 2, dy / 2);
    } else if (travelled > 4) {
      if (event.shiftKey || event.buttons & 6) shift(dx, dy);
      else turn(dx * 0.008, dy * 0.008);
    }
    fingers.set(event.pointerId, to);
  };
  over.onpointerup = over.onpointercancel = (event) => {
    const clicked = fingers.size === 1 && travelled <= 4 && event.type === "pointerup" && event.button === 0;
    fingers.delete(event.pointerId);
    if (!clicked) return;
    const i = under(at(event));
    if (i >= 0) pick(i);
    else mark(-1);
  };
  over.onpointerleave = () => {
    tooltip.hide();
    if (hovered >= 0) (hovered = -1), dirty();
  };
  over.oncontextmenu = (event) => event.preventDefault();
  // The wheel zooms once the scene was clicked; else the page scrolls.
  over.addEventListener("wheel", (event) => {
    if (document.activeElement !== over && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(Math.min(Math.max(event.deltaY, -120), 120) * 0.0016));
  }, { passive: false });
  over.onkeydown = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !camera) return;
    const [x, y] = ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] } as Record<string, [number, number]>)[event.key] ?? [0, 0];
    const step = { PageDown: 1, PageUp: -1 }[event.key];
    if (x || y) event.shiftKey ? shift(-x * 30, -y * 30) : turn(x * 0.1, y * 0.1);
    else if (event.key === "+" || event.key === "=") zoom(0.85);
    else if (event.key === "-") zoom(1.18);
    else if (event.key === "Home") look(VIEWS[0]![1], VIEWS[0]![2]);
    else if (event.key === "Escape") mark(-1);
    else if (step) {
      const n = data.points.name.length;
      for (let k = 1, i = selected; k <= n; k++) {
        i = (i + step + (i < 0 && step < 0 ? 1 : 0) + n) % n;
        if (present(i)) {
          pick(i);
          break;
        }
      }
    } else return;
    event.preventDefault();
  };
  live.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    drawn = null;
    spoken.textContent = "The graphics system took the picture away; waiting for it.";
  });
  live.addEventListener("webglcontextrestored", () => {
    spoken.textContent = "";
    begin();
    dirty();
  });

  const stop = [
    onPrint(() => (sheet.src = composed(2).toDataURL()), () => (sheet.removeAttribute("src"), dirty())),
    onScheme(() => ((colours = palette(host)), (stale = true), keys(), dirty())),
  ];
  const resize = new ResizeObserver(() => stage.clientWidth !== width && dirty());

  function update(next: Scene): void {
    const name = selected >= 0 ? data.points.name[selected] : null;
    data = next;
    hovered = -1;
    measure();
    mark(name ? data.points.name.indexOf(name) : -1);
    over.setAttribute("aria-label", `${label}. ${data.points.name.length} points in three dimensions; the table has their values. Arrow keys turn, plus and minus zoom, Home shows all, Page Down and Page Up choose a point.`);
    keys();
    dirty();
  }
  host.append(box);
  begin();
  update(data);
  resize.observe(stage);
  return {
    update,
    select(name) {
      const i = name === null ? -1 : data.points.name.indexOf(name);
      if (i !== selected) mark(i);
    },
    destroy() {
      cancelAnimationFrame(frame);
      clearTimeout(moving);
      resize.disconnect();
      for (const end of stop) end();
      gl?.getExtension("WEBGL_lose_context")?.loseContext();
      box.remove();
    },
  };
}
