"""Writes epochs.csv and a table of points for each epoch: targets of a telescope that is not quite the model's.

    python examples/structure/make_epochs.py

The truth is examples/structural-model/telescope.toml with the coefficients of CHANGED. Each epoch adds what the model
leaves in any one posture (its u), each target a place that is not quite the sheet's, each coordinate the noise of a
network. All of it is drawn by one seeded generator.
"""

import csv
from pathlib import Path

import numpy as np

from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.structural_model import StructuralModel, read_structural_model
from catseye.reduction.structure.antenna import antenna_of

HERE = Path(__file__).parent
MODEL = HERE.parent / "structural-model" / "telescope.toml"
SEED = 46
U_MM = 0.15  # of each measured coordinate
GROUPS = ("bearings", "rim", "arm")
ELEVATIONS = (10, 25, 40, 55, 70, 85, 78, 62, 47, 33, 18, 6, 30, 60, 80, 45)  # degrees
AZIMUTHS = (20, 95, 170, 250, 310, 45, 130, 215, 285, 355, 75, 150, 235, 330, 110, 190)
TEMPERATURES = (-3, 12, 7, 21, 16, 2, 24, -1, 9, 19, 14, 4, 26, 11, -5, 17)
FIRST_MJD = 53124.1
CHANGED = {  # frame, component: its coefficients in truth, in the order of the model's terms
    ("alidade", "turn_x_arcsec"): (2.9, 2.4, 0.0),
    ("alidade", "turn_y_arcsec"): (2.4, -2.9, 0.0),
    ("reflector", "turn_x_arcsec"): (-61.0, 21.0, 3.0, 0.0, 0.15),
    ("reflector", "shift_z_mm"): (0.0, -8.5, -0.6, 0.06, 0.0),
    ("feed_arm", "turn_x_arcsec"): (-138.0, -34.0, 5.0, 0.4),
    ("feed_arm", "shift_y_mm"): (6.5, 0.0, 0.3, 0.0),
}


def truth() -> StructuralModel:
    """The model with the changed coefficients."""
    document = read_structural_model(MODEL).model_dump()
    for frame in document["frame"]:
        for (name, key), values in CHANGED.items():
            if frame["name"] == name:
                frame["motion"][key] = values
    return StructuralModel.model_validate(document)


def main() -> None:
    rng, antenna = np.random.default_rng(SEED), antenna_of(truth())
    rows = [(group, name) for group in GROUPS for name in antenna.groups[group].names]
    off = {name: antenna.groups[group].u[0] * rng.standard_normal(3) for group, name in rows}
    listed = []
    for k, (azimuth, elevation, warm) in enumerate(zip(AZIMUTHS, ELEVATIONS, TEMPERATURES, strict=True)):
        posture = TelescopePosture(np.radians(azimuth), np.radians(elevation), float(warm))
        added = {name: motion.u * rng.standard_normal(6) for name, motion in antenna.motions.items()}
        lines = []
        for group in GROUPS:
            points = antenna.groups[group]
            fresh = np.sqrt(np.maximum(antenna.u_points(group) ** 2 - points.u**2, 0.0))[:, None]
            at = antenna.in_frame(group, posture) + fresh * rng.standard_normal((len(points.names), 3))
            at = at + np.array([off[name] for name in points.names])
            places = antenna.ground_from(points.frame, posture, added=added)[None].points(at)
            places = places + 1e-3 * U_MM * rng.standard_normal(places.shape)
            lines += [
                (name, *(f"{v:.6f}" for v in place), U_MM) for name, place in zip(points.names, places, strict=True)
            ]
        file = f"epoch-{k + 1:02d}.csv"
        with (HERE / file).open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows([("point", "x_m", "y_m", "z_m", "u_mm"), *lines])
        listed.append((file, azimuth, elevation, warm, round(FIRST_MJD + 0.02 * k, 4)))
    with (HERE / "epochs.csv").open("w", encoding="utf-8", newline="") as stream:
        head = ("reduction", "azimuth_deg", "elevation_deg", "temperature_c", "mjd_utc")
        csv.writer(stream, lineterminator="\n").writerows([head, *listed])


if __name__ == "__main__":
    main()
