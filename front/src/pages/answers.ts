// Shapes of the service's answers that these pages ask for. Arrays are columns; null is an unknown value.
import type { EpochSummary, Posture, Weather } from "../lib/state";
import type { Num } from "../lib/types";

/** MJD, or a day as "2026-11-27". */
export type Day = number | string | null;

export interface Covariance { xx: Num[]; xy: Num[]; xz: Num[]; yy: Num[]; yz: Num[]; zz: Num[] }
export interface Polyline { name: string; x: number[]; y: number[]; z: number[] }
export interface Points { name: string[]; x: Num[]; y: Num[]; z: Num[]; covariance?: Covariance | null; shots?: Num[] }
export interface Beams { ranger: string[]; target: string[]; shot: Num[]; w: Num[] }
export interface Named { name: string[]; value: Num[]; u: Num[] }

export interface EpochDetail extends Omit<EpochSummary, "points" | "rejected"> {
  points: Points; beams: Beams; structure?: Polyline[];
  air: Named | null; zeros: { ranger: string[]; value: Num[]; u: Num[] } | null; jitter_mm: Num | Record<string, Num>;
  doubts: string[]; notes: string[]; rejected: { shot: number; ranger: string | null; target: string | null; reason: string }[];
}
export interface Residuals {
  shot: number[]; ranger: string[]; target: string[]; mjd: Num[]; elevation: Num[]; residual: Num[]; u: Num[]; w: Num[]; status: string[]; by?: "adjustment" | "prediction";
}
export interface Series { names: { name: string; label: string; unit: string; mjd: number[]; value: Num[]; u: Num[] | null; low: Num[] | null; high: Num[] | null }[]; gaps: number }
export interface SeriesNames { names: (string | { name: string; label: string; unit: string })[] }
export interface Dropped { rangers: string[]; bins: number[]; width?: number; good: number[][]; failed: number[][] }
export interface Shots { number: number[]; mjd: Num[]; ranger: string[]; target: string[]; status: string[]; range: Num[]; u_range: Num[]; misfit: Num[] }
export interface ShotDetail {
  number: number; mjd: number; ranger: string; target: string; status: string; text: string | null;
  range: Num; u_range: Num; misfit: Num; amplitude_v: Num; phase: Num; epoch: Num;
  correction: { name: string; value: Num; unit: string; u?: Num }[]; weather: Weather[]; posture: Posture | null;
  certificate: { instrument: string; file: string; valid_from: Day; valid_until: Day } | null; has_samples: boolean;
}
export interface Samples {
  sample_rate_hz: number; volts: Num[]; spectrum: { frequency_hz: number[]; amplitude_v: Num[] };
  harmonics: { n: number; frequency_hz: number; amplitude_v: Num }[]; cycle_phase: { t: number[]; phase: Num[] }; fit: Record<string, unknown> | null;
}
export interface PointHistory { name: string; body: string; mjd: number[]; x: Num[]; y: Num[]; z: Num[]; covariance: Covariance | null; shots: Shots }
export interface Instrument { instrument: string; kind: string; file: string; sha256: string | null; valid_from: Day; valid_until: Day; valid: boolean | null; quantity?: string; by?: string | null; report?: string | null; value: Num; u: Num; unit: string }
export interface Air {
  paths: { ranger: string[]; target: string[]; length: Num[]; refractivity_ppm: Num[]; u: Num[]; temperature_c: Num[] };
  refractivity_ppm?: Num; profile: Record<string, unknown> | null; stations: Station[];
}
/** A weather station: its reading, or the reading within what the adjustment says of it. */
export interface Station extends Partial<Weather> { name?: string; offset_c?: Num; u_offset_c?: Num; read?: Weather | null }
export interface Comparison { name: string[]; w?: Num[]; level?: Num; verdict_text?: string | null; dx: Num[]; dy: Num[]; dz: Num[]; covariance: Covariance; significant: (boolean | null)[]; verdict: unknown }
export interface Surface {
  points: { name: string[]; x: Num[]; y: Num[]; deviation: Num[]; u: Num[] };
  aperture?: { x: Num; y: Num; radius: Num }; focal_length?: Num; verdict_text?: string | null;
  actuators: { name: string[]; x: Num[]; y: Num[]; value: Num[] } | null;
  zernike: { n: number; m: number; name: string; value: Num; u: Num }[]; rms: Num; verdict: unknown;
}
export interface Events { mjd: number[]; severity: string[]; who: string[]; kind: string[]; text: string[] }
export interface Parameter {
  name: string; value: string; waiting: string; legal: string; choices: string[]; unit: string; changes: string; meaning: string;
  stage: "none" | "set" | "prepared" | "started";
}
export interface Interlock { parameters: string[]; rule: string; refusal: string | null }
export interface Parameters { parameters: Parameter[]; interlocks: Interlock[] }
export interface Sampler { name: string; mjd: number[]; columns: Record<string, (Num | string)[]> }
