"""`acoustic_field`: temperature and wind among loudspeakers and microphones, from many travel times."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.constants import PPM
from catseye.names import AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.array_air import ArrayAir


@dataclass(frozen=True, eq=False, repr=False)
class AcousticFieldResult(Result):
    """Air among an array's stations: g points of a level map, t chosen lines.

    points                                  (g, 3) m, x fastest
    temperature_c, u_temperature_c          (g,)
    covariance_c2                           (g, g) of the temperatures
    wind, u_wind                            (g, 3) m/s; nan where none is estimated
    line_names                              (t) of the chosen lines
    line_temperature_c, u_line_temperature_c   (t,) mean along each
    line_refractivity, u_line_refractivity     (t,) n_g - 1
    chi_square                              of the used times
    standardised                            (m,) each time against all others; nan where not used
    air                                     everything else: statuses, residuals, the tomogram
    read                                    files that were read
    """

    points: np.ndarray
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    covariance_c2: np.ndarray
    wind: np.ndarray
    u_wind: np.ndarray
    line_names: tuple[str, ...]
    line_temperature_c: np.ndarray
    u_line_temperature_c: np.ndarray
    line_refractivity: np.ndarray
    u_line_refractivity: np.ndarray
    chi_square: float
    standardised: np.ndarray
    air: "ArrayAir"
    read: tuple[Path, ...]

    def passages(self) -> "Sequence[Passage]":
        """Times, fit, lines, map, wind, suspects."""
        from catseye.gateways.air.array_objects import array_passages

        return array_passages(self.air)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye acoustic-field --json`."""
        from catseye.gateways.air.array_objects import array_object

        return array_object(self.air)

    def tables(self) -> "dict[str, QTable]":
        """`lines`: a row a chosen line; `map`: a row a point; `times`: a row a time."""
        array = self.air.array
        lines = {
            "line": (self.line_names, ""),
            "temperature": (self.line_temperature_c, "deg_C"),
            "u_temperature": (self.u_line_temperature_c, "K"),
            "group_refractivity": (self.line_refractivity / PPM, ""),
            "u_group_refractivity": (self.u_line_refractivity / PPM, ""),
        }
        points = {
            **{axis: (self.points[:, k], "m") for k, axis in enumerate("xyz")},
            "temperature": (self.temperature_c, "deg_C"),
            "u_temperature": (self.u_temperature_c, "K"),
            **{f"wind_{axis}": (self.wind[:, k], "m / s") for k, axis in enumerate("xy")},
            **{f"u_wind_{axis}": (self.u_wind[:, k], "m / s") for k, axis in enumerate("xy")},
        }
        times = {
            "source": ([array.names[k] for k in array.source], ""),
            "receiver": ([array.names[k] for k in array.receiver], ""),
            "time": (array.time, "s"),
            "residual": (self.air.residual_c, "K"),
            "standardised": (self.standardised, ""),
            "status": (self.air.status, ""),
        }
        return {
            "lines": quantities(lines, refractivity="ppm"),
            "map": quantities(points),
            "times": quantities(times),
        }

    def figures(self) -> "dict[str, Figure]":
        """Map of temperature and wind, and of u, with stations, paths and chosen lines."""
        from catseye.gateways.air.array_figures import array_map

        return {"map": array_map(self.air)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye acoustic-field --out`."""
        from catseye.gateways.air.array_figures import write_array

        write_array(self.air, directory, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return dict(self.air.array.hashes)

    def sources(self) -> tuple[Path, ...]:
        """Stations, times and sheet."""
        return self.read


def acoustic_field(
    stations: "str | os.PathLike[str]",
    times: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    *,
    model: str = "real_gas",
    air_model: str = AIR_MODEL,
) -> AcousticFieldResult:
    """Temperature and wind among loudspeakers and microphones, from travel times.

    stations    table of places (docs/formats/acoustic.md)
    times       table of travel times between them, in one direction or both
    sheet       weather, equipment, expected variation, chosen lines; None: the table of times with the ending .toml
    model       formula of the speed of sound: real_gas or cramer1993
    air_model   formula of the index: ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963

    Raises InputError, with line and column, for files that cannot be read; EstimationError where no time is one of
    sound in air; ValidityError for stations too close or too far apart.
    Source: [PARKER04] chapter 4 asks for it; the estimate is [TARANTOLA05] section 3.2.

    >>> found = acoustic_field("acoustic/array-stations.csv", "acoustic/array-times.csv")
    >>> found.verdict.word, found.line_names
    ('good', ('ZY103', 'ZY104'))
    """
    from catseye.records.laboratory.sound_array import read_sound_array
    from catseye.reduction.air.array_air import array_air

    places, table = place_of(stations), place_of(times)
    beside = table.with_suffix(".toml") if sheet is None else place_of(sheet)
    found = array_air(read_sound_array(places, table, beside), model=model, air_model=air_model)
    empty, lines = np.zeros(0), found.lines
    calm = np.full(found.grid.shape, np.nan)
    return AcousticFieldResult(
        verdict=found.verdict,
        points=found.grid,
        temperature_c=found.map.temperature_c,
        u_temperature_c=found.map.u_temperature_c,
        covariance_c2=found.map.covariance_c2,
        wind=found.map.wind if found.windy else calm,
        u_wind=found.map.u_wind if found.windy else calm,
        line_names=tuple(line.name for line in found.array.sheet.lines),
        line_temperature_c=empty if lines is None else lines.temperature_c,
        u_line_temperature_c=empty if lines is None else lines.u_temperature_c,
        line_refractivity=empty if lines is None else lines.group_refractivity,
        u_line_refractivity=empty if lines is None else lines.u_group_refractivity,
        chi_square=found.field.tomogram.chi_square,
        standardised=found.standardised,
        air=found,
        read=(places, table, beside),
    )
