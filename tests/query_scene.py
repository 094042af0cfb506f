"""An archive of nights of a dish whose shape and pose are known, and a site's aperture."""

import numpy as np

from archive_scene import NEW_YEAR
from catseye.gateways.archive.content import NightContent
from catseye.gateways.archive.files import create_archive, sole_writer
from catseye.gateways.archive.writer import write_night
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.optics.zernike import terms, zernike
from catseye.records.archive.reading import open_archive
from catseye.reduction.surface.shape import LitAperture

FOCAL = 60.0  # m
APERTURE = LitAperture(np.zeros(2), 50.0, FOCAL)  # on its axis: no paraboloid takes up an astigmatism there
U_PRISM = 50e-6  # m, along each axis
ASTIGMATISM = 300e-6  # m rms at the horizon, times cos E
LENGTHENING = 0.5e-3  # m of focal length per deg C from 10
NIGHTS = 12


def posture(k):
    """Azimuth, elevation (rad) and temperature (deg C) of a night."""
    return np.radians(30.0 * k), np.radians(20.0 + 5.0 * k), 2.0 + 1.5 * k


def prisms(count=220, seed=4):
    """Names and places (n, 2) m in the reflector frame, within the aperture."""
    rng = np.random.default_rng(seed)
    r, angle = 49.0 * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, 2 * np.pi, count)
    return [f"DP{k:04d}" for k in range(count)], APERTURE.centre + np.column_stack(
        [r * np.cos(angle), r * np.sin(angle)]
    )


def shape(places, elevation, temperature):
    """Points (n, 3) m of the dish in the reflector frame, its half-path errors an astigmatism."""
    focal = FOCAL + LENGTHENING * (temperature - 10.0)
    unit = APERTURE.unit(places)
    error = ASTIGMATISM * np.cos(elevation) * zernike(terms(6, "noll"), unit[:, 0], unit[:, 1])[:, 5]
    r2 = np.sum(places**2, axis=1)
    return np.column_stack([places, r2 / (4.0 * focal) + error * (1.0 + r2 / (2.0 * focal) ** 2)])


def dish_archive(directory, *, nights=NIGHTS, without_pose=(), bad=None, noise=1.0):
    """Archive of a dish's nights; `bad` is a night -> (verdict, why), `noise` times what is claimed."""
    create_archive(directory)
    names, places = prisms()
    with sole_writer(directory):
        for k in range(nights):
            azimuth, elevation, temperature = posture(k)
            rng = np.random.default_rng((7, k))
            frame = ground_from_reflector(azimuth, elevation)
            local = shape(places, elevation, temperature) + noise * U_PRISM * rng.standard_normal((len(names), 3))
            x = frame.points(local)
            common = {
                "night": f"dish-{k:02d}-0000000{k:x}", "mjd": NEW_YEAR + 30.0 * k, "azimuth": azimuth,
                "elevation": elevation, "temperature_c": temperature,
            }  # fmt: skip
            word, why = (bad or {}).get(k, ("good", "all fits"))
            tables = {
                "nights": _rows({**common, "name": "dish", "source": "campaign", "points": len(names), "shots": 700,
                                 "verdict": word, "why": why, "variance_factor": 1.0, "version": "0.2.0"}, 1),
                "points": _rows({**common, "point": names, "body": "dish prism", "shots": 4,
                                 **{axis: x[:, i] for i, axis in enumerate("xyz")},
                                 **{pair: U_PRISM**2 if pair[0] == pair[1] else 0.0
                                    for pair in ("xx", "xy", "xz", "yy", "yz", "zz")}}, len(names)),
            }  # fmt: skip
            if k not in without_pose:
                motion = {f"{part}_{axis}": 1e-3 * k for part in ("translation", "rotation") for axis in "xyz"}
                pivot = {f"pivot_{axis}": frame.translation[i] for i, axis in enumerate("xyz")}
                products = {f"c{i}{j}": 1e-8 * (i == j) for i in range(1, 7) for j in range(i, 7)}
                tables["poses"] = _rows({**common, "body": "dish", "frame": "ground", **motion, **pivot, **products}, 1)
            write_night(
                directory,
                NightContent(
                    night=common["night"],
                    first=common["mjd"],
                    last=common["mjd"],
                    source="campaign",
                    inputs_sha256=f"{k:064x}",
                    provenance={},
                    tables=tables,
                ),
            )
    return open_archive(directory)


def _rows(columns, count):
    return {name: np.broadcast_to(np.asarray(value), (count,)) for name, value in columns.items()}
