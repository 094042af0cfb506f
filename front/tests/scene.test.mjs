import assert from "node:assert/strict";
import { test } from "node:test";
import { fitted, matrixOf, picked, projected } from "../src/parts/camera.ts";
import { eigen } from "../src/parts/eigen.ts";
import { ellipsoids, enlargement, RADIUS } from "../src/parts/ellipsoids.ts";
import { icosphere } from "../src/parts/gl.ts";

const near = (a, b, tolerance, why) => assert.ok(Math.abs(a - b) <= tolerance, `${why ?? ""} ${a} is not ${b}`);

// Numbers that look random and are the same each time.
function numbers(seed) {
  let state = seed;
  return () => ((state = (state * 1103515245 + 12345) % 2147483648) / 2147483648) * 2 - 1;
}

test("eigenvalues and eigenvectors give the matrix again, orthonormal and right-handed", () => {
  const next = numbers(7);
  for (let trial = 0; trial < 500; trial++) {
    const scale = 10 ** (next() * 8);
    const m = Array.from({ length: 6 }, () => next() * scale * 10 ** (trial % 3 ? 0 : next() * 4));
    const { values, vectors } = eigen(m);
    const size = Math.max(...m.map(Math.abs));
    const again = (i, j) => values.reduce((sum, value, k) => sum + value * vectors[k][i] * vectors[k][j], 0);
    [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].forEach(([i, j], k) => near(again(i, j), m[k], 1e-14 * size, `trial ${trial}:`));
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) near(vectors[i].reduce((s, v, k) => s + v * vectors[j][k], 0), i === j ? 1 : 0, 1e-14);
    const [u, v, w] = vectors;
    near(u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]), 1, 1e-14);
  }
});

test("eigenvalues of special matrices", () => {
  assert.deepEqual(eigen([0, 0, 0, 0, 0, 0]).values, [0, 0, 0]);
  assert.deepEqual(eigen([3, 0, 0, 2, 0, 1]).values, [3, 2, 1]);
  const ones = eigen([1, 1, 1, 1, 1, 1]).values.toSorted((a, b) => a - b);
  [0, 0, 3].forEach((value, k) => near(ones[k], value, 1e-15));
  const covariance = eigen([1e-8, 0, 9.999e-9, 1e-20, 0, 1e-8]).values.toSorted((a, b) => a - b);
  [1e-20, 1e-12, 1.9999e-8].forEach((value, k) => near(covariance[k], value, 1e-23 + 1e-9 * value));
});

test("the radius is the root of the 95 % quantile of chi-square with 3 degrees of freedom", () => {
  // Distribution function of chi-square with 3 degrees of freedom, integrated by Simpson's rule over r = sqrt(x).
  const density = (r) => Math.sqrt(2 / Math.PI) * r * r * Math.exp((-r * r) / 2);
  const n = 2000;
  let sum = density(0) + density(RADIUS);
  for (let i = 1; i < n; i++) sum += density((RADIUS * i) / n) * (i % 2 ? 4 : 2);
  near((sum * RADIUS) / n / 3, 0.95, 1e-5);
});

test("the enlargement is 1, 2 or 5 times a power of ten, and not more than asked for", () => {
  assert.equal(enlargement(1e-4, 100, 1), 10000);
  assert.equal(enlargement(1e-4, 100, 130), 10000);
  assert.equal(enlargement(1e-4, 100, 2340), 5000);
  assert.equal(enlargement(3, 100, 1), 0.2);
  assert.equal(enlargement(0, 100, 1), 1);
});

const points = (variances) => ({
  name: variances.map((_, i) => `P${i}`), x: variances.map(() => 0), y: variances.map(() => 0), z: variances.map(() => 0), group: variances.map(() => 0),
  covariance: { xx: variances.map((v) => v && v[0]), xy: variances.map((v) => v && 0), xz: variances.map((v) => v && 0), yy: variances.map((v) => v && v[1]), yz: variances.map((v) => v && 0), zz: variances.map((v) => v && v[2]) },
});

test("ellipsoids are to scale, those too large are capped, unknown ones have none", () => {
  const usual = [1e-8, 4e-8, 9e-8];
  const shape = ellipsoids(points([usual, usual, usual, [1e-2, 1e-2, 1e-2], null, [0, 0, 0]]), 100);
  const half = (i, k) => Math.hypot(...shape.matrices.subarray(9 * i + 3 * k, 9 * i + 3 * k + 3));
  [1e-4, 2e-4, 3e-4].forEach((sigma, k) => near(half(0, k), sigma * RADIUS * shape.factor, 1e-6 * half(0, k)));
  assert.deepEqual([...shape.capped], [0, 0, 0, 1, 0, 0]);
  near(half(3, 0), 8 * 3e-4 * RADIUS * shape.factor, 1e-6 * half(3, 0));
  near(shape.axes[3], 0.1 * RADIUS, 1e-12);
  assert.ok(Number.isNaN(shape.axes[4]) && half(4, 0) === 0);
  assert.ok(half(5, 0) > 0, "a point without uncertainty has a small ellipsoid");
});

test("the sphere has 20 or 80 triangles that look outwards", () => {
  for (const [divided, count] of [[false, 20], [true, 80]]) {
    const { vertices, faces } = icosphere(divided);
    assert.equal(faces.length, 3 * count);
    assert.equal(vertices.length / 3, count / 2 + 2); // Euler
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => vertices.slice(3 * faces[f + k], 3 * faces[f + k] + 3));
      near(Math.hypot(...a), 1, 1e-12);
      const [u, v] = [b, c].map((p) => p.map((x, k) => x - a[k]));
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      assert.ok(normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2] > 0);
    }
  }
});

test("a fitted camera sees every point, and most of the picture is used", () => {
  const next = numbers(3);
  for (let trial = 0; trial < 50; trial++) {
    const positions = Float32Array.from({ length: 300 }, (_, k) => next() * [60, 60, 20][k % 3]);
    const [width, height] = trial % 2 ? [1000, 600] : [360, 500];
    const camera = fitted(positions, next() * 3, next() * 1.5, width / height);
    const screen = projected(matrixOf(camera, width / height, 200), positions, width, height);
    let used = 0;
    for (let i = 0; i < 100; i++) {
      assert.ok(screen[4 * i] >= 0 && screen[4 * i] <= width && screen[4 * i + 1] >= 0 && screen[4 * i + 1] <= height && screen[4 * i + 2] > 0);
      used = Math.max(used, Math.abs(screen[4 * i] / width - 0.5), Math.abs(screen[4 * i + 1] / height - 0.5));
    }
    assert.ok(used > 0.3);
  }
});

test("directions: from the front x points right and z up, from above y points up", () => {
  const positions = new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1]);
  const look = (yaw, pitch) => projected(matrixOf({ yaw, pitch, distance: 10, target: [0, 0, 0] }, 1, 2), positions, 100, 100);
  const front = look(0, 0);
  assert.ok(front[0] > 50 && Math.abs(front[1] - 50) < 1e-3 && front[9] < 50);
  assert.ok(front[6] > front[2], "y points away");
  const top = look(0, Math.PI / 2);
  assert.ok(top[0] > 50 && top[5] < 50 && top[10] < top[2]);
});

test("the foremost ellipsoid is picked, not one hidden behind it, and nothing out of reach", () => {
  const all = () => true;
  // x, y, depth, pixels per metre
  const screen = new Float32Array([50, 50, 20, 10, 52, 50, 10, 10, 80, 50, 10, 10]);
  const size = new Float32Array([1, 1, 0.1]);
  assert.equal(picked(screen, size, 50, 50, 12, all), 1, "behind the foremost");
  assert.equal(picked(screen, size, 50, 50, 12, (i) => i !== 1), 0);
  assert.equal(picked(screen, size, 86, 50, 12, all), 2);
  assert.equal(picked(screen, size, 150, 50, 12, all), -1);
  assert.equal(picked(new Float32Array([50, 50, -1, 1]), new Float32Array([1]), 50, 50, 12, all), -1, "behind the eye");
});
