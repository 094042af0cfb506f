import assert from "node:assert/strict";
import { test } from "node:test";
import { fixed, plain, shown } from "../src/parts/number.ts";

// Spaces before a unit do not break; the minus sign is U+2212.
const text = (...values) => shown(...values).replaceAll("\u00a0", " ").replaceAll("\u2212", "-");

test("a value is rounded by two significant digits of its uncertainty", () => {
  const cases = [
    [[12.345678, 0.00123, "m"], "12.3457 ± 0.0012 m"],
    [[-12.345678, 0.00123, "m"], "-12.3457 ± 0.0012 m"],
    [[12.345678, 0.0996, "m"], "12.35 ± 0.10 m"], // rounding of u adds a digit
    [[12.345678, 0.00999, "m"], "12.346 ± 0.010 m"],
    [[12, 0.5, "mm"], "12.00 ± 0.50 mm"],
    [[1234.5, 12, "m"], "1235 ± 12 m"], // a half goes away from zero
    [[123456, 1234, "Pa"], "123500 ± 1200 Pa"],
    [[-0.0004, 0.12, "mm"], "0.00 ± 0.12 mm"], // no sign on what rounding made zero
    [[0, 0.0012, "m"], "0.0000 ± 0.0012 m"],
    [[1.2345e-9, 1.2e-11, "m"], "(1.235 ± 0.012) × 10⁻⁹ m"],
    [[3.2, 0.11], "3.20 ± 0.11"],
    [[21.5, 0.25, "°C"], "21.50 ± 0.25 °C"],
    [[45.2, 0.31, "°"], "(45.20 ± 0.31)°"],
    [[5, 0, "m"], "5 m"],
    [[5.125, null, "m"], "5.125 m"],
    [[5.125, undefined, "m"], "5.125 m"],
    [[5.125, NaN, "m"], "5.125 m"],
    [[null, 0.1, "m"], "unknown"],
    [[NaN, 0.1, "m"], "unknown"],
    [[Infinity, 0.1, "m"], "unknown"],
  ];
  for (const [values, expected] of cases) assert.equal(text(...values), expected);
});

test("minus is the sign and not the hyphen", () => {
  assert.ok(shown(-1.5, 0.1, "m").startsWith("\u22121.50"));
  assert.equal(fixed(-1.25, 1), "\u22121.3");
  assert.equal(fixed(-0.001, 2), "0.00");
});

test("a value without uncertainty has six significant digits and no zeros at its end", () => {
  assert.equal(plain(0.1 + 0.2), "0.3");
  assert.equal(plain(61371.123456), "61371.1");
  assert.equal(plain(12345678), "12345678");
  assert.equal(plain(0.0000123), "1.23 × 10⁻⁵");
  assert.equal(plain(-4e-7), "\u22124 × 10⁻⁷");
  assert.equal(plain(0), "0");
  assert.equal(plain(null), "unknown");
});
