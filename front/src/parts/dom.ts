// What the parts share: elements, tool tips, colours, printing, ticks.
import { abs, ceil, floor, known, log10, max, min, round } from "./maths";
export interface Options { select?: (name: string) => void; label?: string }
export interface Part<T> { update(data: T): void; select(name: string | null): void; destroy(): void }

type Attributes = Record<string, string | number | boolean>;
type Child = Node | string | null | undefined | false;

/** Element with attributes and children; a class comes first: el("div.ce-bar", {}, ...). */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K | `${K}.${string}`, attributes: Attributes = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name!) as HTMLElementTagNameMap[K];
  if (classes.length) element.className = classes.join(" ");
  set(element, attributes);
  for (const child of children) if (child) element.append(child);
  return element;
}

export function set(element: Element, attributes: Attributes): void {
  for (const key in attributes) element.setAttribute(key, attributes[key] as string);
}

export function button(text: string, click: () => void): HTMLButtonElement {
  const element = el("button", { type: "button" }, text);
  element.onclick = click;
  return element;
}

/** Say which thing was chosen: to the page by an event, to the caller by its callback. */
export function announce(host: HTMLElement, name: string, select?: (name: string) => void): void {
  host.dispatchEvent(new CustomEvent("catseye:select", { detail: { name }, bubbles: true }));
  select?.(name);
}

// Colours ------------------------------------------------------------------------------------------------------------
const KEYS = ["ink", "faint", "line", "paper", "accent", "doubtful", "bad", "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7", "low", "mid", "high"] as const;
type Colours = Record<(typeof KEYS)[number], string>;
export type Palette = Colours & { group(i: number): string; diverging(t: number): string };

let pixel: CanvasRenderingContext2D | null = null;

/** Red, green, blue, 0 to 255, of any colour that CSS knows. */
export function channels(colour: string): number[] {
  pixel ??= el("canvas", { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true })!;
  pixel.fillStyle = colour;
  pixel.fillRect(0, 0, 1, 1);
  return [...pixel.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}

/** Colours of the page at a host, as its variables say now. */
export function palette(host: HTMLElement): Palette {
  const probe = el("i");
  host.append(probe);
  const colours = {} as Colours;
  for (const key of KEYS) {
    probe.style.color = `var(--${key},#678)`;
    colours[key] = getComputedStyle(probe).color;
  }
  probe.remove();
  const [low, mid, high] = [colours.low, colours.mid, colours.high].map(channels) as [number[], number[], number[]];
  return {
    ...colours,
    group: (i) => colours[`c${i % 8}` as "c0"],
    diverging: (t) => `rgb(${mid.map((m, i) => round(m + min(abs(t), 1) ** 0.8 * ((t < 0 ? low : high)[i]! - m))).join()})`,
  };
}

let light: Palette | null = null;

/** Colours on paper: those of the light scheme, on white. */
export function paper(host: HTMLElement): Palette {
  const { dataset } = document.documentElement;
  const before = dataset.theme;
  if (!light) {
    dataset.theme = "light";
    light = { ...palette(host), paper: "#fff" };
    if (before === undefined) delete dataset.theme;
    else dataset.theme = before;
  }
  return light;
}

const printers = new Set<(printing: boolean) => void>();
let print: MediaQueryList | null = null;

/** Call before and after printing, once each; also what is added while the first is under way. Returns what ends it. */
export function onPrint(call: (printing: boolean) => void): () => void {
  let last = false;
  const turn = (to: boolean) => {
    // A set goes through what was added meanwhile, too.
    if (to !== last) for (const printer of printers) printer(to);
    last = to;
  };
  if (!print) {
    print = matchMedia("print");
    addEventListener("beforeprint", () => turn(true));
    addEventListener("afterprint", () => turn(false));
    print.onchange = (event) => turn(event.matches);
  }
  printers.add(call);
  return () => printers.delete(call);
}

/** What charts and scenes share: a picture painted when something changed, its tool tip, buttons, spoken text, paper. */
export interface Surface {
  canvas: HTMLCanvasElement; // takes pointer and keys
  stage: HTMLElement;
  width(): number;
  bar: HTMLElement;
  spoken: HTMLElement;
  colours: Palette;
  show(x: number, y: number, lines: string[]): void; // tool tip; no lines: none
  dirty(): void;
  destroy(): void;
}

export function surface(host: HTMLElement, kind: "chart" | "scene", label: string, hooks: { paint(width: number, now: number): void; scheme(): void; raster(): HTMLCanvasElement }): Surface {
  const life = new AbortController();
  const canvas = el("canvas.ce-live", { tabindex: 0, role: "img" });
  const tip = el("div.ce-tip", { "aria-hidden": "true" });
  const stage = el("div.ce-stage", {}, canvas, tip);
  const sheet = el("img.ce-sheet", { alt: label });
  const bar = el("div.ce-bar");
  const spoken = el("p.ce-said", { "aria-live": "polite" });
  const box = el(`div.ce-${kind}`, {}, stage, bar, spoken, sheet);
  let frame = 0;
  let width = 0;
  const self: Surface = {
    canvas, stage, bar, spoken,
    colours: palette(host),
    show(x, y, lines) {
      tip.hidden = !lines.length;
      tip.replaceChildren(...lines.map((line, i) => el(i ? "span" : "b", {}, line)));
      const { offsetWidth: w, offsetHeight: h } = tip;
      tip.style.left = `${max(0, x + 14 + w > stage.clientWidth ? x - w - 10 : x + 14)}px`;
      tip.style.top = `${max(0, y + 14 + h > stage.clientHeight ? y - h - 8 : y + 14)}px`;
    },
    width: () => width,
    dirty() {
      frame ||= requestAnimationFrame((now) => {
        frame = 0;
        width = stage.clientWidth;
        if (width) hooks.paint(width, now);
      });
    },
    destroy() {
      cancelAnimationFrame(frame);
      resize.disconnect();
      scheme.disconnect();
      life.abort();
      stop();
      box.remove();
    },
  };
  tip.hidden = true;
  const change = () => {
    self.colours = palette(host);
    hooks.scheme();
    self.dirty();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", change, life);
  let theme = document.documentElement.dataset.theme;
  const scheme = new MutationObserver(() => {
    if (theme !== (theme = document.documentElement.dataset.theme)) change();
  });
  scheme.observe(document.documentElement, { attributeFilter: ["data-theme"] });
  const stop = onPrint((printing) => {
    if (printing) sheet.src = hooks.raster().toDataURL();
    else sheet.removeAttribute("src");
    self.dirty();
  });
  const resize = new ResizeObserver(() => stage.clientWidth !== width && self.dirty());
  host.append(box);
  resize.observe(stage);
  return self;
}

export const FONT = "12px system-ui, 'Segoe UI', Roboto, Arial, sans-serif";

/** Size a canvas and clear it; its context in CSS pixels. */
export function context(canvas: HTMLCanvasElement, width: number, height: number, ratio: number, ground?: string): CanvasRenderingContext2D {
  canvas.width = round(width * ratio);
  canvas.height = round(height * ratio);
  const g = canvas.getContext("2d")!;
  g.scale(ratio, ratio);
  if (ground) fill(g, ground, () => g.rect(0, 0, width, height));
  g.font = FONT;
  g.textBaseline = "middle";
  return g;
}

/** Stroke or fill a path. */
export function stroke(g: CanvasRenderingContext2D, colour: string, width: number, path: () => void): void {
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.beginPath();
  path();
  g.stroke();
}
export function segment(g: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  g.moveTo(x0, y0);
  g.lineTo(x1, y1);
}
export function fill(g: CanvasRenderingContext2D, colour: string, path: () => void): void {
  g.fillStyle = colour;
  g.beginPath();
  path();
  g.fill();
}

/** Device pixels of a CSS pixel, at most 2. */
export const pixels = (): number => min(devicePixelRatio || 1, 2);

/** Ticks at 1, 2 or 5 times a power of ten between two values, and the decimals they need. */
export function ticks(low: number, high: number, most: number): { at: number[]; digits: number; step: number } {
  const raw = (high - low) / max(most, 1);
  const power = floor(log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * 10 ** power).find((s) => s >= raw * 0.9999) ?? raw;
  const at: number[] = [];
  for (let i = ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) at.push(i * step || 0);
  return { at, digits: max(0, -floor(log10(step) + 1e-9)), step };
}

const PREFIXED = new Set(["m", "s", "V", "rad", "A", "W"]);

/** Factor and unit in which a size reads best: 0.0002 m is 0.2 mm. */
export function scaled(size: number, unit: string): [number, string] {
  if (!PREFIXED.has(unit) || !(size > 0) || size >= 0.1) return [1, unit];
  return size >= 1e-4 ? [1e3, "m" + unit] : size >= 1e-7 ? [1e6, "µ" + unit] : [1e9, "n" + unit];
}

/** Quantile of numbers, 0 to 1; nulls do not count; NaN of none. */
export function quantile(values: unknown[], q: number): number {
  const sorted = Float64Array.from(values.filter(known)).sort();
  return sorted[round(q * (sorted.length - 1))] ?? NaN;
}

/** Size at which a diverging scale ends: nearly all values are inside. */
export function extent(values: unknown[]): number {
  return quantile(values.filter(known).map(abs), 0.98) || 1;
}
