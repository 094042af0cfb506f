// A report's script: unpacks the data that the file holds and shows them. Nothing is loaded.
import type { Report } from "./lib/types";
import { report } from "./parts/report";
import "./report.css";

/** Put repeated lists, which the data hold once, in their places. */
function expand(part: object, lists: unknown[]): void {
  for (const [key, item] of Object.entries(part)) {
    if (Array.isArray(item) ? typeof item[0] !== "object" : typeof item !== "object" || !item) continue;
    if (item.shared === undefined) expand(item, lists);
    else (part as Record<string, unknown>)[key] = lists[item.shared];
  }
}

async function unpacked(text: string): Promise<Report> {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const { shared = [], ...data } = (await new Response(stream).json()) as Report & { shared?: unknown[] };
  expand(data, shared);
  if (data.format !== "catseye-report-1") throw `format ${data.format} is unknown`;
  return data;
}

async function start(): Promise<void> {
  const host = document.getElementById("catseye-report");
  const source = document.getElementById("catseye-data");
  if (!host || !source) return;
  host.textContent = "Loading …";
  try {
    const data = await unpacked(source.textContent ?? "");
    host.textContent = "";
    report(host, data);
    document.getElementById(decodeURIComponent(location.hash.slice(1)))?.scrollIntoView();
  } catch (error) {
    host.textContent = `The data cannot be shown; a browser from 2023 or later can. ${error}`;
    host.className = "bad";
    host.role = "alert";
  }
}

void start(); // the script stands behind the data
