import assert from "node:assert/strict";
import { test } from "node:test";
import { estimates, meanPath, pathTable, stationRows } from "../src/pages/figures/air.ts";
import { age, endOf, standing } from "../src/pages/figures/calibrations.ts";
import { alongU, decimal, median } from "../src/pages/figures/columns.ts";
import { comparisonTable, ranked, usualScale } from "../src/pages/figures/comparison.ts";
import { dishMap } from "../src/pages/figures/dish.ts";
import { displacements, networkScene, networkTable, worst } from "../src/pages/figures/network.ts";
import { changes, ellipsoid, lastRow, neighbours } from "../src/pages/figures/point.ts";
import { beside, groups, limits, prose, waiting, withUnit } from "../src/pages/figures/parameters.ts";
import { filtered, residualTable, spread } from "../src/pages/figures/residuals.ts";
import { ARCSECONDS, beamChart, correction, healthTable, last, moveRows, poses, scaled } from "../src/pages/figures/samplers.ts";
import { deviations, fitRows, samplesChart, spectrumChart, stepText } from "../src/pages/figures/shot.ts";
import { appended, droppedTable, marks, panels, seriesTable } from "../src/pages/figures/strips.ts";
import { aligned, indexAt } from "../src/parts/strip.ts";

const near = (a, b, tolerance, why) => assert.ok(Math.abs(a - b) <= tolerance, `${why ?? ""} ${a} is not ${b}`);
const column = (table, key) => table.columns.find((c) => c.key === key).values;
const round = (sigma) => ({ xx: [sigma ** 2], xy: [0], xz: [0], yy: [sigma ** 2], yz: [0], zz: [sigma ** 2] });
const S = 1 / 86400;

test("a line breaks at a gap, and not between bins that are wider than the gap", () => {
  const strip = (mjd, gap) => aligned({ label: "", unit: "", gap, marks: [], span: [0, 1], series: [{ name: "a", label: "a", mjd, value: mjd.map(() => 1) }] });
  const [t, v] = strip([0, 10 * S, 20 * S, 200 * S, 210 * S], 60);
  assert.deepEqual(v, [1, 1, 1, null, 1, 1]);
  near(t[3] - t[0], 110, 1e-6, "in the middle of the gap:");
  assert.ok(!strip([0, 100 * S, 200 * S, 300 * S], 60)[1].includes(null));
});

test("the band is u about the value, or the extremes of a bin", () => {
  const series = (more) => aligned({ label: "", unit: "", gap: 60, marks: [], span: [0, 1], series: [{ name: "a", label: "a", mjd: [0], value: [5], ...more }] }).slice(1).map((c) => c[0]);
  assert.deepEqual(series({ u: [2] }), [5, 3, 7]);
  assert.deepEqual(series({ u: [2], low: [1], high: [10] }), [5, 1, 10]);
  assert.deepEqual(series({}), [5, 5, 5]);
});

test("the value at the cursor is the last one before it", () => {
  assert.deepEqual([-1, 0, 0.5, 2, 9].map((t) => indexAt([0, 1, 2], t)), [-1, 0, 0, 2, 2]);
  assert.equal(indexAt([], 1), -1);
});

test("what is new goes behind what was there, once, and what is too old goes", () => {
  const one = (mjd, value, u = null) => ({ gaps: 60, names: [{ name: "a", label: "a", unit: "m", mjd, value, u, low: null, high: null }] });
  const next = appended(one([1, 2, 3], [10, 20, 30], [0.1, 0.2, 0.3]), one([3, 4], [30, 40], [0.3, 0.4]), 2).names[0];
  assert.deepEqual([next.mjd, next.value, next.u, next.low], [[2, 3, 4], [20, 30, 40], [0.2, 0.3, 0.4], null]);
  assert.deepEqual(appended(one([1, 2], [1, 2]), one([], []), 1.5).names[0].mjd, [2]);
  assert.deepEqual(appended(one([1, 2], [1, 2]), one([7], [7]), 6).names[0].value, [7]);
  const binned = one([1, 2], [1, 2]);
  Object.assign(binned.names[0], { low: [0, 1], high: [2, 3] });
  const after = appended(binned, one([3], [9]), 0).names[0];
  assert.deepEqual([after.low, after.high], [[0, 1, 9], [2, 3, 9]]);
});

test("one strip for a quantity, but one for each range and coordinate", () => {
  const of = (name) => ({ name, label: name, unit: "m", mjd: [1], value: [1], u: null, low: null, high: null });
  const shown = panels(["amplitude:ZY101", "amplitude:ZY102", "range:ZY101:A", "range:ZY102:A", "refractivity"].map(of));
  assert.deepEqual(shown.map((p) => p.series.length), [2, 1, 1, 1]);
  assert.deepEqual(column(seriesTable([of("a")], [2, 3]), "name"), []);
});

test("alarms are marked as alarms, epochs by their number", () => {
  const list = marks({ mjd: [2, 1, 3], severity: ["alarm", "warning", "note"], who: ["a", "b", "c"], kind: [], text: ["x", "y", "z"] }, [{ mjd: 2.5, number: 7 }]);
  assert.deepEqual(list.map((m) => m.kind), ["warning", "alarm", "epoch", "event"]);
  assert.equal(list[2].text, "epoch 7");
  assert.deepEqual(column(droppedTable({ rangers: ["A", "B"], bins: [0, 1], good: [[3, 1], [0, 0]], failed: [[0, 4], [0, 0]] }), "share"), [50, null]);
});

test("a calibration ends with its last day", () => {
  const k = { valid_from: "2026-01-01", valid_until: "2026-11-27", valid: true };
  assert.equal(endOf(k), 61372);
  const words = [60000, 61300, 61371.99, 61372].map((t) => standing(k, t).word);
  assert.deepEqual(words, ["future", "valid", "soon", "expired"]);
  assert.equal(standing({ valid_from: null, valid_until: null, valid: null }, 61371).word, "undated");
  assert.equal(standing({ valid_from: 61000, valid_until: null, valid: true }, 61371).word, "valid");
  assert.equal(age(k, 61371.5), ", 0 d left");
});

test("the uncertainty of a length lies along its direction", () => {
  const c = { xx: [4], xy: [0], xz: [0], yy: [9], yz: [0], zz: [16] };
  near(alongU([5, 0, 0], c, 0), 2, 1e-15);
  near(alongU([0, -3, 0], c, 0), 3, 1e-15);
  near(alongU([1, 1, 1], c, 0), Math.sqrt(29 / 3), 1e-15);
  assert.equal(alongU([1, null, 0], c, 0), null);
  assert.equal(decimal(-0.0004, 3, "m"), "0.000\u00a0m");
  assert.equal(median([3, null, 1, 2]), 2);
});

const epoch = {
  points: { name: ["A", "B"], x: [0, 10], y: [0, 0], z: [0, 0], covariance: { xx: [1e-8, 4e-8], xy: [0, 0], xz: [0, 0], yy: [1e-8, 1e-8], yz: [0, 0], zz: [1e-8, 1e-8] }, shots: [2, 1] },
  beams: { ranger: ["R", "R", "R", "X"], target: ["A", "A", "B", "A"], shot: [1, 2, 3, 4], w: [1, -2, null, 9] }, structure: [], rejected: [],
};
const site = { rangers: [{ name: "R", x: 1, y: 2, z: 3, kind: "ground" }], targets: { name: ["A", "B"], x: [0, 10], y: [0, 0], z: [0, 0], body: ["dish", "ground"] }, structure: [], runs: [] };

test("beams join the places of their ends, and one without a place is left out", () => {
  const scene = networkScene(epoch, site, { colour: "w", component: "x", beams: true, structure: true }, null);
  assert.deepEqual(scene.points.name, ["A", "B", "R"]);
  assert.deepEqual([scene.beams.from, scene.beams.to], [[2, 2, 2], [0, 0, 1]]);
  assert.deepEqual(scene.points.covariance.xx, [1e-8, 4e-8, null]);
  assert.deepEqual(scene.points.group.map((g) => scene.groups[g]), ["dish", "ground", "rangers"]);
  assert.equal(worst(epoch).get("A"), 9);
  assert.deepEqual(scene.value.values, [9, null, null]);
  near(column(networkTable(epoch, site, null, "x"), "ux")[1], 2e-4, 1e-15);
});

test("displacements are in mm and ranked by their test", () => {
  const c = { name: ["A", "B"], dx: [1e-3, 3e-3], dy: [0, 4e-3], dz: [0, 0], w: [5, 2], significant: [true, false], covariance: epoch.points.covariance, verdict: "doubtful" };
  near(displacements(c, "length").get("B"), 5, 1e-12);
  near(displacements(c, "x").get("A"), 1, 1e-12);
  assert.deepEqual(ranked(c).map((r) => r.row), [0, 1]);
  assert.deepEqual(column(comparisonTable(c), "significant"), ["moved", "no"]);
  assert.equal(usualScale(c, epoch), 1000);
});

test("residuals: the worst first, of one ranger, in numbers", () => {
  const r = { shot: [1, 2, 3], ranger: ["R", "S", "R"], target: ["A", "A", "B"], mjd: [0, 1, 2], elevation: [0, 1, 1], residual: [1e-4, -3e-4, null], u: [1e-4, 1e-4, null], w: [1, -3, null], status: ["used", "used", "blocked"] };
  assert.deepEqual(column(residualTable(r), "shot"), [2, 1, 3]);
  assert.deepEqual(filtered(r, { ranger: "R", target: "" }).shot, [1, 3]);
  near(spread(r.w).rms, Math.sqrt(5), 1e-12);
  assert.equal(spread(r.w).two, 50);
  assert.equal(spread([null]).rms, null);
});

test("a point's changes are about its median, its ellipsoid is that of its covariance", () => {
  const p = { name: "A", body: "dish", mjd: [1, 2, 3], x: [1, 1.002, null], y: [0, 0, 0], z: [0, 0, 0], covariance: { xx: [4e-8, 4e-8, null], xy: [0, 0, 0], xz: [0, 0, 0], yy: [1e-8, 1e-8, 0], yz: [0, 0, 0], zz: [9e-8, 9e-8, 0] } };
  assert.equal(lastRow(p), 1);
  const { about, series } = changes(p, "x");
  near(series.value[0] - series.value[1], -2, 1e-9);
  assert.equal(about, 1.002);
  near(series.u[0], 0.2, 1e-12);
  const axes = ellipsoid(p, 1);
  [3e-4, 2e-4, 1e-4].forEach((u, k) => near(axes[k].u, u, 1e-12));
  near(Math.abs(axes[0].direction[2]), 1, 1e-12);
  near(axes[1].wide / axes[1].u, 2.7955, 1e-4);
  assert.equal(ellipsoid({ ...p, covariance: null }, 1), null);
  assert.deepEqual(neighbours(site, "A"), [{ name: "B", body: "ground", distance: 10 }]);
  assert.deepEqual(neighbours(site, "nobody"), []);
});

test("phases turn about their mean, across half a turn too", () => {
  const turned = deviations([Math.PI - 0.01, -Math.PI + 0.01, null]);
  near(turned[0], -0.01, 1e-12);
  near(turned[1], 0.01, 1e-12);
  assert.equal(turned[2], null);
});

test("no line of a spectrum is lost where several share a mark", () => {
  const n = 40_000, amplitude = new Array(n).fill(1e-6);
  amplitude[12_345] = 1;
  const chart = spectrumChart({ sample_rate_hz: 2, volts: [], spectrum: { frequency_hz: amplitude.map((_, i) => i), amplitude_v: amplitude }, harmonics: [{ n: 1, frequency_hz: 12_345, amplitude_v: 1 }, { n: 2, frequency_hz: 50_000, amplitude_v: null }], cycle_phase: { t: [], phase: [] }, fit: null }, null);
  const at = chart.y.values.findIndex((v, i) => chart.group[i] === 0 && v > -1);
  assert.equal(chart.x.values[at], 12_345);
  assert.ok(chart.y.values.length < 5000);
  assert.deepEqual(chart.y.values.filter((_, i) => chart.group[i] === 1), [2, 10, null]);
});

test("samples of a stretch keep their time", () => {
  const chart = samplesChart({ sample_rate_hz: 1000, volts: Array.from({ length: 100 }, (_, i) => i) }, 0.01, 0.005);
  assert.deepEqual(chart.x.values, [10, 11, 12, 13, 14]);
  assert.deepEqual(chart.y.values, [10, 11, 12, 13, 14]);
  assert.deepEqual(fitRows({ amplitude_v: 1, u_amplitude_v: 0.1, clipped: 0, word: "x" }), [{ name: "amplitude", value: 1, u: 0.1, unit: "V" }, { name: "clipped", value: 0, u: null, unit: "" }]);
  assert.equal(stepText({ value: 100.12345678, unit: "m" }), "100.1234568\u00a0m");
  assert.equal(stepText({ value: 1322, unit: "" }), "1322");
});

test("air: a path's delay, the adjustment's word on stations, and the aperture of a map", () => {
  const a = { paths: { ranger: ["R"], target: ["A"], length: [100], refractivity_ppm: [250], u: [0.15], temperature_c: [null] }, stations: [{ name: "W", offset_c: 1, u_offset_c: 0.5, read: null }], profile: { bend: { value: 1, u: 2 }, height: [1] } };
  near(column(pathTable(a), "delay")[0], 25, 1e-12);
  assert.deepEqual(stationRows(a.stations), [{ name: "W", read: null, offset: 1, u: 0.5 }]);
  assert.deepEqual(estimates(a), [{ name: "bend", value: 1, u: 2 }]);
  assert.deepEqual(meanPath(a), { mean: 250, spread: null });
  const map = dishMap({ points: { name: [], x: [], y: [], deviation: [], u: [] }, actuators: null, zernike: [], rms: 0, verdict: null, aperture: { x: 0, y: 54, radius: 50 } }, "deviation");
  map.outline[0].x.forEach((x, i) => near(Math.hypot(x, map.outline[0].y[i] - 54), 50, 1e-9));
});

const parameter = (name, more = {}) => ({ name, value: "10", waiting: "none", legal: "2 to 600", choices: [], unit: "", changes: "plan", meaning: "", stage: "none", ...more });

test("a refusal stands beside the parameter of the set that it names, else beside the first", () => {
  const all = [parameter("round_s"), parameter("rate_hz"), parameter("cycles")];
  const text = "The site refused: rate_hz = 0.05 gives no shot in round_s = 10 (expected at least 0.1)";
  assert.equal(beside(text, all, ["round_s"]), "round_s");
  assert.equal(beside(text, all, ["cycles"]), "rate_hz");
  assert.equal(beside("The site is not connected", all, ["round_s"]), null);
});

test("parameters are grouped by what they change, and one of an unknown kind is not lost", () => {
  const all = [parameter("a", { changes: "safety" }), parameter("b"), parameter("c", { changes: "colour" })];
  assert.deepEqual(groups(all).map((g) => g.parameters[0].name), ["b", "a", "c"]);
  assert.deepEqual(waiting([parameter("a", { stage: "started" }), parameter("b", { stage: "prepared" }), parameter("c", { stage: "set" })]).map((p) => p.name), ["b", "c"]);
});

test("limits have the unit behind their numbers", () => {
  assert.equal(limits(parameter("if_hz", { unit: "Hz", legal: "1 to 10000; an integer" })), "1 to 10000\u00a0Hz, an integer");
  assert.equal(limits(parameter("sun_cone_deg", { unit: "deg", legal: "0.5 to 60" })), "0.5 to 60°");
  assert.equal(limits(parameter("boxes", { unit: "m", legal: "name x1 y1 z1; with ; between boxes; or none" })), "name x1 y1 z1, with ; between boxes, or none");
  assert.equal(limits(parameter("corrections", { choices: ["off", "on"] })), "off, on");
  assert.equal(withUnit("none", "mm"), "none");
  assert.equal(prose("a; b"), "a, b");
});

test("beam offsets are seconds of arc with u, by direction", () => {
  const s = { name: "BEAM", mjd: [1, 1 + 60 * S], columns: { epoch: [1, 2], azimuth_cos_e_rad: [0, 1e-5], elevation_rad: [null, -2e-5], azimuth_azimuth_rad2: [0, 4e-12], elevation_elevation_rad2: [null, 1e-12] } };
  const c = beamChart(s);
  near(c.y.values[1], 1e-5 * ARCSECONDS, 1e-9);
  near(c.u[1], 2e-6 * ARCSECONDS, 1e-9);
  near(c.x.values[0], -1, 1e-9, "minutes:");
  assert.deepEqual([c.y.values[2], c.group, c.name[3]], [null, [0, 0, 1, 1], "elevation, epoch 2"]);
});

test("the last pose of each body: mm and seconds of arc", () => {
  const zero = Object.fromEntries(["y_m", "z_m", "ry_rad", "rz_rad"].map((key) => [key, [0, 0, 0]]));
  const s = { name: "POSE", mjd: [1, 1, 2], columns: { ...zero, epoch: [2, 2, 3], reference: [1, 1, 1], body: ["dish", "arm", "dish"], x_m: [9, 3e-3, 1e-3], x_x_m2: [1, 1, 4e-8], rx_rad: [0, 0, 1e-6], rx_rx_rad2: [0, 0, 1e-14] } };
  const [dish, arm] = poses(s);
  assert.deepEqual([dish.body, dish.epoch, arm.motions[0].value, dish.motions[0].value, dish.motions[0].unit], ["dish", 3, 3, 1, "mm"]);
  assert.deepEqual(poses({ ...s, columns: { ...s.columns, reference: [1, 1, 3] } })[0].motions.map((m) => m.value), [0, 0, 0, 0, 0, 0]);
  near(dish.motions[0].u, 0.2, 1e-12);
  near(dish.motions[3].value, 1e-6 * ARCSECONDS, 1e-12);
  assert.deepEqual([dish.motions[3].unit, dish.motions[1].u], ["″", null]);
});

test("corrections of the reference epoch are zero, and unknown ones say so", () => {
  const row = { epoch: 3, reference: 2, focus_m: -1e-3, u_focus_m: 2e-4, elevation_rad: null, u_elevation_rad: null };
  assert.equal(correction(row, "focus_m", 1e3, "mm"), "\u22121.00 ± 0.20\u00a0mm");
  assert.equal(correction(row, "elevation_rad", 1, "″"), "unknown");
  assert.equal(correction({ ...row, epoch: 2 }, "focus_m", 1e3, "mm"), "0: this epoch is the zero");
  assert.equal(correction({ ...row, epoch: 2 }, "elevation_rad", 1, "″"), "unknown");
});

test("health is the last report of each ranger, in their order", () => {
  const s = { name: "HEALTH", mjd: [1, 2, 3], columns: { ranger: ["ZY110", "ZY102", "ZY110"], state: ["ready", "ready", "hold"], clock_offset_s: [0.1, null, 2e-3] } };
  const t = healthTable(s);
  assert.deepEqual([column(t, "ranger"), column(t, "state"), column(t, "clock_offset")], [["ZY102", "ZY110"], ["ready", "hold"], [null, 2]]);
  assert.deepEqual(moveRows({ name: "MOVES", mjd: [1, 2], columns: { actuator: ["a", "b"], value: [1, 2], unit: ["mm", "mm"], by: ["anna", "bert"], reference: [1, 1] } }).map((r) => r.actuator), ["b", "a"]);
  const row = last(s);
  assert.deepEqual([row.state, scaled(row, "clock_offset_s", 1e3), scaled(row, "state", 1)], ["hold", 2, null]);
  assert.equal(last({ name: "HEALTH", mjd: [], columns: {} }), null);
});
