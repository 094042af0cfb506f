// A report's script: unpacks the data that the file holds and shows them. Nothing is loaded.
import type { Report } from "./lib/types";
import { report } from "./parts/report";
import "./report.css";

/** Report with its repeated lists, which its data hold once, in their places. */
function expanded(part: unknown, lists: unknown[]): unknown {
  if (part === null || typeof part !== "object") return part;
  if (Array.isArray(part)) return part.length && typeof part[0] === "object" ? part.map((item) => expanded(item, lists)) : part;
  const keys = Object.keys(part);
  if (keys.length === 1 && keys[0] === "shared") return lists[(part as { shared: number }).shared];
  return Object.fromEntries(Object.entries(part).map(([key, item]) => [key, expanded(item, lists)]));
}

async function unpacked(text: string): Promise<Report> {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const { shared = [], ...packed } = (await new Response(stream).json()) as Report & { shared?: unknown[] };
  const data = expanded(packed, shared) as Report;
  if (data.format !== "catseye-report-1") throw `format ${data.format} is unknown`;
  return data;
}

async function start(): Promise<void> {
  const host = document.getElementById("catseye-report");
  const source = document.getElementById("catseye-data");
  if (!host || !source) return;
  host.textContent = "Loading the data of this report …";
  try {
    if (!("DecompressionStream" in window)) throw "it needs a browser from 2023 or later";
    const data = await unpacked(source.textContent ?? "");
    host.textContent = "";
    report(host, data);
    if (location.hash.length > 1) document.getElementById(decodeURIComponent(location.hash.slice(1)))?.scrollIntoView();
  } catch (error) {
    host.textContent = `The data of this report cannot be shown: ${String(error)}.`;
    host.className = "bad";
    host.role = "alert";
  }
}

void start(); // the script stands behind the data
