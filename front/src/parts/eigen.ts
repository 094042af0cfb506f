// Symmetric 3 x 3 eigenproblem by Jacobi rotations. Source: Golub and Van Loan, Matrix Computations, section 8.5.
import { abs, hypot } from "./maths";

/** Eigenvalues and the unit eigenvectors that belong to them, each a row, right-handed; of the matrix xx xy xz yy yz zz. */
export function eigen([xx, xy, xz, yy, yz, zz]: number[]): { values: number[]; vectors: number[][] } {
  const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] as number[][];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let turn = 0; turn < 90; turn++) {
    const [p, q] = ([[0, 1], [0, 2], [1, 2]] as const)[turn % 3]!;
    const off = a[p]![q]!;
    if (abs(off) <= 1e-18 * (abs(a[p]![p]!) + abs(a[q]![q]!))) continue;
    const theta = (a[q]![q]! - a[p]![p]!) / (2 * off);
    const t = (theta < 0 ? -1 : 1) / (abs(theta) + hypot(theta, 1));
    const c = 1 / hypot(t, 1);
    const rotate = (m: number[][], i: number, j: number, k: number, l: number) => {
      const [x, y] = [m[i]![j]!, m[k]![l]!];
      m[i]![j] = c * (x - t * y);
      m[k]![l] = c * (t * x + y);
    };
    for (let k = 0; k < 3; k++) rotate(a, k, p, k, q);
    for (let k = 0; k < 3; k++) rotate(a, p, k, q, k), rotate(v, p, k, q, k);
  }
  return { values: a.map((row, k) => row[k]!), vectors: v };
}
