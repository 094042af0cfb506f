// A shot's samples, spectrum and phase per cycle as charts.
import type { Chart, Num } from "../../lib/types";
import type { Samples } from "../answers";
import { plain } from "../../parts/number";
import { decimal, known } from "./columns";

const FEW = 4096; // marks: more are shown as every n-th, and a window shows all
const decibel = (volts: Num): Num => (known(volts) && volts > 0 ? 20 * Math.log10(volts) : null);

const DECIMALS: Record<string, number> = { m: 7, rad: 6, ppm: 4 }; // 0.1 um; the last digit of a phase is 0.02 um

/** A step from phase to range at the decimals of its unit. */
export const stepText = (step: { value: Num; unit: string }): string => (step.unit in DECIMALS ? decimal(step.value, DECIMALS[step.unit] ?? 0, step.unit) : plain(step.value));

/** Samples of a stretch in s; the first hundredth by default, where single cycles are seen. */
export function samplesChart(s: Samples, from: number, length: number): Chart {
  const start = Math.max(0, Math.floor(from * s.sample_rate_hz)), count = Math.max(2, Math.ceil(length * s.sample_rate_hz));
  const volts = s.volts.slice(start, start + count), step = Math.max(1, Math.ceil(volts.length / FEW));
  const rows = volts.map((_, i) => i).filter((i) => i % step === 0);
  return { type: "line", x: { label: "time", unit: "ms", values: rows.map((i) => ((start + i) / s.sample_rate_hz) * 1000) }, y: { label: "signal", unit: "V", values: rows.map((i) => volts[i] ?? null) } };
}

export const duration = (s: Samples): number => s.volts.length / s.sample_rate_hz;

/** Amplitude spectrum in dB re 1 V; of several neighbours the largest, so that no line is lost. */
export function spectrumChart(s: Samples, most: Num): Chart {
  const f = s.spectrum.frequency_hz, rows: number[] = [], last = most === null ? f.length : f.findIndex((v) => v > most);
  const stop = last < 0 ? f.length : last, step = Math.max(1, Math.ceil(stop / FEW));
  for (let i = 0; i < stop; i += step) {
    let best = i;
    for (let k = i; k < Math.min(stop, i + step); k++) if ((s.spectrum.amplitude_v[k] ?? 0) > (s.spectrum.amplitude_v[best] ?? 0)) best = k;
    rows.push(best);
  }
  const x: Num[] = rows.map((i) => f[i] ?? null), y: Num[] = rows.map((i) => decibel(s.spectrum.amplitude_v[i] ?? null));
  const name = x.map(() => ""), group = x.map(() => 0);
  for (const h of s.harmonics) { // a short stroke above each harmonic, each a line of its own
    const level = decibel(h.amplitude_v);
    if (level === null || (most !== null && h.frequency_hz > most)) continue;
    for (const v of [level + 2, level + 10, null]) x.push(h.frequency_hz), y.push(v), name.push(`harmonic ${h.n}`), group.push(1);
  }
  return { type: "line", x: { label: "frequency", unit: "Hz", values: x }, y: { label: "amplitude", unit: "dB re 1 V", values: y }, name, group, groups: ["spectrum", "harmonics"] };
}

export function harmonicChart(s: Samples): Chart {
  return { type: "bars", x: { label: "harmonic", unit: "", values: s.harmonics.map((_, i) => i), categories: s.harmonics.map((h) => String(h.n)) }, y: { label: "amplitude", unit: "V", values: s.harmonics.map((h) => h.amplitude_v) }, name: s.harmonics.map((h) => `${h.n}: ${h.frequency_hz.toPrecision(6)} Hz`) };
}

export function phaseChart(s: Samples): Chart {
  return { type: "scatter", x: { label: "time", unit: "ms", values: s.cycle_phase.t.map((t) => t * 1000) }, y: { label: "phase", unit: "mrad", values: deviations(s.cycle_phase.phase).map((v) => (v === null ? null : v * 1000)) } };
}

/** Phases less their mean direction, within half a turn. */
export function deviations(phase: Num[]): Num[] {
  const own = phase.filter(known), mean = Math.atan2(own.reduce((a, p) => a + Math.sin(p), 0), own.reduce((a, p) => a + Math.cos(p), 0));
  return phase.map((p) => (known(p) ? Math.atan2(Math.sin(p - mean), Math.cos(p - mean)) : null));
}

/** Names and texts of a fit's numbers: "u_" of a name is its uncertainty, the end of a name its unit. */
export function fitRows(fit: Record<string, unknown> | null): { name: string; value: Num; u: Num; unit: string }[] {
  const units: [RegExp, string][] = [[/_v$/, "V"], [/_hz$/, "Hz"], [/phase$/, "rad"], [/_s$/, "s"]];
  return Object.entries(fit ?? {}).flatMap(([name, value]) => {
    if (typeof value !== "number" || name.startsWith("u_")) return [];
    const u = fit?.[`u_${name}`], ending = units.find(([end]) => end.test(name));
    return [{ name: name.replace(/_(v|hz|s)$/, "").replaceAll("_", " "), value, u: typeof u === "number" ? u : null, unit: ending?.[1] ?? "" }];
  });
}
