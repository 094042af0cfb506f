// Directions in the sky: beams of rangers, the Sun's cone, and where they stand in a plot seen from above.
import type { RangerState, SiteFacts } from "./state";

export interface Places { name: string[]; x: (number | null)[]; y: (number | null)[]; z: (number | null)[] }
export interface Direction { azimuth: number; elevation: number }
export interface Beam extends Direction { ranger: string; target: string }
type Place = [number, number, number];

const HALF_PI = Math.PI / 2;
const LOWEST = -0.12; // rad: what is lower stands on the plot's rim
const EDGE = 72; // sides of the cone's edge

/** Places by name: targets of the ground and rangers as the site says, all else as the last epoch found it. */
export function placesOf(facts: SiteFacts, posed: Places | null): Map<string, Place> {
  const places = new Map<string, Place>();
  const add = (name: string | undefined, x: number | null | undefined, y: number | null | undefined, z: number | null | undefined): void => {
    if (name !== undefined && x != null && y != null && z != null) places.set(name, [x, y, z]);
  };
  for (const r of facts.rangers) if (r.kind === "ground") add(r.name, r.x, r.y, r.z);
  facts.targets.name.forEach((name, k) => {
    if (facts.targets.body[k] === "ground") add(name, facts.targets.x[k], facts.targets.y[k], facts.targets.z[k]);
  });
  posed?.name.forEach((name, k) => add(name, posed.x[k], posed.y[k], posed.z[k]));
  return places;
}

/** The beam of each ranger's last shot; none where one end's place is not known. x is east, y north, z up. */
export function beamsOf(rangers: RangerState[], places: Map<string, Place>): Beam[] {
  return rangers.flatMap((r) => {
    const from = places.get(r.name);
    const to = r.last ? places.get(r.last.target) : undefined;
    if (!from || !to || !r.last) return [];
    const [x, y, z] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    return [{ ranger: r.name, target: r.last.target, azimuth: Math.atan2(x, y), elevation: Math.atan2(z, Math.hypot(x, y)) }];
  });
}

/** Place of a direction in a plot of radius 1: zenith in the middle, horizon at 1, north up (y downwards), east right. */
export function place(direction: Direction): [number, number] {
  const r = (HALF_PI - Math.max(LOWEST, direction.elevation)) / HALF_PI;
  return [r * Math.sin(direction.azimuth), -r * Math.cos(direction.azimuth)];
}

/** Angle between two directions, rad. */
export function separation(a: Direction, b: Direction): number {
  const cos = Math.sin(a.elevation) * Math.sin(b.elevation) + Math.cos(a.elevation) * Math.cos(b.elevation) * Math.cos(a.azimuth - b.azimuth);
  return Math.acos(Math.max(-1, Math.min(1, cos)));
}

/** Directions at an angle from another one, once round. */
export function coneOf(axis: Direction, angle: number): Direction[] {
  const [sin, cos] = [Math.sin(axis.elevation), Math.cos(axis.elevation)];
  return Array.from({ length: EDGE }, (_, k) => {
    const turn = (k * 2 * Math.PI) / EDGE;
    const sine = sin * Math.cos(angle) + cos * Math.sin(angle) * Math.cos(turn);
    const elevation = Math.asin(Math.max(-1, Math.min(1, sine)));
    return { elevation, azimuth: axis.azimuth + Math.atan2(Math.sin(angle) * Math.sin(turn) * cos, Math.cos(angle) - sin * sine) };
  });
}
