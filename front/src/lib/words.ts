// Words and signs of states, and which of them are wrong. Grey is normal; a sign and a word stand beside each colour.

export type Severity = "normal" | "warning" | "alarm" | "off";

const RANGERS: Record<string, Severity> = {
  measures: "normal", "last shot failed": "normal", idle: "warning", dark: "alarm", suspended: "warning",
  "another's": "warning", "not ready": "warning", "not connected": "alarm", trouble: "warning", "left out": "off",
  unknown: "off",
};
const SITES: Record<string, { severity: Severity; sign: string }> = {
  well: { severity: "normal", sign: "✓" },
  starting: { severity: "normal", sign: "…" },
  impaired: { severity: "warning", sign: "▲" },
  alarm: { severity: "alarm", sign: "◆" },
  stopped: { severity: "alarm", sign: "■" },
};
const VERDICTS: Record<string, { severity: Severity; sign: string }> = {
  good: { severity: "normal", sign: "✓" },
  doubtful: { severity: "warning", sign: "▲" },
  failed: { severity: "alarm", sign: "◆" },
};
const SIGNS: Record<string, string> = { alarm: "◆", warning: "▲", note: "·", debug: "·" };

export function severityOfRanger(word: string): Severity {
  return RANGERS[word] ?? "warning";
}

export function ofSite(word: string | null): { severity: Severity; sign: string } {
  if (word === null) return { severity: "off", sign: "∅" };
  return SITES[word] ?? { severity: "warning", sign: "?" };
}

export function signOf(severity: string): string {
  return SIGNS[severity] ?? "·";
}

export function severityOf(text: string): Severity {
  return text === "alarm" ? "alarm" : text === "warning" ? "warning" : "normal";
}

/** Word, reason, sign and severity of a verdict, which is a word beside its reason, or {word, why}. */
export function verdictOf(verdict: unknown, why?: string | null): { word: string; why: string; severity: Severity; sign: string } | null {
  const word = typeof verdict === "string" ? verdict : textAt(verdict, "word");
  if (!word) return null;
  const known = VERDICTS[word] ?? { severity: "warning" as const, sign: "?" };
  return { word, why: why ?? textAt(verdict, "why"), ...known };
}

function textAt(value: unknown, key: string): string {
  const part = value && typeof value === "object" ? (value as Record<string, unknown>)[key] : null;
  return typeof part === "string" ? part : "";
}

const NORMAL = new Set(["well", "none", "nobody", ""]);

/** Whether a part of the site (clock, journal) says a trouble. */
export function troubled(text: string): boolean {
  return !NORMAL.has(text);
}
