"""Writes reflector.pch, elevations.csv and nodes.csv: a truss of bars under gravity, solved by its stiffness matrix.

    python examples/finite-elements/make_truss.py

The truss stands for a finite element model of the tipping structure of examples/structural-model/telescope.toml: nodes
near its targets on rim and feed arm, a second layer behind them, and bearings that hold it. Nothing of it was
measured or designed. Its axes are its own: x is the dish's y, y the dish's -x; the origin lies on the elevation axis.
"""

import csv
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
ORIGIN = np.array([0.0, 54.839108, -4.99999])  # of the truss's axes, in the dish's, m
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # from the truss's axes to the dish's
RIM = {f"TR{k + 1:02d}": 2.0 * np.pi * (k + 0.5) / 10.0 for k in range(10)}
ARM = {
    "ZEG41040L": (-2.67, -4.24, 57.3),
    "ZEG20440L": (-3.17, -9.47, 11.85),
    "ZEG41040R": (2.67, -4.24, 57.3),
    "ZEG20440R": (3.17, -9.47, 11.85),
}
BEARINGS = ((-22.0, 54.839, -5.0), (22.0, 54.839, -5.0), (0.0, 30.0, -30.0))  # the last on the wheel, which turns it
STIFFNESS, WEIGHT, LONGEST = 1e10, 2.5e5, 80.0  # N, of a bar's strain; N, of a node; m, of a bar
ELEVATIONS = (5, 25, 45, 65, 85)


def nodes() -> tuple[np.ndarray, list[str], int]:
    """Places (n, 3) m in the dish's axes, the target near each, and the number of free nodes before the bearings."""
    rng, places, targets = np.random.default_rng(4), [], []
    for name, angle in RIM.items():
        x, y = 50.35 * np.sin(angle), 54.0 + 50.35 * np.cos(angle)
        places.append([x, y, (x * x + y * y) / 240.0 + 0.25])
        targets.append(name)
    places += [list(place) for place in ARM.values()]
    targets += list(ARM)
    near = np.array(places) + 0.05 * rng.standard_normal((len(places), 3))
    behind = near - [0.0, 0.0, 14.0]
    return np.vstack([near, behind, BEARINGS]), [*targets, *[""] * (len(behind) + len(BEARINGS))], 2 * len(near)


def stiffness(places: np.ndarray) -> np.ndarray:
    """Stiffness matrix (3n, 3n), N/m, of bars between all nodes that are near enough."""
    matrix = np.zeros((3 * len(places), 3 * len(places)))
    for i in range(len(places)):
        for j in range(i):
            along = places[i] - places[j]
            length = np.linalg.norm(along)
            if length < LONGEST:
                block = STIFFNESS / length**3 * np.outer(along, along)
                for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                    matrix[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += sign * block
    return matrix


def solved(direction: np.ndarray) -> np.ndarray:
    """Displacements (n, 3) m in the dish's axes with gravity along a direction (3,)."""
    places, _, free = nodes()
    loads = np.tile(WEIGHT * direction, free)
    moved = np.zeros((len(places), 3))
    moved[:free] = np.linalg.solve(stiffness(places)[: 3 * free, : 3 * free], loads).reshape(-1, 3)
    return moved


def gravity(elevation_deg: float) -> np.ndarray:
    """Direction of gravity in the dish's axes."""
    e = np.radians(elevation_deg)
    return np.array([0.0, np.cos(e), -np.sin(e)])


def main() -> None:
    places, *_ = nodes()
    numbers = 1001 + np.arange(len(places))
    own = (places - ORIGIN) @ TURN
    with (HERE / "nodes.csv").open("w", encoding="utf-8", newline="") as stream:
        rows = [(n, *(f"{v:.4f}" for v in place)) for n, place in zip(numbers, own, strict=True)]
        csv.writer(stream, lineterminator="\n").writerows([("node", "x_m", "y_m", "z_m"), *rows])
    lines, card = [], 0
    for case, (name, direction) in enumerate((("ALONG DISH Y", gravity(0.0)), ("ALONG DISH -Z", gravity(90.0))), 1):
        heads = ("$TITLE   = TIPPING STRUCTURE", f"$SUBTITLE= 1 G {name}", "$LABEL   =", "$DISPLACEMENTS")
        heads += ("$REAL OUTPUT", f"$SUBCASE ID = {case:11d}")
        for head in heads:
            card += 1
            lines.append(f"{head:<72}{card:8d}")
        for n, value in zip(numbers, 1e3 * solved(direction) @ TURN, strict=True):
            lines.append(f"{n:10d}{'G':>8}" + "".join(f"{v:18.6E}" for v in value) + f"{card + 1:8d}")
            lines.append(f"{'-CONT-':<18}" + 3 * f"{0.0:18.6E}" + f"{card + 2:8d}")
            card += 2
    (HERE / "reflector.pch").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with (HERE / "elevations.csv").open("w", encoding="utf-8", newline="") as stream:
        write = csv.writer(stream, lineterminator="\n").writerow
        write(("elevation_deg", "node", "dx_mm", "dy_mm", "dz_mm"))
        for e in ELEVATIONS:
            for n, value in zip(numbers, 1e3 * solved(gravity(e)) @ TURN, strict=True):
                write((e, n, *(f"{v:.5f}" for v in value)))


if __name__ == "__main__":
    main()
