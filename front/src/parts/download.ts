// Downloads of what a part shows.
import type { Table } from "../lib/types";

function save(name: string, blob: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function stem(name: string): string {
  return name.normalize("NFKD").replace(/[^\w.-]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 80) || "catseye";
}

/** Table as CSV text: label and unit in the first line, values in full, rows in the order of `order`. */
export function csvText(table: Table, order?: ArrayLike<number>): string {
  const cell = (value: unknown) => {
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  const columns = table.columns;
  const lines = [columns.map((c) => cell(c.unit ? `${c.label} (${c.unit})` : c.label)).join(",")];
  const count = order?.length ?? columns[0]?.values.length ?? 0;
  for (let i = 0; i < count; i++) lines.push(columns.map((c) => cell(c.values[order ? order[i]! : i])).join(","));
  return lines.join("\r\n") + "\r\n";
}

export function csv(name: string, table: Table, order?: ArrayLike<number>): void {
  save(stem(name) + ".csv", new Blob(["\ufeff" + csvText(table, order)], { type: "text/csv;charset=utf-8" }));
}

export function png(name: string, canvas: HTMLCanvasElement): void {
  canvas.toBlob((blob) => blob && save(stem(name) + ".png", blob));
}
