import assert from "node:assert/strict";
import { test } from "node:test";
import { csvText } from "../src/parts/download.ts";
import { cellText, conditions, sorted } from "../src/parts/table.ts";

const column = (key, values, more = {}) => ({ key, label: key, unit: "", kind: "number", values, ...more });

test("unknown values come last in either direction, and equal ones stay in order", () => {
  const values = column("x", [3, null, 1, -2, null, 1]);
  const rows = [0, 1, 2, 3, 4, 5];
  assert.deepEqual(sorted(rows, values, false), [3, 2, 5, 0, 1, 4]);
  assert.deepEqual(sorted(rows, values, true), [0, 2, 5, 3, 1, 4]);
  const names = column("name", ["P10", "P2", "", "p1"], { kind: "text" });
  assert.deepEqual(sorted([0, 1, 2, 3], names, false), [3, 1, 0, 2]);
});

test("a filter has texts and conditions", () => {
  const columns = [column("u", [0.1, 0.6, null, 0.7]), column("w", [-4, 1, 2, 3.5]), column("standard deviation", [1, 2, 3, 4])];
  const texts = ["p1 north", "p2 south", "p3 north", "p4 south"];
  const rows = (filter) => [0, 1, 2, 3].filter((row) => conditions(filter, columns, (i) => texts[i]).every((test) => test(row)));
  assert.deepEqual(rows(""), [0, 1, 2, 3]);
  assert.deepEqual(rows("North"), [0, 2]);
  assert.deepEqual(rows("u>0.5"), [1, 3]);
  assert.deepEqual(rows("u > 0.5 south w>=3.5"), [3]);
  assert.deepEqual(rows("|w|>3"), [0, 3]);
  assert.deepEqual(rows("w<\u22123"), [0]);
  assert.deepEqual(rows("standarddeviation<=2"), [0, 1]);
  assert.deepEqual(rows("nothing>3"), [], "an unknown column is a text");
});

test("a cell has the decimals of its column, of its uncertainty, or of all its values", () => {
  const u = column("u", [0.0012, 0.5, null]);
  const x = column("x", [12.345678, 12.345678, 12.5], { u: "u" });
  assert.deepEqual([0, 1, 2].map((row) => cellText(x, row, u)), ["12.3457", "12.35", "12.50"]);
  assert.deepEqual([0, 1, 2].map((row) => cellText(u, row, u)), ["0.0012", "0.50", "unknown"]);
  assert.equal(cellText(column("n", [1, 20, 300]), 1), "20");
  assert.equal(cellText(column("x", [-1.23456], { digits: 2 }), 0), "\u22121.23");
});

test("CSV has units, quotes, full values and the order asked for", () => {
  const table = { columns: [column("name", ["a,b", 'c"d', "e"], { kind: "text" }), column("x", [0.1234567890123, null, -2], { unit: "m" })] };
  assert.equal(csvText(table), 'name,x (m)\r\n"a,b",0.1234567890123\r\n"c""d",\r\ne,-2\r\n');
  assert.equal(csvText(table, [2, 0]), 'name,x (m)\r\ne,-2\r\n"a,b",0.1234567890123\r\n');
});
