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

/** Tool tip inside a positioned box; at x, y of the box, turned back where it would leave it. */
export function tip(box: HTMLElement): { show(x: number, y: number, lines: string[]): void; hide(): void } {
  const element = el("div.ce-tip", { "aria-hidden": "true" });
  element.hidden = true;
  box.append(element);
  return {
    show(x, y, lines) {
      element.replaceChildren(...lines.map((line, i) => el(i ? "span" : "b", {}, line)));
      element.hidden = false;
      const { offsetWidth: w, offsetHeight: h } = element;
      element.style.left = `${Math.max(0, x + 14 + w > box.clientWidth ? x - w - 10 : x + 14)}px`;
      element.style.top = `${Math.max(0, y + 14 + h > box.clientHeight ? y - h - 8 : y + 14)}px`;
    },
    hide() {
      element.hidden = true;
    },
  };
}

// Colours ------------------------------------------------------------------------------------------------------------
// The light scheme; used on paper, and where the page defines no variables.
const LIGHT = {
  ink: "#1d2a35", faint: "#5d6a75", line: "#d5dde3", soft: "#f4f6f8", paper: "#ffffff", accent: "#1f5a99",
  good: "#1e7f68", doubtful: "#9a6400", bad: "#b3262f",
  c0: "#0072b2", c1: "#d55e00", c2: "#008f6b", c3: "#b0578f", c4: "#8a6d00", c5: "#3f97d0", c6: "#5b4fa8", c7: "#6b6b6b",
  low: "#2166ac", mid: "#d9d9d9", high: "#b2182b",
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
  pixel ??= Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
  if (!pixel) return [128, 128, 128];
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

/** Call when the scheme of colours changes; returns what ends it. */
export function onScheme(call: () => void): () => void {
  const media = matchMedia("(prefers-color-scheme: dark)");
  const observer = new MutationObserver(call);
  media.addEventListener("change", call);
  observer.observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
  return () => {
    media.removeEventListener("change", call);
    observer.disconnect();
  };
}

/** Call before and after printing, once each; returns what ends it. */
export function onPrint(before: () => void, after: () => void): () => void {
  const media = matchMedia("print");
  let printing = false;
  const start = () => {
    if (!printing) before();
    printing = true;
  };
  const end = () => {
    if (printing) after();
    printing = false;
  };
  const change = () => (media.matches ? start() : end());
  addEventListener("beforeprint", start);
  addEventListener("afterprint", end);
  media.addEventListener("change", change);
  return () => {
    removeEventListener("beforeprint", start);
    removeEventListener("afterprint", end);
    media.removeEventListener("change", change);
  };
}

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
export function quantile(values: (number | null)[], q: number): number {
  const sorted = Float64Array.from(values.filter((v): v is number => v !== null && Number.isFinite(v))).sort();
  return sorted[Math.round(q * (sorted.length - 1))] ?? NaN;
}

/** Size at which a diverging scale ends: nearly all values are inside. */
export function extent(values: (number | null)[]): number {
  return quantile(values.map((v) => (v === null ? null : Math.abs(v))), 0.98) || 1;
}
