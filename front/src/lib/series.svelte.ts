// Bounded buffers of live values by the names of /api/series, filled while some page asks for them.
import type { Num } from "./types";

const MOST = 20_000; // values a name: half an hour at 10 Hz

export class Buffer {
  mjd: number[] = [];
  value: Num[] = [];
  u: Num[] = [];
  /** Grows with each value: what a chart depends on. */
  version = $state(0);

  push(mjd: number, value: Num, u: Num = null): void {
    if (this.mjd.length >= MOST) for (const column of [this.mjd, this.value, this.u]) column.splice(0, MOST / 4);
    this.mjd.push(mjd);
    this.value.push(value);
    this.u.push(u);
    this.version += 1;
  }
}

type Row = Record<string, Num | string | undefined>;

class Buffers {
  private held = new Map<string, { buffer: Buffer; users: number }>();

  /** The buffer of a series such as "range:ZY105:TR03-R"; call `release` when it is no longer shown. */
  record(name: string): { buffer: Buffer; release: () => void } {
    const entry = this.held.get(name) ?? { buffer: new Buffer(), users: 0 };
    entry.users += 1;
    this.held.set(name, entry);
    return {
      buffer: entry.buffer,
      release: () => {
        entry.users -= 1;
        if (entry.users === 0) this.held.delete(name);
      },
    };
  }

  take(kind: string, data: unknown): void {
    if (this.held.size === 0 || !data || typeof data !== "object") return;
    for (const row of Array.isArray(data) ? data : [data]) this.row(kind, row as Row);
  }

  private row(kind: string, row: Row): void {
    const mjd = row.mjd;
    if (typeof mjd !== "number") return;
    const put = (name: string, value: Num | string | undefined, u?: Num | string): void => {
      const entry = this.held.get(name);
      if (entry && typeof value === "number") entry.buffer.push(mjd, value, typeof u === "number" ? u : null);
    };
    if (kind === "shot") {
      put(`range:${row.ranger}:${row.target}`, row.range, row.u_range);
      put(`correction:${row.ranger}:${row.target}`, row.misfit, row.u_range);
      put(`amplitude:${row.ranger}`, row.amplitude_v);
    } else if (kind === "weather") {
      put(`temperature:${row.station}`, row.temperature_c);
      put(`pressure:${row.station}`, row.pressure_hpa);
      put(`humidity:${row.station}`, row.humidity_percent);
    } else if (kind === "posture") {
      put("azimuth", row.azimuth);
      put("elevation", row.elevation);
    } else if (kind === "epoch") {
      put("refractivity", row.refractivity_ppm);
      put("variance_factor", row.variance_factor);
    }
  }
}

export const buffers = new Buffers();
