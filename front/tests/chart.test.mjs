import assert from "node:assert/strict";
import { test } from "node:test";
import { scale } from "../src/parts/axes.ts";
import { quantile, scaled, ticks } from "../src/parts/dom.ts";
import { bins, marksOf, normalQuantile } from "../src/parts/marks.ts";

const axis = (label, unit, values) => ({ label, unit, values });

test("ticks are round, inside, and no more than asked for", () => {
  assert.deepEqual(ticks(0, 10, 5).at, [0, 2, 4, 6, 8, 10]);
  assert.equal(ticks(-0.12, 0.31, 6).digits, 1);
  for (let i = 1; i < 300; i++) {
    const low = Math.sin(i) * 10 ** (i % 7) - 3;
    const high = low + 10 ** ((i % 23) - 11) * (1 + (i % 9));
    const { at, step } = ticks(low, high, 6);
    assert.ok(at.length <= 8 && at.every((v) => v >= low - 1e-6 * step && v <= high + 1e-6 * step));
    assert.ok([1, 2, 5, 10].some((f) => Math.abs(Math.log10(step / f) - Math.round(Math.log10(step / f))) < 1e-9));
  }
});

test("axes have the prefix that reads best", () => {
  assert.deepEqual(scaled(0.0002, "m"), [1e3, "mm"]);
  assert.deepEqual(scaled(2e-6, "m"), [1e6, "µm"]);
  assert.deepEqual(scaled(20, "m"), [1, "m"]);
  assert.deepEqual(scaled(0.0002, "K"), [1, "K"]);
  const s = scale(axis("residual", "m"), -2e-4, 2e-4);
  assert.equal(s.title, "residual (mm)");
  assert.deepEqual(s.at(4).map((t) => t.text), ["\u22120.2", "\u22120.1", "0.0", "0.1", "0.2"]);
});

test("an axis of instants has hours of UTC, and its day in the title", () => {
  const s = scale(axis("time", "MJD"), 61371 + 1 / 24, 61371 + 9 / 24);
  assert.equal(s.title, "time (UTC on 2026-11-27)");
  assert.deepEqual(s.at(5).map((t) => t.text), ["02:00", "04:00", "06:00", "08:00"]);
});

test("normal quantiles agree with the tables", () => {
  for (const [p, z] of [[0.5, 0], [0.975, 1.959964], [0.025, -1.959964], [0.999, 3.090232], [0.8413447, 1]]) assert.ok(Math.abs(normalQuantile(p) - z) < 4.5e-4);
});

test("bins hold every value once, within their edges", () => {
  const values = Array.from({ length: 997 }, (_, i) => normalQuantile((i + 0.5) / 997) * 3 + 1);
  const { edges, counts } = bins(values);
  assert.equal(counts.reduce((a, b) => a + b), 997);
  counts.forEach((count, k) => assert.equal(count, values.filter((v) => v >= edges[k] - 1e-12 && v < edges[k + 1] - 1e-12).length));
  assert.ok(counts.length >= 8 && counts.length <= 70);
  assert.deepEqual(bins([]).counts, [0]);
  assert.equal(bins([2, 2, 2]).counts.reduce((a, b) => a + b), 3);
});

test("a line breaks where a value is unknown, a scatter plot leaves it out", () => {
  const x = axis("x", "m", [1, 2, 3, null]);
  const y = axis("y", "m", [1, null, 3, 4]);
  assert.deepEqual(marksOf({ type: "line", x, y }).map((m) => m.y), [1, NaN, 3]);
  assert.deepEqual(marksOf({ type: "scatter", x, y, name: ["a", "b", "c", "d"] }).map((m) => m.name), ["a", "c"]);
});

test("a normal plot is a straight line for normal values", () => {
  const values = Array.from({ length: 500 }, (_, i) => 5 + 2 * normalQuantile((((i * 211) % 500) + 0.5) / 500));
  const marks = marksOf({ type: "normal", x: axis("w", "", values) });
  // Positions (i + 0.5) / n of these values and (i + 0.625) / (n + 0.25) of the plot differ by 0.07 sigma at the ends.
  for (const m of marks) assert.ok(Math.abs(m.y - (5 + 2 * m.x)) < (Math.abs(m.x) < 2.5 ? 0.05 : 0.2));
});

test("quantiles leave unknown values out", () => {
  assert.equal(quantile([3, null, 1, NaN, 2], 0.5), 2);
  assert.ok(Number.isNaN(quantile([], 0.5)));
});
