// Directions of the rangers' beams in the sky: from the ranger's place to where its target is.
import type { RangerState, SiteFacts } from "./state";

export interface Places { name: string[]; x: (number | null)[]; y: (number | null)[]; z: (number | null)[] }
type Place = [number, number, number];

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
export function beamsOf(rangers: RangerState[], places: Map<string, Place>): { ranger: string; target: string; azimuth: number; elevation: number }[] {
  return rangers.flatMap((r) => {
    const from = places.get(r.name);
    const to = r.last ? places.get(r.last.target) : undefined;
    if (!from || !to || !r.last) return [];
    const [x, y, z] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    return [{ ranger: r.name, target: r.last.target, azimuth: Math.atan2(x, y), elevation: Math.atan2(z, Math.hypot(x, y)) }];
  });
}
