// Report: sections of text, tables, scenes, charts and drawings, whose selections follow each other.
import type { Block, Report } from "../lib/types";
import { chart } from "./chart";
import { el, onPrint } from "./dom";
import { scene } from "./scene";
import { table } from "./table";
import "./parts.css";

export interface ReportOptions { embedded?: boolean /* in the dashboard: with title, verdict, cards and passages; no addresses */ }

const SIGNS = { good: "✓", doubtful: "!", failed: "✕" };
const WORDS = { good: "Good", doubtful: "Doubtful", failed: "Failed" };
const PRINTED = 1000; // rows up to which a folded table is opened for the printer

/** Title, verdict, cards and passages; in a report's file the writers put the same as static text. */
function top(data: Report): HTMLElement {
  return el("div", {},
    el("h1", {}, data.title), el("p.faint", {}, data.subtitle),
    data.verdict && el(`p.verdict.${data.verdict.word}`, {}, el("b", {}, `${SIGNS[data.verdict.word]} ${WORDS[data.verdict.word]}.`), ` ${data.verdict.why}`),
    data.cards.length > 0 && el("div.cards", {}, ...data.cards.map((card) => el("div.card", {}, el("span.name", {}, card.name), el("b", {}, card.value), el("span", {}, card.remark)))),
    data.passages.length > 0 && el("dl.passages", {}, ...data.passages.flatMap((passage) => [el("dt", {}, passage.title), el("dd", {}, passage.text)])),
  );
}

export function report(host: HTMLElement, data: Report, options: ReportOptions = {}): { destroy(): void } {
  const parts: { host: HTMLElement; select(name: string | null): void; destroy(): void }[] = [];
  const late = new Map<Element, () => void>(); // parts that are built when they come near the window
  let chosen: string | null = null;
  const build = (element: Element) => {
    const make = late.get(element);
    late.delete(element);
    near.unobserve(element);
    make?.();
  };
  const near = new IntersectionObserver((entries) => entries.forEach((e) => e.isIntersecting && build(e.target)), { rootMargin: "400px" });

  type Maker = (place: HTMLElement) => { select(name: string | null): void; destroy(): void };
  function part(kind: string, make: Maker): HTMLElement {
    const place = el(`div.${kind}` as "div");
    late.set(place, () => {
      place.classList.remove("ce-scene", "ce-chart", "ce-rows");
      const made = make(place);
      parts.push({ host: place, ...made });
      if (chosen !== null) made.select(chosen);
    });
    near.observe(place);
    return place;
  }

  function tableOf(block: Extract<Block, { kind: "table" }>): Node | null {
    const rows = data.tables[block.table];
    if (!rows) return null;
    const caption = block.caption ?? block.folded ?? block.table;
    const place = part("ce-rows", (inner) => table(inner, rows, { caption }));
    const shownCaption = block.caption ? el("p.ce-caption", {}, block.caption) : null;
    if (!block.folded) return el("div", {}, shownCaption, place);
    const count = rows.columns[0]?.values.length ?? 0;
    const note = count > PRINTED ? el("p.ce-paper", {}, `${count} rows: printed where opened before.`) : null;
    const details = el("details", {}, el("summary", {}, `${block.folded} (${count})`), shownCaption, place);
    if (count <= PRINTED) details.dataset.short = "";
    return el("div", {}, details, note);
  }

  function figure(content: Node | null, caption: string): Node | null {
    return content && el("figure", {}, content, el("figcaption", {}, caption));
  }

  function node(block: Block): Node | null {
    switch (block.kind) {
      case "text": return el(block.faint ? "p.faint" : "p", {}, block.text);
      case "heading": return el("h3", {}, block.text);
      case "list": return el("ul", {}, ...block.items.map((item) => el("li", {}, item)));
      case "table": return tableOf(block);
      case "scene": {
        const held = data.scenes[block.scene];
        return figure(held ? part("ce-scene", (place) => scene(place, held, { label: block.caption })) : null, block.caption);
      }
      case "chart": {
        const held = data.charts[block.chart];
        return figure(held ? part("ce-chart", (place) => chart(place, held, { label: block.caption })) : null, block.caption);
      }
      case "drawing": {
        const svg = data.drawings[block.drawing];
        return figure(svg ? el("img", { alt: block.caption, src: "data:image/svg+xml;charset=utf-8," + encodeURIComponent(svg) }) : null, block.caption);
      }
    }
  }

  const links = data.sections.map((section) => {
    const link = el("a", { href: `#${section.id}` }, section.title);
    if (options.embedded) link.onclick = (event) => {
      event.preventDefault();
      document.getElementById(section.id)?.scrollIntoView();
    };
    return link;
  });
  const nav = links.length > 1 && el("nav", { "aria-label": "Contents" }, ...links);
  const box = el("div.catseye-result", {}, options.embedded ? top(data) : null, nav,
    ...data.sections.map((section) => el("section", { id: section.id, "aria-label": section.title }, el("h2", {}, section.title), ...section.blocks.map(node))));
  const follow = (event: Event) => {
    chosen = (event as CustomEvent<{ name: string }>).detail.name;
    for (const p of parts) if (!p.host.contains(event.target as Node)) p.select(chosen);
  };
  box.addEventListener("catseye:select", follow);
  let opened: HTMLDetailsElement[] = [];
  const stop = onPrint(() => {
    opened = [...box.querySelectorAll<HTMLDetailsElement>("details[data-short]:not([open])")];
    for (const details of opened) details.open = true;
    for (const element of [...late.keys()]) if (!element.closest("details:not([open])")) build(element);
  }, () => {
    for (const details of opened) details.open = false;
  });
  host.append(box);
  return {
    destroy() {
      stop();
      near.disconnect();
      for (const p of parts) p.destroy();
      box.remove();
    },
  };
}
