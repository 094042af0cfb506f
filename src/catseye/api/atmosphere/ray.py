"""`path`: air between two points, its profile, mean index and bent ray, from weather stations."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.constants import PPM
from catseye.names import AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.ray_path import AirPath


@dataclass(frozen=True, eq=False, repr=False)
class PathResult(Result):
    """Air between two points.

    group_refractivity, u_group_refractivity   mean n_g - 1 along the chord, u of weather and formula
    temperature_c, u_temperature_c             mean along the chord
    length                 of the chord, m
    leaving, arriving      ray's elevation less the chord's at start and end, rad
    u_leaving              standard uncertainty of both, rad
    sag                    of the ray across the middle of the chord, upwards, m
    optical_excess         optical path along the ray less that along the chord, m
    path                   everything else: profile, arc, bound
    source                 that was read
    """

    group_refractivity: float
    u_group_refractivity: float
    temperature_c: float
    u_temperature_c: float
    length: float
    leaving: float
    arriving: float
    u_leaving: float
    sag: float
    optical_excess: float
    path: "AirPath"
    source: Path

    def passages(self) -> "Sequence[Passage]":
        """Mean index, bending, delay, profile at stations' heights."""
        from catseye.gateways.air.ray_objects import path_passages

        return path_passages(self.path)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye path --json`."""
        from catseye.gateways.air.ray_objects import path_object

        return path_object(self.path)

    def tables(self) -> "dict[str, QTable]":
        """`profile`: a row for each height."""
        levels = self.path.levels
        columns = {
            "z": (levels.z, "m"),
            "temperature": (levels.temperature_c, "deg_C"),
            "u_temperature": (levels.u_temperature_c, "K"),
            "pressure": (levels.pressure_hpa, "hPa"),
            "humidity": (levels.humidity_percent, "%"),
            "group_refractivity": (levels.group_refractivity / PPM, ""),
            "u_group_refractivity": (levels.u_group_refractivity / PPM, ""),
            "index_gradient": (levels.index_gradient / PPM, "1 / m"),
        }
        return {"profile": quantities(columns, refractivity="ppm")}

    def figures(self) -> "dict[str, Figure]":
        """Profiles of temperature and index, and the ray above its chord."""
        from catseye.gateways.air.ray_figures import path_figure

        return {"path": path_figure(self.path)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye path --out`."""
        from catseye.gateways.air.ray_figures import write_path

        write_path(self.path, directory, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return dict(self.path.hashes)

    def sources(self) -> tuple[Path, ...]:
        """Campaign or table that was read."""
        return (self.source,)


@with_units
def path(
    stations: "str | os.PathLike[str]",
    start: Annotated[Any, In("m", many=True)],
    end: Annotated[Any, In("m", many=True)],
    *,
    mjd_utc: Annotated[Any, In("mjd", one=True)] = None,
    ground_m: Annotated[Any, In("m", one=True)] = None,
    wavelength_um: Annotated[Any, In("um", one=True)] = None,
    model: str = AIR_MODEL,
    co2_ppm: Annotated[Any, In("ppm", one=True)] = 450.0,
) -> PathResult:
    """Air between two points: profile, mean index, bent ray, with uncertainty.

    stations     directory of a campaign, or a table of stations at their heights (docs/formats/weather.md)
    start, end   (3,) m, in the frame of the stations' heights, z up
    mjd_utc      time; None: the middle of the readings
    ground_m     height of the ground, m; None: 2 m below the lowest station
    wavelength_um, model, co2_ppm   of the index, as for `air`; a campaign's wavelength is its site's: None

    Raises InputError for files that cannot be used; ArgumentError for ends or a time that do not fit; ValidityError
    for a path below the ground.
    Source: `catseye.atmosphere.path`: `air_profile` for the mean, `ray` for the ray, `bending` for the arc.

    >>> found = path("weather/stations.csv", (0.0, 0.0, 3.0), (100.0, 0.0, 40.0))
    >>> round(found.group_refractivity * 1e6, 1), round(found.leaving * 206264.8, 1)
    (262.7, 0.8)
    """
    from catseye.errors import ArgumentError, InputError
    from catseye.records.laboratory.station_heights import read_station_heights
    from catseye.records.night.campaign import read_campaign
    from catseye.reduction.air.ray_path import air_path, campaign_air, stations_air
    from catseye.reduction.air.routes import IndexFormula

    source = place_of(stations)
    ends = [np.asarray(point, float) for point in (start, end)]
    for name, point in zip(("start", "end"), ends, strict=True):
        if point.shape != (3,) or not np.isfinite(point).all():
            raise ArgumentError(f"{name} = {point.tolist()} is no point (expected x, y, z in m)", name)
    if source.is_dir():
        if wavelength_um is not None:
            raise ArgumentError("wavelength_um of a campaign is its site's", "wavelength_um")
        formula = IndexFormula(model=model, co2_ppm=co2_ppm)
        campaign = read_campaign(source)
        site = campaign_air(campaign, formula, ground_m)
        hashes = {name: digest_of(source / name) for name in ("site.toml", "weather.csv")}
    elif source.is_file():
        formula = IndexFormula(
            wavelength_um=0.780 if wavelength_um is None else wavelength_um, model=model, co2_ppm=co2_ppm
        )
        table = read_station_heights(source)
        site, hashes = stations_air(table, formula, ground_m), {source.name: table.digest}
    else:
        raise InputError(f"{stations}: not found (expected a campaign or a table of stations)")
    result = air_path(site, *ends, mjd_utc=mjd_utc, hashes=hashes)
    leaving, arriving = result.angles
    return PathResult(
        verdict=result.verdict,
        group_refractivity=float(result.mean.refractivity[0]),
        u_group_refractivity=result.u_refractivity,
        temperature_c=float(result.mean.temperature_c[0]),
        u_temperature_c=float(np.sqrt(result.mean.covariance_c2[0, 0])),
        length=result.length,
        leaving=leaving,
        arriving=arriving,
        u_leaving=0.5 * result.u_curvature * result.length,
        sag=result.ray_sag,
        optical_excess=float(result.ray.optical_excess[0]),
        path=result,
        source=source,
    )
