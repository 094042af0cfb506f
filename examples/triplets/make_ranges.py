"""Makes prism-ranges.csv and prism-ranges-truth.csv: feed-arm rangers to triplet prisms and to each other, known truth.

python examples/triplets/make_ranges.py

Scan points, units and plates are drawn about the records of night-01 by their standard uncertainties, in the reflector
frame. A ray into a prism is bent with the phase index and delayed with the group index, by bisection on Snell's law:
nothing of the reduction's formulas is used.
"""

import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
NIGHT = HERE.parent / "night-01"
SEED = 46
U_RANGE, U_PER_METRE, U_ZERO, U_PLACE = 15e-6, 0.2e-6, 30e-6, 8e-3  # m, m/m
PHASE = 1.511186 / 1.527463  # of BK 7's phase index over its group index


def path_to_corner(scan: np.ndarray, corner: np.ndarray, normal: np.ndarray, height: float, n: float) -> float:
    """Group path over the air's index, m: the ray through the face that obeys Snell's law."""
    out = float((scan - corner) @ normal) - height
    aside = float(np.linalg.norm(scan - corner - (out + height) * normal))
    low, high = 0.0, aside
    for _ in range(80):
        crossing = 0.5 * (low + high)
        in_air = (aside - crossing) / np.hypot(aside - crossing, out)
        in_glass = crossing / np.hypot(crossing, height)
        low, high = (crossing, high) if in_air > n * PHASE * in_glass else (low, crossing)
    return float(np.hypot(aside - crossing, out) + n * np.hypot(crossing, height))


def main() -> None:
    rng = np.random.default_rng(SEED)
    n = tomllib.loads((NIGHT / "site.toml").read_text())["ranging"]["bk7_to_air_group_index_ratio"]
    arm = tomllib.loads((NIGHT / "feedarm.toml").read_text())["ranger"]
    scan = {r["name"]: np.array(r["nominal_scan_point_mm"]) * 1e-3 + U_PLACE * rng.normal(size=3) for r in arm}
    zero = {name: U_ZERO * rng.normal() for name in scan}
    truth = dict(scan)
    ranges = [(a, b, float(np.linalg.norm(scan[a] - scan[b]))) for a in scan for b in scan if a < b]
    for file in sorted((NIGHT / "triplets").glob("*.toml")):
        t = tomllib.loads(file.read_text())
        axis, normal = (np.array(t[key]) / np.linalg.norm(t[key]) for key in ("axis", "normal"))
        across = np.cross(normal, axis)
        normal = normal + np.radians(0.3) * (rng.normal() * axis + rng.normal() * across)
        normal /= np.linalg.norm(normal)
        axis -= (axis @ normal) * normal
        axis /= np.linalg.norm(axis)
        across = np.cross(normal, axis)
        ball = np.array(t["nominal_position_mm"]) * 1e-3 + U_PLACE * rng.normal(size=3)
        aside = t["u_lateral_mm"] * 1e-3 * (rng.normal() * axis + rng.normal() * across)
        height = (t["h_corr_mm"] + t["u_h_corr_mm"] * rng.normal()) * 1e-3
        spacing = (t["d12_mm"] + t["u_d12_mm"] * rng.normal()) * 1e-3
        middle = ball - aside - height * normal
        truth[t["ball"]["target"]] = ball
        for side, sign in (("left_prism", -0.5), ("right_prism", 0.5)):
            glass = t[side]["height_mm"] * 1e-3
            point = middle + sign * spacing * axis
            truth[t[side]["target"]] = point
            corner = point - (glass - glass / n) * normal
            for name, at in scan.items():
                path = path_to_corner(at, corner, normal, glass, n) + t[side]["pc_mm"] * 1e-3
                ranges.append((name, t[side]["target"], path))
    with (HERE / "prism-ranges.csv").open("w") as table:
        table.write("ranger,target,range_m,u_range_mm\n")
        for ranger, target, d in ranges:
            u = np.hypot(U_RANGE, U_PER_METRE * d)
            table.write(f"{ranger},{target},{d + zero[ranger] + u * rng.normal():.7f},{1e3 * u:.5f}\n")
    with (HERE / "prism-ranges-truth.csv").open("w") as table:
        table.write("point,x_m,y_m,z_m\n")
        table.writelines(f"{name},{x:.7f},{y:.7f},{z:.7f}\n" for name, (x, y, z) in truth.items())


if __name__ == "__main__":
    main()
