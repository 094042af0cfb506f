// Short names of what the parts reckon with; a report's script must stay small.
export const { abs, ceil, cos, floor, hypot, log10, max, min, PI, round, sin, sqrt, tan } = Math;
export const clamp = (value: number, low: number, high: number): number => min(max(value, low), high);
export const known = (value: unknown): value is number => Number.isFinite(value);
