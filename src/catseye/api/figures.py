"""`plot_sky`, `plot_servo`, `plot_air` and so on: figures that no other result has."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.journal import mjd_argument
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import ArgumentError, InputError
from catseye.names import AIR_MODEL
from catseye.verdict import Verdict

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.drawing import Svg
    from catseye.gateways.writers.passage import Passage

    Counts = tuple[float, float]

MARK = "catseye plot"  # in each figure written
DRAWN = Verdict("good", "the figure is drawn from these inputs")
MOST_COUNTS = 1e6  # of a mirror's axis, and of a move


@dataclass(frozen=True, eq=False, repr=False)
class FigureResult(Result):
    """One figure and its numbers.

    kind      of the figure, as in `catseye plot KIND`
    numbers   that it shows, by name
    svg       its text, with the matplotlib figure
    read      files that it was drawn from
    written   file that `save_figure` wrote, for `to_object`; None for none
    """

    kind: str
    numbers: dict[str, Any]
    svg: "Svg"
    read: tuple[Path, ...] = ()
    written: Path | None = None

    def passages(self) -> "Sequence[Passage]":
        """Its numbers in sentences."""
        from catseye.gateways.plots import plot_passages

        return plot_passages(self.kind, self.numbers)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye plot KIND --json`."""
        written = None if self.written is None else str(self.written)
        return {"verdict": self.verdict.to_object(), "kind": self.kind, "written": written, **self.numbers}

    def tables(self) -> "dict[str, QTable]":
        """`numbers`: a row a number, in the unit of its name."""
        single = {name: float(value) for name, value in self.numbers.items() if isinstance(value, int | float)}
        return {"numbers": quantities({"name": (list(single), ""), "value": (list(single.values()), "")})}

    def figures(self) -> "dict[str, Figure]":
        """The figure, under its kind."""
        return {self.kind: self.svg.figure}

    def save_figure(self, path: "str | os.PathLike[str]") -> Path:
        """Write the figure, whole or not at all.

        path   .svg, .pdf or .png: new, or an earlier figure of these

        Raises InputError for another suffix, an input of the figure, a file that is not catseye's.
        """
        from catseye.gateways.writers.drawing import picture_file
        from catseye.gateways.writers.output import write_atomically

        where = Path(path)
        if where.resolve() in {source.resolve() for source in self.read}:
            raise InputError(f"figure {where}: is an input of this figure (expected another name)")
        content = picture_file(self.svg, where, "figure", mark=f"{MARK} {self.kind}")
        write_atomically(where, content, option="figure", ours=lambda there: MARK.encode() in there)
        return where

    def sources(self) -> tuple[Path, ...]:
        """Files that it was drawn from."""
        return self.read


def require_figure(path: "str | os.PathLike[str]") -> Path:
    """Path of a figure, refused before the long work where `save_figure` would refuse its name.

    Raises InputError for another suffix or a directory.
    """
    from catseye.gateways.writers.drawing import refuse_picture

    refuse_picture(Path(path), "figure")
    return Path(path)


@with_units
def plot_sky(
    monument: "str | os.PathLike[str]",
    mirror: "str | os.PathLike[str]",
    at: Annotated[Any, In("mjd", one=True, text=True)],
    *,
    latitude_deg: Annotated[Any, In("deg", one=True)] = None,
    longitude_deg: Annotated[Any, In("deg", one=True)] = None,
    keep_out: "str | os.PathLike[str] | None" = None,
    start: "Counts | None" = None,
    end: "Counts | None" = None,
) -> FigureResult:
    """Figure of a ranger's sky with Sun, boxes and a slew.

    monument, mirror              records of the ranger's monument, and of the mirror on it
    at                            UTC, MJD or text
    latitude_deg, longitude_deg   of the site, degrees, if the record has none
    keep_out                      boxes that no beam may enter
    start, end                    azimuth and elevation of a slew, counts

    Raises InputError for an unusable record; ArgumentError for invalid arguments.
    """
    from catseye.gateways.steering.plots import sky_plot

    if (start is None) != (end is None):
        raise ArgumentError("start and end go together", "start", "end")
    for name, counts in (("start", start), ("end", end)):
        if counts is not None and not all(abs(count) <= MOST_COUNTS for count in counts):
            raise ArgumentError(f"{name} = {counts} is not within {MOST_COUNTS:g} counts", name)
    way = None if start is None or end is None else (start, end)
    read = _located(monument, mirror, keep_out)
    boxes = read[2] if keep_out is not None else None
    place = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    drawn = sky_plot(read[0], read[1], mjd_argument("at", at), way=way, keep_out=boxes, **place)
    return _result("sky", drawn, read)


@with_units
def plot_servo(
    *,
    mirror: "str | os.PathLike[str] | None" = None,
    counts: Annotated[Any, In("", whole=True)] = 10_000,
    axis: Annotated[Any, In("", whole=True)] = 0,
) -> FigureResult:
    """Figure of a move of a mirror's servo.

    mirror   record with the settings; None for those of the tuning study
    counts   length of the move, 1 to 1 000 000
    axis     0 azimuth, 1 elevation

    Raises InputError for a record without settings; ArgumentError for invalid arguments.
    """
    from catseye.gateways.steering.plots import servo_plot

    if not 1 <= counts <= MOST_COUNTS:
        raise ArgumentError(f"counts = {counts} is not 1 to {MOST_COUNTS:.0f}", "counts")
    if axis not in (0, 1):
        raise ArgumentError(f"axis = {axis} (expected 0 for azimuth or 1 for elevation)", "axis")
    read = _located(mirror)
    return _result("servo", servo_plot(read[0] if read else None, axis, counts), read)


@with_units
def plot_air(
    temperature_c: Annotated[Any, In("deg_C", one=True)] = 20.0,
    pressure_hpa: Annotated[Any, In("hPa", one=True)] = 1013.25,
    humidity_percent: Annotated[Any, In("percent", one=True)] = 50.0,
    *,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    model: str = AIR_MODEL,
    co2_ppm: Annotated[Any, In("ppm", one=True)] = 450.0,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True, one=True)] = 0.0,
    u_pressure_hpa: Annotated[Any, In("hPa", one=True)] = 0.0,
    u_humidity_percent: Annotated[Any, In("percent", one=True)] = 0.0,
) -> FigureResult:
    """Figure of the index of air against each variable, with its uncertainty and the other models.

    temperature_c, pressure_hpa, humidity_percent   state of the air: °C, hPa, % over liquid water
    wavelength_um   vacuum wavelength, µm
    model           formula of the index
    co2_ppm         carbon dioxide, ppm
    u_...           standard uncertainties of the state

    Raises ValidityError for values outside the model's limits and for invalid uncertainties; ArgumentError for an
    unknown model.

    >>> round(plot_air(20, 933, 50).numbers["group_refractivity_ppm"], 1)
    253.3
    """
    from catseye.atmosphere.index.air import MODELS
    from catseye.gateways.air.air_figures import StateUncertainty, air_plot

    if model not in MODELS:
        raise ArgumentError(f"model = {model!r} is not one of {', '.join(MODELS)}", "model")
    drawn = air_plot(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
        uncertainty=StateUncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent),
    )
    return _result("air", drawn)


def plot_return() -> FigureResult:
    """Figure of return and range change of each kind of retroreflector against the incidence."""
    from catseye.gateways.optics.retroreflector_figures import return_plot

    return _result("return", return_plot())


@with_units
def plot_aberration(*, beam_radius_mm: Annotated[Any, In("mm", one=True)] = 10.0) -> FigureResult:
    """Figure of the ball's spherical aberration: range, deviation and light against the ray's height.

    beam_radius_mm   of the beam at the ball, 1/e², mm

    Raises ValidityError for a radius that is not above 0.
    """
    from catseye.gateways.optics.retroreflector_figures import aberration_plot

    return _result("aberration", aberration_plot(beam_radius=beam_radius_mm * MILLIMETRE))


@with_units
def plot_coating(
    names: Sequence[str] = (),
    *,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    incidence_deg: Annotated[Any, In("deg", one=True)] = 0.0,
) -> FigureResult:
    """Figure of coatings against angle and wavelength: reflectance, and what a range reads too long.

    names           of the coatings, at most 6; the usual ones if none
    wavelength_um   vacuum wavelength, µm
    incidence_deg   for which films are made, 0 to 90 degrees

    Raises ValidityError for an unknown coating; ArgumentError for an invalid incidence.
    """
    from catseye.gateways.optics.beam_figures import DRAWN as USUAL
    from catseye.gateways.optics.beam_figures import coating_plot

    if not (math.isfinite(incidence_deg) and 0.0 <= incidence_deg < 90.0):
        raise ArgumentError(f"incidence_deg = {incidence_deg} is not within 0 to 90 degrees", "incidence_deg")
    return _result("coating", coating_plot(tuple(names) or USUAL, wavelength_um, incidence_deg * DEGREE))


@with_units
def plot_polarization(
    *, glass: str = "BK7-old", wavelength_um: Annotated[Any, In("um", one=True)] = 0.780
) -> FigureResult:
    """Figure of the polarization of cube corners: six sectors, and the return through an analyser.

    glass           of the solid corner
    wavelength_um   wavelength in air, µm

    Raises ValidityError for an unknown glass and outside 0.62 to 1.01 µm.
    """
    from catseye.gateways.optics.polarization_figures import polarization_plot

    return _result("polarization", polarization_plot(wavelength_um, glass))


def plot_beam(train: "str | os.PathLike[str]") -> FigureResult:
    """Figure of a beam along its path from the diode to the detector.

    train   a train of elements, docs/formats/beam.md

    Raises InputError for an unusable record.
    """
    from catseye.gateways.optics.beam_figures import beam_plot

    read = _located(train)
    return _result("beam", beam_plot(read[0]), read)


def _located(*paths: "str | os.PathLike[str] | None") -> tuple[Path, ...]:
    """Files, or the examples of their names; None is left out."""
    return tuple(place_of(path) for path in paths if path is not None)


def _result(kind: str, drawn: "tuple[Svg, dict[str, Any]]", read: tuple[Path, ...] = ()) -> FigureResult:
    svg, numbers = drawn
    return FigureResult(DRAWN, kind, numbers, svg, read)
