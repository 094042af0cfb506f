// Report: sections of text, tables, scenes, charts and drawings, whose selections follow each other.
import type { Block, Report } from "../lib/types";
import { chart } from "./chart";
import { el, onPrint, type Options, type Part } from "./dom";
import { scene } from "./scene";
import { table } from "./table";
import "./parts.css";
import "./result.css";

const PRINTED = 1000; // rows up to which a folded table is opened for the printer

export function report(host: HTMLElement, data: Report): { destroy(): void } {
  const parts: { place: HTMLElement; select(name: string | null): void; destroy(): void }[] = [];
  const late = new Map<Element, () => void>(); // parts that are built when they come near the window
  const short: HTMLDetailsElement[] = []; // folded, yet printed
  let chosen: string | null = null;
  const build = (place: Element) => {
    near.unobserve(place);
    late.get(place)?.();
    late.delete(place);
  };
  const near = new IntersectionObserver((entries) => entries.forEach((e) => e.isIntersecting && build(e.target)), { rootMargin: "400px" });

  function part<T>(make: (host: HTMLElement, data: T, options: Options) => Part<T>, content: T | undefined, label: string, height: string): HTMLElement {
    const place = el("div");
    place.style.minHeight = height;
    late.set(place, () => {
      place.style.minHeight = "";
      if (!content) return place.append(`${label}: no data`);
      const made = make(place, content, { label });
      parts.push({ place, ...made });
      if (chosen !== null) made.select(chosen);
    });
    near.observe(place);
    return place;
  }

  const figure = (content: Node, caption: string) => el("figure", {}, content, el("figcaption", {}, caption));

  function node(block: Block): Node {
    switch (block.kind) {
      case "text": return el(block.faint ? "p.faint" : "p", {}, block.text);
      case "heading": return el("h3", {}, block.text);
      case "list": return el("ul", {}, ...block.items.map((item) => el("li", {}, item)));
      case "scene": return figure(part(scene, data.scenes[block.scene], block.caption, "min(72vw,40rem)"), block.caption);
      case "chart": return figure(part(chart, data.charts[block.chart], block.caption, "min(50vw,27rem)"), block.caption);
      case "drawing": return figure(el("img", { alt: block.caption, src: "data:image/svg+xml," + encodeURIComponent(data.drawings[block.drawing] ?? "") }), block.caption);
      case "table": {
        const content = data.tables[block.table];
        const count = content?.columns[0]?.values.length ?? 0;
        const { caption, folded } = block;
        const shown = [caption && el("p.ce-caption", {}, caption), part(table, content, caption ?? folded ?? block.table, `${Math.min(count, 17) * 27 + 70}px`)];
        if (!folded) return el("div", {}, ...shown);
        const details = el("details", {}, el("summary", {}, `${folded} (${count})`), ...shown);
        if (count <= PRINTED) short.push(details);
        return el("div", {}, details, count > PRINTED && el("p.ce-paper", {}, `${count} rows: printed where opened before.`));
      }
    }
  }

  const sections = data.sections.map(({ id, title, blocks }) => el("section", { id, "aria-label": title }, el("h2", {}, title), ...blocks.map(node)));
  const links = data.sections.map(({ id, title }) => el("a", { href: `#${id}` }, title));
  const box = el("div.catseye-result", {}, links.length > 1 && el("nav", { "aria-label": "Contents" }, ...links), ...sections);
  box.addEventListener("catseye:select", (event) => {
    chosen = (event as CustomEvent<{ name: string }>).detail.name;
    for (const { place, select } of parts) if (!place.contains(event.target as Node)) select(chosen);
  });
  let opened: HTMLDetailsElement[] = [];
  const stop = onPrint((printing) => {
    if (printing) opened = short.filter((details) => !details.open);
    for (const details of opened) details.open = printing;
    if (printing) for (const place of [...late.keys()]) if (!place.closest("details:not([open])")) build(place);
  });
  host.append(box);
  return {
    destroy() {
      stop();
      near.disconnect();
      for (const part of parts) part.destroy();
      box.remove();
    },
  };
}
