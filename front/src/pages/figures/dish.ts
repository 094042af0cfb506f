// The dish of an epoch: map of deviations, actuators and Zernike coefficients.
import type { Chart, Table } from "../../lib/types";
import type { Surface } from "../answers";
import { known, number, text, times } from "./columns";

export type Shows = "deviation" | "u" | "actuators";

/** Circle of the aperture. */
function outline(s: Surface): { x: number[]; y: number[] } | null {
  const { x, y, radius } = s.aperture ?? {};
  if (!known(x) || !known(y) || !known(radius)) return null;
  const turns = Array.from({ length: 91 }, (_, i) => (2 * Math.PI * i) / 90);
  return { x: turns.map((t) => x + radius * Math.cos(t)), y: turns.map((t) => y + radius * Math.sin(t)) };
}

export function dishMap(s: Surface, shows: Shows): Chart {
  const p = s.points, a = s.actuators, rim = outline(s);
  const axes = (x: Chart["x"]["values"], y: Chart["x"]["values"]): Pick<Chart, "x" | "y" | "outline"> => ({ x: { label: "x of the dish", unit: "m", values: x ?? [] }, y: { label: "y of the dish", unit: "m", values: y ?? [] }, ...(rim ? { outline: [rim] } : {}) });
  if (shows === "actuators" && a) return { type: "map", ...axes(a.x, a.y), name: a.name, value: { label: "actuator", unit: "mm", values: times(a.value, 1000) } };
  if (shows === "u") return { type: "map", ...axes(p.x, p.y), name: p.name, value: { label: "u of the deviation", unit: "mm", values: times(p.u, 1000) } };
  return { type: "map", ...axes(p.x, p.y), name: p.name, value: { label: "deviation along the normal", unit: "mm", values: times(p.deviation, 1000) } };
}

const label = (z: Surface["zernike"][number]): string => `Z(${z.n}, ${z.m < 0 ? "−" : ""}${Math.abs(z.m)})${z.name ? ` ${z.name}` : ""}`;

export function zernikeBars(s: Surface): Chart {
  return {
    type: "bars", x: { label: "Zernike term", unit: "", values: s.zernike.map((_, i) => i), categories: s.zernike.map((z) => `${z.n}, ${z.m < 0 ? "−" : ""}${Math.abs(z.m)}`) },
    y: { label: "coefficient", unit: "mm", values: times(s.zernike.map((z) => z.value), 1000) }, u: times(s.zernike.map((z) => z.u), 1000), name: s.zernike.map(label),
  };
}

export function zernikeTable(s: Surface): Table {
  const z = s.zernike;
  return {
    name: "term",
    columns: [text("term", "term", z.map(label)), number("n", "n", "", z.map((k) => k.n), { digits: 0 }), number("m", "m", "", z.map((k) => k.m), { digits: 0 }), number("value", "coefficient", "mm", times(z.map((k) => k.value), 1000), { u: "u" }), number("u", "u", "mm", times(z.map((k) => k.u), 1000), { digits: 4 }), number("ratio", "value / u", "", z.map((k) => (k.value !== null && k.u ? k.value / k.u : null)), { digits: 1 })],
  };
}

export function dishTable(s: Surface): Table {
  const p = s.points;
  return {
    name: "name",
    columns: [text("name", "point", p.name), number("x", "x", "m", p.x, { digits: 3 }), number("y", "y", "m", p.y, { digits: 3 }), number("deviation", "deviation", "mm", times(p.deviation, 1000), { u: "u" }), number("u", "u", "mm", times(p.u, 1000), { digits: 4 })],
  };
}

export function actuatorTable(s: Surface): Table | null {
  const a = s.actuators;
  return a && { name: "name", columns: [text("name", "actuator", a.name), number("x", "x", "m", a.x, { digits: 3 }), number("y", "y", "m", a.y, { digits: 3 }), number("value", "actuator", "mm", times(a.value, 1000), { digits: 3 })] };
}
