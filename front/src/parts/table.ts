// Table that sorts, filters and holds only the rows in sight in the document; all rows print.
import type { Column, Num, Table } from "../lib/types";
import { announce, button, el, onPrint, quantile, type Options, type Part } from "./dom";
import { csv } from "./download";
import { decimals, fixed, plain, rounded } from "./number";
import { abs, ceil, clamp, floor, known, log10, max, min } from "./maths";
import "./parts.css";

export interface TableOptions extends Options { caption?: string; filter?: boolean; rows?: number }

const HEIGHT = 26; // px of a row where rows are windowed
const WINDOWED = 120; // rows above which they are
const order = new Intl.Collator("en", { numeric: true });

/** Text of a cell: decimals by its column, or by its own uncertainty. */
export function cellText(column: Column, row: number, u?: Column): string {
  const value = column.values[row];
  if (column.kind !== "number" || typeof value === "string") return String(value ?? "");
  if (!known(value)) return "unknown";
  if (column.digits !== undefined) return fixed(value, column.digits);
  const s = u?.values[row];
  return known(s) && s > 0 ? rounded(value, decimals(s)) : value && abs(value) < 1e-9 ? plain(value) : fixed(value, common(column));
}

const places = new WeakMap<Column, number>();

/** Decimals for all values of a column that states none: four significant digits of nearly the largest, no needless zeros. */
function common(column: Column): number {
  let digits = places.get(column);
  if (digits === undefined) {
    const values = column.values.filter(known);
    const size = quantile(values.map(abs), 0.9);
    const most = size > 0 ? clamp(3 - floor(log10(size)), 0, 10) : 0;
    digits = 0;
    while (digits < most && !values.every((v) => abs(v - Number(v.toFixed(digits))) < 1e-12 * abs(v))) digits++;
    places.set(column, digits);
  }
  return digits;
}

type Test = (row: number) => boolean;
const COMPARISONS: Record<string, (a: number, b: number) => boolean> = {
  ">": (a, b) => a > b, "<": (a, b) => a < b, ">=": (a, b) => a >= b, "<=": (a, b) => a <= b, "=": (a, b) => a === b, "!=": (a, b) => a !== b,
};

/** Tests of a filter's words: text anywhere in the row, or a condition as u>0.5, |w|>3. */
export function conditions(filter: string, columns: Column[], text: (row: number) => string): Test[] {
  const short = (name: string) => name.toLowerCase().replace(/\s+/g, "");
  return (filter.toLowerCase().replace(/\s*([<>]=?|!=|=)\s*/g, "$1").match(/\S+/g) ?? []).map((word) => {
    const [, bar, name, sign, limit] = /^(\|?)([^<>=!|]+)\|?([<>]=?|!=|=)([-−+.\de]+)$/.exec(word) ?? [];
    const column = name && columns.find((c) => c.kind === "number" && (short(c.key) === name || short(c.label) === name));
    const value = Number(limit?.replace("\u2212", "-"));
    if (!column || !sign || Number.isNaN(value)) return (row) => text(row).includes(word);
    return (row) => {
      const x = column.values[row];
      return known(x) && COMPARISONS[sign]!(bar ? abs(x) : x, value);
    };
  });
}

/** Rows in the order of a column; unknown values last either way. */
export function sorted(rows: number[], column: Column, down: boolean): number[] {
  const sign = down ? -1 : 1;
  const missing = (v: Num | string | undefined) => (v ?? "") === "" || Number.isNaN(v);
  return [...rows].sort((i, j) => {
    const [a, b] = [column.values[i], column.values[j]];
    if (missing(a) || missing(b)) return Number(missing(a)) - Number(missing(b)) || i - j;
    return sign * (known(a) && known(b) ? a - b : order.compare(String(a), String(b))) || i - j;
  });
}

export function table(host: HTMLElement, data: Table, options: TableOptions = {}): Part<Table> {
  const caption = options.caption ?? options.label ?? "Table";
  let { columns } = data;
  let rows: number[] = []; // in sight after filter and sort
  let texts: string[] = [];
  let sort: { key: string; down: boolean } | null = null;
  let chosen: string | null = null;
  let current = -1; // index into rows
  let all = false; // printing
  let count = 0;

  const input = el("input", { type: "search", placeholder: "Filter: text or u>0.5", "aria-label": `Filter ${caption}` });
  const size = el("span.ce-faint", { role: "status" });
  const spoken = el("span.ce-hidden", { "aria-live": "polite" });
  const body = el("tbody");
  const head = el("tr", { "aria-rowindex": 1 });
  const widths = el("colgroup");
  const grid = el("table", {}, el("caption.ce-hidden", {}, caption), widths, el("thead", {}, head), body);
  const scroll = el("div.ce-scroll", { tabindex: 0, role: "region", "aria-label": `${caption}: arrow keys move, Enter selects` }, grid);
  const bar = el("div.ce-bar", {}, input, size, button("CSV", () => csv(caption, data, rows)));
  const box = el("div.ce-table", {}, bar, scroll, spoken);

  const named = () => columns.find((c) => c.key === data.name) ?? null;
  const nameOf = (row: number) => String(named()?.values[row] ?? "");
  const windowed = () => !all && count > WINDOWED;
  // A column of uncertainties is rounded by itself.
  const ruler = (c: Column) => columns.find((d) => d.key === c.u) ?? (columns.some((d) => d.u === c.key) ? c : undefined);
  const cell = (c: Column, row: number) => cellText(c, row, ruler(c));
  const text = (row: number) => (texts[row] ??= columns.map((c) => cell(c, row)).join(" ").toLowerCase());

  function header(): void {
    const focus = [...head.children].indexOf(document.activeElement!.parentElement!);
    head.replaceChildren(...columns.map((c) => {
      const down = sort?.key === c.key ? sort.down : null;
      const press = button(c.label, () => {
        sort = down ? null : { key: c.key, down: down === false };
        scroll.scrollTop = 0;
        arrange();
      });
      press.append(el("small", {}, ` ${c.unit}`));
      // Buttons are not repeated on the next sheet of paper, texts are.
      return el(`th.ce-${c.kind}`, { "aria-sort": down === null ? "none" : down ? "descending" : "ascending" }, ...(all ? press.childNodes : [press]));
    }));
    head.querySelectorAll("button")[focus]?.focus();
    // Fixed widths where rows come and go, from the longest text of each column.
    widths.replaceChildren();
    grid.classList.toggle("ce-fixed", windowed());
    if (!windowed()) return;
    let total = 0;
    for (const c of columns) {
      let longest = c.label.length + c.unit.length + 3;
      const step = max(1, floor(count / 2000));
      for (let i = 0; i < count; i += step) longest = max(longest, cell(c, i).length);
      const width = min(longest, 44) + 2.5;
      total += width;
      const col = el("col");
      col.style.width = `${width}ch`;
      widths.append(col);
    }
    grid.style.minWidth = `${total}ch`;
  }

  function line(at: number): HTMLTableRowElement {
    const row = rows[at]!;
    const tr = el("tr", { "aria-rowindex": at + 2 });
    tr.dataset.at = String(at);
    if (chosen !== null && named() && nameOf(row) === chosen) {
      tr.className = "ce-chosen";
      tr.ariaCurrent = "true";
    }
    if (at === current) tr.classList.add("ce-current");
    for (const c of columns) {
      const shownText = cell(c, row);
      const td = el(`td.ce-${c.kind}`, {}, shownText);
      const value = c.values[row];
      if (known(value) && String(value) !== shownText) td.title = `${String(value).replace("-", "\u2212")} ${c.unit}`;
      else if (windowed() && shownText.length > 40) td.title = shownText;
      tr.append(td);
    }
    return tr;
  }

  const gap = (height: number) => {
    const td = el("td", { colspan: columns.length });
    td.style.height = `${height}px`;
    return el("tr.ce-gap", { "aria-hidden": true }, td);
  };

  function paint(): void {
    if (!windowed()) {
      body.replaceChildren();
      rows.forEach((_, at) => body.append(line(at)));
      return;
    }
    const seen = ceil(max(scroll.clientHeight, 480) / HEIGHT);
    const from = clamp(0, floor(scroll.scrollTop / HEIGHT) - 6, max(0, rows.length - seen));
    const to = min(rows.length, from + seen + 12);
    const lines = [];
    for (let i = from; i < to; i++) lines.push(line(i));
    body.replaceChildren(gap(from * HEIGHT), ...lines, gap((rows.length - to) * HEIGHT));
  }

  function arrange(): void {
    const tests = conditions(input.value, columns, text);
    const column = columns.find((c) => c.key === sort?.key);
    const passed = Array.from({ length: count }, (_, i) => i).filter((row) => tests.every((test) => test(row)));
    const before = rows[current];
    rows = column && sort ? sorted(passed, column, sort.down) : passed;
    current = before === undefined ? -1 : rows.indexOf(before);
    grid.ariaRowCount = `${rows.length + 1}`;
    size.textContent = rows.length === count ? `${count} rows` : `${rows.length} of ${count} rows`;
    header();
    paint();
  }

  function reveal(at: number): void {
    const top = windowed() ? at * HEIGHT : ((body.children[at] as HTMLElement | undefined)?.offsetTop ?? 0) - head.offsetHeight;
    const room = scroll.clientHeight - head.offsetHeight - HEIGHT;
    if (top < scroll.scrollTop) scroll.scrollTop = top;
    else if (top > scroll.scrollTop + room) scroll.scrollTop = top - room / 2;
    paint();
  }

  function choose(at: number): void {
    current = at;
    const row = rows[at];
    if (row !== undefined && named()) {
      chosen = nameOf(row);
      announce(host, chosen, options.select);
    }
    paint();
  }

  let waiting = false;
  scroll.addEventListener("scroll", () => {
    if (waiting || !windowed()) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      paint();
    });
  }, { passive: true });
  input.oninput = () => {
    scroll.scrollTop = 0;
    arrange();
  };
  body.onclick = (event) => {
    const at = (event.target as HTMLElement).closest("tr")?.dataset.at;
    if (at !== undefined && !getSelection()?.toString()) choose(Number(at));
  };
  scroll.onkeydown = (event) => {
    if (event.target !== scroll) return;
    const page = max(1, floor(scroll.clientHeight / HEIGHT) - 2);
    const moves: Record<string, number> = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    const move = moves[event.key];
    if (event.key === "Enter" && current >= 0) choose(current);
    else if (move !== undefined && rows.length) {
      current = clamp(current + move, 0, rows.length - 1);
      reveal(current);
      const row = rows[current]!;
      spoken.textContent = columns.slice(0, 6).map((c) => `${c.label} ${cell(c, row)} ${c.unit}`).join(", ");
    } else return;
    event.preventDefault();
  };
  const stop = onPrint((printing) => {
    all = printing;
    header();
    paint();
  });

  function update(next: Table): void {
    data = next;
    columns = data.columns;
    texts = [];
    count = columns[0]?.values.length ?? 0;
    grid.classList.toggle("ce-named", named() !== null);
    bar.hidden = options.filter === false;
    input.hidden = count < 9;
    arrange();
  }
  const resize = new ResizeObserver(() => windowed() && paint());
  resize.observe(scroll);
  if (options.rows) scroll.style.maxHeight = `${(options.rows + 1) * HEIGHT + 10}px`;
  host.append(box);
  update(data);
  return {
    update,
    select(name) {
      const same = chosen === name;
      chosen = name;
      const at = name === null || !named() ? -1 : rows.findIndex((row) => nameOf(row) === name);
      if (at >= 0 && !(same && current >= 0 && nameOf(rows[current]!) === name)) {
        current = at;
        reveal(at);
      } else paint();
    },
    destroy() {
      stop();
      resize.disconnect();
      box.remove();
    },
  };
}
