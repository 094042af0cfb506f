// Calibrations: how each stands at an instant, and their table.
import { dateOf } from "../../lib/time";
import type { Num, Table } from "../../lib/types";
import type { Instrument } from "../answers";
import { shown } from "../../parts/number";
import { text } from "./columns";

export type Word = "valid" | "soon" | "expired" | "future" | "invalid";
const SOON_D = 30;

/** Standing at an instant (MJD), by the dates; the service's own judgement wins over a bar that looks right. */
export function standing(k: Instrument, now: number): { word: Word; sign: string } {
  if (k.valid_until !== null && now > k.valid_until) return { word: "expired", sign: "✕" };
  if (k.valid_from !== null && now < k.valid_from) return { word: "future", sign: "○" };
  if (!k.valid) return { word: "invalid", sign: "✕" };
  if (k.valid_until !== null && k.valid_until - now < SOON_D) return { word: "soon", sign: "!" };
  return { word: "valid", sign: "✓" };
}

export const WORDS: Record<Word, string> = { valid: "valid", soon: "expires soon", expired: "expired", future: "not yet valid", invalid: "not valid" };

/** Days left or over, as a phrase that follows the dates. */
export function age(k: Instrument, now: number): string {
  if (k.valid_until === null) return "";
  const days = Math.round(k.valid_until - now);
  return days >= 0 ? `, ${days} d left` : `, over for ${-days} d`;
}

/** Value with its u and unit, or where to look. */
export const valueOf = (k: Instrument): string => (k.value === null ? "see certificate" : shown(k.value, k.u, k.unit));

const day = (mjd: Num): string => (mjd === null ? "no end" : dateOf(mjd).toISOString().slice(0, 10));

export function calibrationTable(instruments: Instrument[], now: number): Table {
  return {
    name: "key",
    columns: [
      text("key", "calibration", instruments.map(keyOf)),
      text("standing", "standing", instruments.map((k) => { const s = standing(k, now); return `${s.sign} ${WORDS[s.word]}${age(k, now)}`; })),
      text("value", "value", instruments.map(valueOf)),
      text("from", "valid from", instruments.map((k) => (k.valid_from === null ? "unknown" : day(k.valid_from)))), text("until", "valid until", instruments.map((k) => day(k.valid_until))),
      text("file", "certificate", instruments.map((k) => k.file), "long"), text("sha256", "SHA-256", instruments.map((k) => k.sha256), "hash"),
    ],
  };
}

export const keyOf = (k: Instrument): string => `${k.instrument} ${k.kind}`;
