// Camera that turns about a point: matrix of view and projection, projection of points on the CPU.
import { cos, floor, hypot, max, sin, tan } from "./maths";
export interface Camera { yaw: number; pitch: number; distance: number; target: [number, number, number] }

const SIGHT = 0.42; // rad, whole vertical angle

/** Column-major 4 x 4 matrix from the scene to clip space. z is up; yaw 0 looks along +y. */
export function matrixOf(camera: Camera, aspect: number, extent: number): Float32Array {
  const { right, up, back } = axesOf(camera);
  const f = 1 / tan(SIGHT / 2);
  const near = max(camera.distance - 2 * extent, camera.distance * 0.02);
  const far = camera.distance + 2 * extent;
  const rows = [
    [...right.map((v) => (v * f) / aspect), 0], [...up.map((v) => v * f), 0],
    [...back.map((v) => (v * (far + near)) / (near - far)), (2 * far * near) / (near - far)], [...back.map((v) => -v), 0],
  ] as number[][];
  const eye = camera.target.map((v, i) => v + back[i]! * camera.distance);
  return Float32Array.from({ length: 16 }, (_, i) => {
    const row = rows[i % 4]!;
    const column = floor(i / 4);
    return column < 3 ? row[column]! : row[3]! - (row[0]! * eye[0]! + row[1]! * eye[1]! + row[2]! * eye[2]!);
  });
}

export function axesOf({ yaw, pitch }: Camera): { right: number[]; up: number[]; back: number[] } {
  const [cy, sy, cp, sp] = [cos(yaw), sin(yaw), cos(pitch), sin(pitch)];
  return { right: [cy, sy, 0], up: [-sy * sp, cy * sp, cp], back: [sy * cp, -cy * cp, sp] };
}

/** Pixel, depth and pixels per metre of each point, four numbers a point; depth 0 or less is behind the eye. */
export function projected(m: Float32Array, positions: Float32Array, width: number, height: number): Float32Array {
  const n = positions.length / 3;
  const out = new Float32Array(4 * n);
  const grow = (hypot(m[1]!, m[5]!, m[9]!) * height) / 2;
  for (let i = 0; i < n; i++) {
    const [x, y, z] = [positions[3 * i]!, positions[3 * i + 1]!, positions[3 * i + 2]!];
    const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
    out[4 * i] = (((m[0]! * x + m[4]! * y + m[8]! * z + m[12]!) / w + 1) * width) / 2;
    out[4 * i + 1] = ((1 - (m[1]! * x + m[5]! * y + m[9]! * z + m[13]!) / w) * height) / 2;
    out[4 * i + 2] = w;
    out[4 * i + 3] = grow / w;
  }
  return out;
}

/** Point under a pixel: the foremost ellipsoid that covers it, or else the nearest within reach; -1 for none. */
export function picked(screen: Float32Array, size: Float32Array, x: number, y: number, reach: number, visible: (i: number) => boolean): number {
  let best = -1;
  let least = Infinity;
  for (let i = 0; i < screen.length / 4; i++) {
    const depth = screen[4 * i + 2]!;
    if (!(depth > 0)) continue;
    const away = max(0, hypot(screen[4 * i]! - x, screen[4 * i + 1]! - y) - max(size[i]! * screen[4 * i + 3]!, 2));
    if (away > reach || !visible(i)) continue;
    const rank = away > 0 ? 1e6 * (1 + away) : depth / (depth + 1);
    if (rank < least) (least = rank), (best = i);
  }
  return best;
}

/** Camera that just sees all points, from a direction; positions x, y, z, unknown ones NaN. */
export function fitted(positions: ArrayLike<number>, yaw: number, pitch: number, aspect: number): Camera {
  const camera: Camera = { yaw, pitch, target: [0, 0, 0], distance: 1 };
  const { right, up, back } = axesOf(camera);
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]] as [number[], number[]];
  for (let i = 0; i < positions.length; i += 3) {
    [right, up, back].forEach((axis, k) => {
      const v = axis[0]! * positions[i]! + axis[1]! * positions[i + 1]! + axis[2]! * positions[i + 2]!;
      if (v < low[k]!) low[k] = v;
      if (v > high[k]!) high[k] = v;
    });
  }
  const half = low.map((v, k) => (high[k]! > v ? (high[k]! - v) / 2 : 0));
  const middle = low.map((v, k) => (v <= high[k]! ? (v + high[k]!) / 2 : 0));
  camera.target = [0, 1, 2].map((k) => right[k]! * middle[0]! + up[k]! * middle[1]! + back[k]! * middle[2]!) as Camera["target"];
  camera.distance = (max(half[1]!, half[0]! / aspect, 1e-6) * 1.22) / tan(SIGHT / 2) + half[2]!;
  return camera;
}
