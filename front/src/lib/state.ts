// Shapes of /api/service, /api/site and /api/state, as the service answers them.
import type { Num } from "./types";

export interface Service {
  version: string; kind: "site" | "journal" | "result"; name: string;
  commands: boolean; history: boolean; needs_token: boolean; now: number;
}
export interface SiteFacts {
  name: string; latitude: Num; longitude: Num; height: Num; time_zone: string | null;
  rangers: { name: string; x: Num; y: Num; z: Num; kind: "ground" | "feed" | "other" }[];
  targets: { name: string[]; x: Num[]; y: Num[]; z: Num[]; body: string[] };
  structure: { name: string; body: string; x: number[]; y: number[]; z: number[] }[];
  runs: { run: number; uuid: string; started: Num; ended: Num }[];
  since: Num; until: Num;
}
export interface Problem {
  id: string; severity: string; text: string; since: Num;
  acknowledged_by: string | null; acknowledged_at: Num; shelved_by: string | null; shelved_until: Num;
}
export interface EpochSummary {
  number: number; mjd: number; points: Num; shots: Num; rejected: Num; variance_factor: Num;
  degrees_of_freedom: Num; refractivity_ppm: Num; verdict: unknown; verdict_text?: string | null; azimuth: Num; elevation: Num; run?: number | null;
}
export interface LastShot { number: number; target: string; status: string; range: Num; u_range: Num; misfit: Num }
export interface RangerState {
  name: string; mjd: Num; state: string; word: string; sign: string; trouble: string | null;
  shots: Num; failures: Num; stream: unknown; last: LastShot | null; next: string | null; next_mjd?: Num;
}
export interface Posture { mjd: number; azimuth: Num; elevation: Num; azimuth_rate: Num; elevation_rate: Num }
export interface Weather { station: string; mjd: number; temperature_c: Num; pressure_hpa: Num; humidity_percent: Num }
export interface Sun { azimuth: number; elevation: number; cone: number }
export interface State {
  mjd: Num; received: Num; source: "live" | "journal"; connected: boolean; trouble?: string | null;
  word: string | null; mode: string | null; round: unknown; shots: { numbered: Num; acknowledged: Num } | null;
  clock: unknown; disk: unknown; journal: unknown; lease: unknown;
  problems: Problem[]; verdict: unknown; verdict_text?: string | null; epoch: EpochSummary | null; posture: Posture | null;
  weather: Weather[]; sun: Sun | null; rangers: RangerState[];
}
