// What the parts share: elements, tool tips, colours, printing, ticks.
export interface Options { select?: (name: string) => void; label?: string }
export interface Part<T> { update(data: T): void; select(name: string | null): void; destroy(): void }

type Child = Node | string | null | undefined | false;

/** Element with attributes and children; a class comes first: el("div.ce-bar", {}, ...). */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K | `${K}.${string}`, attributes: Record<string, string> = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name!) as HTMLElementTagNameMap[K];
  if (classes.length) element.className = classes.join(" ");
  for (const key in attributes) element.setAttribute(key, attributes[key]!);
  for (const child of children) if (child) element.append(child);
  return element;
}

export function button(text: string, title: string, click: () => void): HTMLButtonElement {
  const element = el("button", title ? { type: "button", title } : { type: "button" }, text);
  element.onclick = click;
  return element;
}

/** Say which thing was chosen: to the page by an event, to the caller by its callback. */
export function announce(host: HTMLElement, name: string, select?: (name: string) => void): void {
  host.dispatchEvent(new CustomEvent("catseye:select", { detail: { name }, bubbles: true }));
  select?.(name);
}

export const known = (value: unknown): value is number => Number.isFinite(value);

// Colours ------------------------------------------------------------------------------------------------------------
// The light scheme; used on paper, and where the page defines no variables.
const LIGHT = {
  ink: "#1b2227", faint: "#525c64", line: "#d3d9de", paper: "#fff", accent: "#1d5691", doubtful: "#7d5000", bad: "#a8281b",
  c0: "#0068a8", c1: "#c35200", c2: "#00805c", c3: "#b0568a", c4: "#846400", c5: "#2a83b8", c6: "#5b4a9e", c7: "#5a6269",
  low: "#2166ac", mid: "#b4babf", high: "#b2182b",
};
export type Palette = Record<keyof typeof LIGHT, string> & { group(i: number): string; diverging(t: number): string };

function finished(colours: Record<keyof typeof LIGHT, string>): Palette {
  const rgb = [colours.low, colours.mid, colours.high].map(channels);
  return {
    ...colours,
    group: (i) => colours[`c${i % 8}` as "c0"],
    diverging(t) {
      const s = Math.min(Math.abs(t), 1) ** 0.8;
      const end = rgb[t < 0 ? 0 : 2]!;
      return `rgb(${rgb[1]!.map((mid, i) => Math.round(mid + s * (end[i]! - mid))).join()})`;
    },
  };
}

let pixel: CanvasRenderingContext2D | null = null;

/** Red, green, blue, 0 to 255, of any colour that CSS knows. */
export function channels(colour: string): number[] {
  pixel ??= el("canvas", { width: "1", height: "1" }).getContext("2d", { willReadFrequently: true })!;
  pixel.fillStyle = colour;
  pixel.fillRect(0, 0, 1, 1);
  return [...pixel.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}

export const PAPER = (): Palette => finished(LIGHT);

/** Colours of the page at a host, as its variables say now. */
export function palette(host: HTMLElement): Palette {
  const probe = el("span");
  host.append(probe);
  const colours = { ...LIGHT };
  for (const key of Object.keys(LIGHT) as (keyof typeof LIGHT)[]) {
    probe.style.color = `var(--${key},${LIGHT[key]})`;
    colours[key] = getComputedStyle(probe).color;
  }
  probe.remove();
  return finished(colours);
}

/** Call before and after printing, once each, until the signal. */
export function onPrint(signal: AbortSignal, before: () => void, after: () => void): void {
  const media = matchMedia("print");
  let printing = false;
  const turn = (to: boolean) => {
    if (to !== printing) (to ? before : after)();
    printing = to;
  };
  addEventListener("beforeprint", () => turn(true), { signal });
  addEventListener("afterprint", () => turn(false), { signal });
  media.addEventListener("change", () => turn(media.matches), { signal });
}

/** What charts and scenes share: a picture painted when something changed, its tool tip, buttons, spoken text, paper. */
export interface Surface {
  canvas: HTMLCanvasElement; // takes pointer and keys
  stage: HTMLElement;
  bar: HTMLElement;
  spoken: HTMLElement;
  colours: Palette;
  show(x: number, y: number, lines: string[]): void; // tool tip; no lines: none
  dirty(): void;
  at(event: PointerEvent): [number, number];
  signal: AbortSignal;
  destroy(): void;
}

export function surface(host: HTMLElement, kind: "chart" | "scene", label: string, hooks: { paint(now: number): void; scheme(): void; raster(): HTMLCanvasElement }): Surface {
  const life = new AbortController();
  const { signal } = life;
  const canvas = el("canvas.ce-live", { tabindex: "0", role: "img" });
  const tip = el("div.ce-tip", { "aria-hidden": "true" });
  const stage = el("div.ce-stage", {}, canvas, tip);
  const sheet = el("img.ce-sheet", { alt: label });
  const [bar, spoken] = [el("div.ce-bar"), el("p.ce-said", { "aria-live": "polite" })];
  const box = el(`div.ce-${kind}`, {}, stage, bar, spoken, sheet);
  let frame = 0;
  let width = 0;
  const self: Surface = {
    canvas, stage, bar, spoken, signal,
    colours: palette(host),
    show(x, y, lines) {
      tip.hidden = !lines.length;
      tip.replaceChildren(...lines.map((line, i) => el(i ? "span" : "b", {}, line)));
      const { offsetWidth: w, offsetHeight: h } = tip;
      tip.style.left = `${Math.max(0, x + 14 + w > stage.clientWidth ? x - w - 10 : x + 14)}px`;
      tip.style.top = `${Math.max(0, y + 14 + h > stage.clientHeight ? y - h - 8 : y + 14)}px`;
    },
    dirty() {
      frame ||= requestAnimationFrame((now) => {
        frame = 0;
        width = stage.clientWidth;
        if (width) hooks.paint(now);
      });
    },
    at(event) {
      const r = canvas.getBoundingClientRect();
      return [event.clientX - r.left, event.clientY - r.top];
    },
    destroy() {
      cancelAnimationFrame(frame);
      resize.disconnect();
      scheme.disconnect();
      life.abort();
      box.remove();
    },
  };
  tip.hidden = true;
  const change = () => {
    self.colours = palette(host);
    hooks.scheme();
    self.dirty();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", change, { signal });
  const scheme = new MutationObserver(change);
  scheme.observe(document.documentElement, { attributeFilter: ["data-theme"] });
  onPrint(signal, () => {
    sheet.src = hooks.raster().toDataURL();
    self.dirty();
  }, () => sheet.removeAttribute("src"));
  const resize = new ResizeObserver(() => stage.clientWidth !== width && self.dirty());
  host.append(box);
  resize.observe(stage);
  return self;
}

export const FONT = "12px system-ui, 'Segoe UI', Roboto, Arial, sans-serif";

/** Size a canvas and clear it; its context in CSS pixels. */
export function context(canvas: HTMLCanvasElement, width: number, height: number, ratio: number, ground?: string): CanvasRenderingContext2D {
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
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
export function fill(g: CanvasRenderingContext2D, colour: string, path: () => void): void {
  g.fillStyle = colour;
  g.beginPath();
  path();
  g.fill();
}

export const pixels = (): number => Math.min(devicePixelRatio || 1, 2);

/** Ticks at 1, 2 or 5 times a power of ten between two values, and the decimals they need. */
export function ticks(low: number, high: number, most: number): { at: number[]; digits: number; step: number } {
  const raw = (high - low) / Math.max(most, 1);
  const power = Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * 10 ** power).find((s) => s >= raw * 0.9999) ?? raw;
  const at: number[] = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) at.push(i * step);
  return { at, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), step };
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
  return sorted[Math.round(q * (sorted.length - 1))] ?? NaN;
}

/** Size at which a diverging scale ends: nearly all values are inside. */
export function extent(values: unknown[]): number {
  return quantile(values.filter(known).map(Math.abs), 0.98) || 1;
}
