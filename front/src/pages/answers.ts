// Shapes of the service's answers that these pages ask for. Arrays are columns; null is an unknown value.
import type { EpochSummary, Posture, Weather } from "../lib/state";
import type { Num, Verdict, Word } from "../lib/types";

export interface Covariance { xx: Num[]; xy: Num[]; xz: Num[]; yy: Num[]; yz: Num[]; zz: Num[] }
export interface Polyline { name: string; x: number[]; y: number[]; z: number[] }
export interface Points { name: string[]; x: Num[]; y: Num[]; z: Num[]; covariance?: Covariance | null; shots?: Num[] }
export interface Beams { ranger: string[]; target: string[]; shot: Num[]; w: Num[] }
export interface Named { name: string[]; value: Num[]; u: Num[] }

export interface EpochDetail extends Omit<EpochSummary, "points" | "rejected"> {
  points: Points; beams: Beams; posed_structure?: Polyline[];
  air: Named | null; zeros: { ranger: string[]; value: Num[]; u: Num[] } | null; jitter_mm: Num;
  doubts: string[]; notes: string[]; rejected: { shot: number; ranger: string; target: string; reason: string }[];
  pose: Record<string, Num> | null;
}
export interface Residuals {
  shot: number[]; ranger: string[]; target: string[]; mjd: Num[]; elevation: Num[]; residual: Num[]; u: Num[]; w: Num[]; status: string[];
}
export interface Series { names: { name: string; label: string; unit: string; mjd: number[]; value: Num[]; u: Num[] | null; low: Num[] | null; high: Num[] | null }[]; gaps: number }
export interface Dropped { rangers: string[]; bins: number[]; good: number[][]; failed: number[][] }
export interface Shots { number: number[]; mjd: Num[]; ranger: string[]; target: string[]; status: string[]; range: Num[]; u_range: Num[]; misfit: Num[] }
export interface ShotDetail {
  number: number; mjd: number; ranger: string; target: string; status: string; text: string;
  range: Num; u_range: Num; misfit: Num; amplitude_v: Num; phase: Num; epoch: Num;
  correction: { name: string; value: Num; unit: string; u?: Num }[]; weather: Weather[]; posture: Posture | null;
  certificate: { instrument: string; file: string; valid_from: Num; valid_until: Num } | null; has_samples: boolean;
}
export interface Samples {
  sample_rate_hz: number; volts: Num[]; spectrum: { frequency_hz: number[]; amplitude_v: Num[] };
  harmonics: { n: number; frequency_hz: number; amplitude_v: Num }[]; cycle_phase: { t: number[]; phase: Num[] }; fit: Record<string, unknown> | null;
}
export interface PointHistory { name: string; body: string; mjd: number[]; x: Num[]; y: Num[]; z: Num[]; covariance: Covariance | null; shots: Shots }
export interface Instrument { instrument: string; kind: string; file: string; sha256: string; valid_from: Num; valid_until: Num; valid: boolean; value: Num; u: Num; unit: string }
export interface Air {
  paths: { ranger: string[]; target: string[]; length: Num[]; refractivity_ppm: Num[]; u: Num[]; temperature_c: Num[] };
  profile: Record<string, Num[]> | null; stations: Weather[];
}
export interface Comparison { name: string[]; dx: Num[]; dy: Num[]; dz: Num[]; covariance: Covariance; significant: boolean[]; verdict: unknown }
export interface Surface {
  points: { name: string[]; x: Num[]; y: Num[]; deviation: Num[]; u: Num[] };
  actuators: { name: string[]; x: Num[]; y: Num[]; value: Num[] } | null;
  zernike: { n: number; m: number; name: string; value: Num; u: Num }[]; rms: Num; verdict: unknown;
}
export interface Events { mjd: number[]; severity: string[]; who: string[]; kind: string[]; text: string[] }

const WORDS: Word[] = ["good", "doubtful", "failed"];

/** Verdict of an answer that may be a record, a word or nothing. */
export function verdictOf(value: unknown): Verdict | null {
  if (typeof value === "string") return WORDS.includes(value as Word) ? { word: value as Word, why: "" } : null;
  if (!value || typeof value !== "object") return null;
  const { word, why } = value as { word?: unknown; why?: unknown };
  return WORDS.includes(word as Word) ? { word: word as Word, why: typeof why === "string" ? why : "" } : null;
}
