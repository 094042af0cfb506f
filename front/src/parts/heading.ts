// Title, verdict, cards and passages of a report, for the dashboard; in a report's file the writers put them as text.
import type { Report } from "../lib/types";
import { el } from "./dom";
import "./result.css";

const SIGNS = { good: "✓", doubtful: "!", failed: "✕" };
const WORDS = { good: "Good", doubtful: "Doubtful", failed: "Failed" };

/** Head of a report, to stand before what `report` renders. */
export function heading(data: Report): HTMLElement {
  return el("div.catseye-result", {},
    el("h1", {}, data.title), el("p.faint", {}, data.subtitle),
    data.verdict && el(`p.verdict.${data.verdict.word}`, {}, el("b", {}, `${SIGNS[data.verdict.word]} ${WORDS[data.verdict.word]}.`), ` ${data.verdict.why}`),
    data.cards.length > 0 && el("div.cards", {}, ...data.cards.map((card) => el("div.card", {}, el("span.name", {}, card.name), el("b", {}, card.value), el("span", {}, card.remark)))),
    data.passages.length > 0 && el("dl.passages", {}, ...data.passages.flatMap((passage) => [el("dt", {}, passage.title), el("dd", {}, passage.text)])),
  );
}

/** Let links to sections scroll and leave the address as it is, which belongs to the dashboard's pages; returns what ends it. */
export function scrolling(host: HTMLElement): () => void {
  const click = (event: MouseEvent) => {
    const link = (event.target as Element).closest("a")?.getAttribute("href");
    if (!link?.startsWith("#")) return;
    event.preventDefault();
    document.getElementById(link.slice(1))?.scrollIntoView();
  };
  host.addEventListener("click", click);
  return () => host.removeEventListener("click", click);
}
