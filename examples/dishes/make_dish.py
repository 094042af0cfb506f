"""Writes the examples of a 25 m dish: targets of its surface, and of its receiver before and after a move.

    python examples/dishes/make_dish.py

Geometry alone, without a formula of catseye: points on an exact paraboloid, raised along their normals, turned, moved,
with noise. The truth is in the constants below and in README.md.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
FOCAL_LENGTH, DIAMETER = 9.002, 25.0  # m; 9.000 m by design
VERTEX = np.array([0.002, -0.003, 0.005])  # m, of the best paraboloid in the frame of the targets
TILT = np.array([60.0, -40.0, 0.0]) / 206_264.806  # rad, of its axis about x and y
TARGETS, HOLE = 160, 1.5  # of the surface, and the radius in m of the hole in its middle
ASTIGMATISM, TREFOIL = 0.25e-3, 0.10e-3  # m, rms over the aperture of the half-path error: Noll 6 and 10
U_SURFACE = np.array([0.04, 0.04, 0.06]) * 1e-3  # m, of each coordinate

MOVE = np.array([1.2, -0.8, 2.0]) * 1e-3  # m, of the receiver at its pivot
TURN = np.array([20.0, -35.0, 10.0]) / 206_264.806  # rad, about x, y, z
PIVOT = np.array([0.0, 0.0, 9.0])  # m
KNOCKED, KNOCK = "R07", np.array([0.5, 0.6, -0.4]) * 1e-3  # m: a target that was touched between the epochs
LOST = "R12"  # not seen later
U_RECEIVER = 0.05e-3  # m


def turned(vector, points):
    """Points turned by a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    k = vector / angle
    across, along = np.cross(k, points), np.outer(points @ k, k)
    return points * np.cos(angle) + across * np.sin(angle) + along * (1.0 - np.cos(angle))


def surface(rng):
    """Targets (n, 3) m of the dish, as measured."""
    radius = DIAMETER / 2.0
    number = np.arange(TARGETS)
    inner = (HOLE / radius) ** 2
    rho = np.sqrt(inner + (0.97 - inner) * (number + 0.5) / TARGETS)
    theta = number * np.pi * (3.0 - np.sqrt(5.0))
    x, y = radius * rho * np.cos(theta), radius * rho * np.sin(theta)
    half_path = ASTIGMATISM * np.sqrt(6.0) * rho**2 * np.cos(2.0 * theta)
    half_path += TREFOIL * np.sqrt(8.0) * rho**3 * np.cos(3.0 * theta)
    normal = np.column_stack([-x, -y, np.full(TARGETS, 2.0 * FOCAL_LENGTH)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    raised = half_path / normal[:, 2]  # half of the path's change is the deviation times the cosine
    points = np.column_stack([x, y, (x**2 + y**2) / (4.0 * FOCAL_LENGTH)]) + raised[:, None] * normal
    return turned(TILT, points) + VERTEX + U_SURFACE * rng.normal(size=(TARGETS, 3))


def receiver(rng):
    """Targets of the receiver by name, (3,) m: first and later."""
    first, later = {}, {}
    for number in range(12):
        angle, height = np.pi * (number / 3.0 + (number >= 6) / 6.0), 8.4 if number < 6 else 9.6
        first[f"R{number + 1:02d}"] = np.array([0.9 * np.cos(angle), 0.9 * np.sin(angle), height])
    for name, place in first.items():
        moved = PIVOT + MOVE + turned(TURN, (place - PIVOT)[None])[0]
        later[name] = moved + (KNOCK if name == KNOCKED else 0.0)
    del later[LOST]
    measured = [{n: p + U_RECEIVER * rng.normal(size=3) for n, p in epoch.items()} for epoch in (first, later)]
    return measured[0], measured[1]


def write(name, header, rows):
    """Write a CSV of rows of text and numbers in mm."""
    lines = [header, *(",".join(c if isinstance(c, str) else f"{c:.4f}" for c in row) for row in rows)]
    (HERE / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    """Write all tables."""
    rng = np.random.default_rng(7)
    points = surface(rng) * 1e3
    spread = U_SURFACE * 1e3
    rows = [(f"T{k + 1:03d}", *point, *spread) for k, point in enumerate(points)]
    write("surface.csv", "point,x_mm,y_mm,z_mm,u_x_mm,u_y_mm,u_z_mm", rows)
    for name, epoch in zip(("receiver.csv", "receiver-later.csv"), receiver(rng), strict=True):
        write(name, "point,x_mm,y_mm,z_mm,u_mm", [(n, *(1e3 * p), 1e3 * U_RECEIVER) for n, p in epoch.items()])


if __name__ == "__main__":
    main()
