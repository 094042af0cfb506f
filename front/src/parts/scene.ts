// Scene on a canvas: first version, plan of the points.
import type { Scene } from "../lib/types";
import { chart } from "./chart";
import type { Options, Part } from "./dom";

export function scene(host: HTMLElement, data: Scene, options: Options = {}): Part<Scene> {
  const plan = (s: Scene) => ({ type: "map" as const, x: { label: "x", unit: "m", values: s.points.x }, y: { label: "y", unit: "m", values: s.points.y }, name: s.points.name });
  const inner = chart(host, plan(data), options);
  return { ...inner, update: (next) => inner.update(plan(next)) };
}
