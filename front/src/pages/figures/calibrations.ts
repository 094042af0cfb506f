// Calibrations: how each stands at an instant, and their table.
import { dateOf, mjdOf } from "../../lib/time";
import type { Num, Table } from "../../lib/types";
import type { Day, Instrument } from "../answers";
import { shown } from "../../parts/number";
import { text } from "./columns";

export type Word = "valid" | "soon" | "expired" | "future" | "undated" | "invalid";
const SOON_D = 30;

/** MJD of the start of a day, or of an instant. */
export function mjdOfDay(day: Day): Num {
  if (day === null || typeof day === "number") return day;
  const mjd = mjdOf(new Date(`${day.slice(0, 10)}T00:00:00Z`));
  return Number.isFinite(mjd) ? mjd : null;
}

/** MJD at which a calibration ends: the last day counts in full. */
export function endOf(k: { valid_until: Day }): Num {
  const mjd = mjdOfDay(k.valid_until);
  return typeof k.valid_until === "string" && mjd !== null ? mjd + 1 : mjd;
}

/** Standing at an instant (MJD) by the dates, so that a replay judges by its own time. */
export function standing(k: Instrument, now: number): { word: Word; sign: string } {
  const from = mjdOfDay(k.valid_from), until = endOf(k);
  if (until !== null && now >= until) return { word: "expired", sign: "✕" };
  if (from !== null && now < from) return { word: "future", sign: "○" };
  if (from === null && until === null) return k.valid === false ? { word: "invalid", sign: "✕" } : { word: "undated", sign: "?" };
  if (until !== null && until - now < SOON_D) return { word: "soon", sign: "!" };
  return { word: "valid", sign: "✓" };
}

export const WORDS: Record<Word, string> = { valid: "valid", soon: "expires soon", expired: "expired", future: "not yet valid", undated: "without dates", invalid: "not valid" };

/** Days left or over, as a phrase that follows the dates. */
export function age(k: Instrument, now: number): string {
  const until = endOf(k);
  if (until === null) return "";
  const days = Math.floor(until - now);
  return days >= 0 ? `, ${days} d left` : `, over for ${-days} d`;
}

/** Value with its u and unit, or where to look. */
export const valueOf = (k: Instrument): string => (k.value === null ? "see file" : shown(k.value, k.u, k.unit));

export const day = (value: Day, none = "no end"): string => (value === null ? none : typeof value === "string" ? value.slice(0, 10) : dateOf(value).toISOString().slice(0, 10));

export function calibrationTable(instruments: Instrument[], now: number): Table {
  return {
    name: "key",
    columns: [
      text("key", "calibration", instruments.map(keyOf)),
      text("standing", "standing", instruments.map((k) => { const s = standing(k, now); return `${s.sign} ${WORDS[s.word]}${age(k, now)}`; })),
      text("quantity", "quantity", instruments.map((k) => k.quantity ?? "")), text("value", "value", instruments.map(valueOf)),
      text("from", "valid from", instruments.map((k) => day(k.valid_from, "unknown"))), text("until", "valid until", instruments.map((k) => day(k.valid_until))),
      text("file", "certificate", instruments.map((k) => k.file), "long"), text("sha256", "SHA-256", instruments.map((k) => k.sha256 ?? "none"), "hash"), text("by", "by", instruments.map((k) => k.by ?? "")), text("report", "report", instruments.map((k) => k.report ?? "")),
    ],
  };
}

export const keyOf = (k: Instrument): string => `${k.instrument} ${k.kind}`;
