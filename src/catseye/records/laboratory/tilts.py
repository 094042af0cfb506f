"""Inclinometer readings on the alidade, a CSV: `mjd,azimuth_deg,tilt_x_arcsec,tilt_y_arcsec,u_arcsec`."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD

COLUMNS = ("mjd", "azimuth_deg", "tilt_x_arcsec", "tilt_y_arcsec", "u_arcsec")
LARGEST = 7200.0  # arcsec: two degrees; larger tilts indicate a loose instrument


@dataclass(frozen=True, eq=False)
class TiltReadings:
    """Readings in file order.

    mjd       (n,) UTC
    azimuth   (n,) rad, of the telescope, clockwise from north
    tilt      (n, 2) rad, rotations about the alidade's x and y axes, right-hand rule, including the instrument's zero
    u         (n,) rad, standard uncertainty of each
    digest    SHA-256 of the file
    """

    mjd: np.ndarray
    azimuth: np.ndarray
    tilt: np.ndarray
    u: np.ndarray
    digest: str

    def __len__(self) -> int:
        return len(self.mjd)


def read_tilts(path: Path | str) -> TiltReadings:
    """Inclinometer readings of a table; InputError names file, line, value."""
    path = Path(path)
    table = columns_of(Folder(path.parent).text(path.name), path.name, COLUMNS)
    mjd, azimuth, x, y, u = (table.numbers(name) for name in COLUMNS)
    table.check("mjd", (mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD), f"{EARLIEST_MJD:g} to {LATEST_MJD:g}, UTC")
    table.check("azimuth_deg", np.abs(azimuth) <= 540.0, "-540 to 540 degrees")
    for name, values in (("tilt_x_arcsec", x), ("tilt_y_arcsec", y)):
        table.check(name, np.abs(values) <= LARGEST, f"-{LARGEST:g} to {LARGEST:g} arcsec")
    table.check("u_arcsec", (u > 0.0) & (u <= LARGEST), f"above 0 to {LARGEST:g} arcsec")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return TiltReadings(mjd, azimuth * DEGREE, np.column_stack([x, y]) * ARCSECOND, u * ARCSECOND, digest)
