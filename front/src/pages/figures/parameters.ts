// Parameters of a site: their groups, what waits, and beside which one a refusal stands.
import type { Parameter } from "../answers";

export interface Group { changes: string; title: string; note: string; parameters: Parameter[] }

const TITLES: [changes: string, title: string, note: string][] = [
  ["coordinator", "Coordinator", "Active at once after Start."], ["plan", "Plan of rounds", "From the next round on."],
  ["shots", "Sampling of shots", "Sent to every ranger before its next shot."], ["answers", "Answers", "Journalled at its place; a replay changes there, too."],
  ["safety", "Safety", "Only ever stricter than the records."], ["output", "Output", "From the next epoch on."],
];

/** Parameters by what they change, in a fixed order; those of an unknown kind come last. */
export function groups(all: Parameter[]): Group[] {
  const known = new Set(TITLES.map(([changes]) => changes));
  const more = [...new Set(all.map((p) => p.changes))].filter((changes) => !known.has(changes)).map((changes): [string, string, string] => [changes, changes, ""]);
  return [...TITLES, ...more].map(([changes, title, note]) => ({ changes, title, note, parameters: all.filter((p) => p.changes === changes) })).filter((g) => g.parameters.length);
}

/** Parameters with a value that is set and not started. */
export const waiting = (all: Parameter[]): Parameter[] => all.filter((p) => p.stage === "set" || p.stage === "prepared");

/** Name of the parameter beside which the refusal of a set stands: the first named there that is of the set, else the first named. */
export function beside(refusal: string, all: Parameter[], set: string[]): string | null {
  const named = (refusal.match(/[a-z][a-z0-9_]+/g) ?? []).filter((word) => all.some((p) => p.name === word));
  return named.find((name) => set.includes(name)) ?? named[0] ?? null;
}

export const unitText = (unit: string): string => (unit === "deg" ? "°" : unit);

/** A value with its unit: "20 s", "none", "5°". */
export const withUnit = (value: string, unit: string): string => (!unit || value === "none" ? value : value + (unit === "deg" ? "" : "\u00a0") + unitText(unit));

/** A text of the coordinator's port, whose commas are semicolons there. */
export const prose = (text: string): string => text.replace(/(?<! );/g, ",");

/** Legal values in words, numbers with their unit: "1 to 10000 Hz, an integer". */
export function limits(p: Parameter): string {
  if (p.choices.length) return p.choices.join(", ");
  const number = /^([\d.]+ to [\d.]+)(.*)$/.exec(p.legal);
  return prose(number?.[1] ? withUnit(number[1], p.unit) + number[2] : p.legal);
}
