"""Writes the examples of scans: azimuth, elevation, raster; returns by angle; targets of a search; moves of a servo.

    python examples/scans/make_examples.py

A twin made them (catseye.simulator), with the seeds and truths below.
"""

from pathlib import Path

import numpy as np

from catseye.simulator.laboratory.spots import SpotLight, TrueCorner, scan_amplitudes

HERE = Path(__file__).parent
ZEROS = np.array([2691.0, 1434.0])  # of ZP103
TRUE = np.array([20_000.3, 9_000.4])  # counts of the retroreflector
DISTANCE = 120.0  # m
GAIN, INCIDENCE_ZERO, ROTATION_ZERO = 4.0, 0.8, 17.0  # V, degrees: of the bare prism on the stage
FIELD = 30.0  # degrees, of the light's polarization from the plane of incidence

TARGETS = ["T0,-23.2859,10.6550,16.9868", "T1,24.9061,58.3191,79.7327", "T2,38.1948,-12.9398,39.4787"]


def main() -> None:
    rng = np.random.default_rng(46)
    light = SpotLight()
    steps, up = np.arange(-16.0, 17.0), np.arange(-9.0, 10.0)
    centre = np.rint(TRUE)
    across, along = (g.ravel() for g in np.meshgrid(np.arange(-10.0, 11.0), np.arange(-5.0, 6.0)))
    for name, offsets in (
        ("azimuth", np.column_stack([steps, np.zeros(len(steps))])),
        ("elevation", np.column_stack([np.zeros(len(up)), up])),
        ("raster", np.column_stack([across, along])),
    ):
        counts = centre + offsets
        volts = scan_amplitudes(counts, TRUE, ZEROS, distance=DISTANCE, light=light, rng=rng)
        rows = [f"{na:.0f},{ne:.0f},{v:.4f}" for (na, ne), v in zip(counts, volts, strict=True)]
        write(f"{name}.csv", "azimuth_counts,elevation_counts,amplitude_volt", rows)
    incidences, turns = np.arange(-45.0, 45.1, 3.0), np.arange(0.0, 356.0, 6.0)
    by_angle("incidence", incidences, np.full(len(incidences), 20.0), rng)
    by_angle("rotation", np.full(len(turns), 30.0), turns, rng)
    through_analyser(np.random.default_rng(47))
    write("targets.csv", "target,x_m,y_m,z_m", TARGETS)


def by_angle(name: str, incidence: np.ndarray, rotation: np.ndarray, rng: np.random.Generator) -> None:
    """Returns of a bare prism of BK 7 at angles of the stage, degrees."""
    prism, light, rows = TrueCorner(), SpotLight(), []
    normal = prism.share(0.0, 0.0)
    for i, turn in zip(incidence, rotation, strict=True):
        off, azimuth = np.radians(i - INCIDENCE_ZERO), np.radians(turn - ROTATION_ZERO)
        share = prism.share(abs(off), azimuth + (np.pi if off < 0.0 else 0.0)) / normal
        volts = abs(GAIN * share * np.exp(rng.normal(0.0, 0.02)) + light.noise_volt * complex(*rng.normal(size=2)))
        rows.append(f"{i:.1f},{turn:.1f},{volts:.4f}")
    write(f"{name}.csv", "incidence_deg,rotation_deg,amplitude_volt", rows)


def through_analyser(rng: np.random.Generator) -> None:
    """Returns of the same prism in light polarized at FIELD, parallel and crossed: turned at 15 degrees, and tilted."""
    prism, light, rows = TrueCorner(), SpotLight(), []
    normal, field = prism.share(0.0, 0.0), np.radians(FIELD)
    stage = [(15.0, turn) for turn in np.arange(0.0, 121.0, 8.0)] + [(i, 20.0) for i in np.arange(-30.0, 31.0, 5.0)]
    for analyser in (0.0, 90.0):
        for i, turn in stage:
            off, azimuth = np.radians(i - INCIDENCE_ZERO), np.radians(turn - ROTATION_ZERO)
            azimuth += np.pi if off < 0.0 else 0.0
            share = prism.polarized(abs(off), azimuth, field=field, analyser=np.radians(analyser)) / normal
            volts = abs(GAIN * share * np.exp(rng.normal(0.0, 0.02)) + light.noise_volt * complex(*rng.normal(size=2)))
            rows.append(f"{i:.1f},{turn:.1f},{analyser:.0f},{volts:.4f}")
    write("analyser.csv", "incidence_deg,rotation_deg,analyser_deg,amplitude_volt", rows)


def write(name: str, header: str, rows: list[str]) -> None:
    """Write one table."""
    (HERE / name).write_text("\n".join([header, *rows]) + "\n", "utf-8")


if __name__ == "__main__":
    main()
