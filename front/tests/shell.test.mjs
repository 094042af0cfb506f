import assert from "node:assert/strict";
import { test } from "node:test";
import { silentPart, SILENCE_S } from "../src/lib/silence.ts";
import { beamsOf, coneOf, place, placesOf, separation } from "../src/lib/sky.ts";
import { age, dateOf, local, mjdOf, utc } from "../src/lib/time.ts";
import { severityOfRanger, verdictOf } from "../src/lib/words.ts";

const DEGREE = Math.PI / 180;
const near = (a, b, tolerance = 1e-12) => assert.ok(Math.abs(a - b) <= tolerance, `${a} is not ${b}`);

test("an instant reads the same in UTC and by the clock of a zone", () => {
  const mjd = mjdOf(new Date("2024-11-21T03:01:20Z"));
  assert.equal(utc(mjd), "03:01:20 UTC");
  assert.equal(utc(mjd, "full"), "2024-11-21 03:01:20 UTC");
  assert.equal(local(mjd, "America/New_York"), "22:01:20 EST");
  assert.equal(local(mjdOf(new Date("2024-07-01T12:00:00Z")), "Europe/Berlin"), "14:00:00 CEST");
  assert.match(local(mjd, "Nowhere/Land"), /^\d\d:01:20 /); // this machine's zone
  assert.equal(utc(null), "no time");
  assert.equal(dateOf(40587).getTime(), 0);
});

test("an age keeps the unit that still says something", () => {
  const cases = [[-3, "0.0 s"], [0.44, "0.4 s"], [59.9, "59 s"], [119, "119 s"], [121, "2 min"], [7300, "2 h"], [200000, "2 d"], [Infinity, "unknown"]];
  for (const [seconds, text] of cases) assert.equal(age(seconds), text);
});

test("the part nearest to the page is named as silent", () => {
  const well = { lost: false, service: 0.9, coordinator: 0.9, connected: true, watched: true };
  const late = SILENCE_S + 0.01;
  assert.equal(silentPart(well), null);
  assert.equal(silentPart({ ...well, lost: true }), "service");
  assert.equal(silentPart({ ...well, service: late, connected: false }), "service");
  assert.equal(silentPart({ ...well, connected: false }), "coordinator");
  assert.equal(silentPart({ ...well, coordinator: late }), "coordinator");
  assert.equal(silentPart({ ...well, coordinator: late, watched: false }), null); // a journal
  assert.equal(silentPart({ ...well, service: 5, watched: false }), null); // that is long to read
  assert.equal(silentPart({ ...well, service: 11, watched: false }), "service");
  assert.equal(silentPart({ ...well, service: late, connected: null }), "service"); // nothing ever came
});

test("every direction of a cone's edge is the cone's angle from its axis", () => {
  for (const elevation of [-0.2, 0, 0.6, 1.4]) {
    const axis = { azimuth: 2.3, elevation };
    for (const edge of coneOf(axis, 20 * DEGREE)) near(separation(axis, edge), 20 * DEGREE, 1e-7);
  }
});

test("north is up and east is right in the plot of the sky", () => {
  const [x, y] = place({ azimuth: 0, elevation: 0 });
  near(x, 0); near(y, -1);
  near(place({ azimuth: 90 * DEGREE, elevation: 45 * DEGREE })[0], 0.5);
  near(Math.hypot(...place({ azimuth: 1, elevation: 90 * DEGREE })), 0);
});

test("a beam needs both its ends; the dish's targets stand where the epoch has them", () => {
  const facts = {
    rangers: [{ name: "ZY101", x: 0, y: 0, z: 0, kind: "ground" }, { name: "ZY113", x: 0, y: 0, z: 60, kind: "feed" }],
    targets: { name: ["ZEG1", "TR1"], x: [10, 1], y: [10, 1], z: [0, 1], body: ["ground", "dish"] },
  };
  const shots = [{ name: "ZY101", last: { target: "TR1" } }, { name: "ZY113", last: { target: "ZEG1" } }, { name: "ZY102", last: null }];
  assert.deepEqual(beamsOf(shots, placesOf(facts, null)), []);
  const [beam, ...more] = beamsOf(shots, placesOf(facts, { name: ["TR1"], x: [100], y: [0], z: [100] }));
  assert.equal(more.length, 0);
  near(beam.azimuth, 90 * DEGREE);
  near(beam.elevation, 45 * DEGREE);
});

test("a word that is not known here is a warning, never normal", () => {
  assert.equal(severityOfRanger("measures"), "normal");
  assert.equal(severityOfRanger("molten"), "warning");
  assert.deepEqual(verdictOf({ word: "doubtful", why: "dew" }), { word: "doubtful", why: "dew", severity: "warning", sign: "▲" });
  assert.equal(verdictOf("failed", "no shots").why, "no shots");
  assert.equal(verdictOf("splendid").severity, "warning");
  assert.equal(verdictOf(null), null);
});
