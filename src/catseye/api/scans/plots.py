"""`plot_quadrant`, `plot_visibility`: figures of a quadrant detector, and of what each ranger sees."""

import os
from typing import Annotated, Any

import numpy as np

from catseye.api.figures import DRAWN, FigureResult
from catseye.api.reading import place_of
from catseye.api.units import In, with_units
from catseye.constants import DEGREE
from catseye.errors import ArgumentError

MICROMETRE = 1e-6  # m
MOST_STEPS = 10_000


@with_units
def plot_quadrant(
    *,
    spot_um: Annotated[Any, In("um", one=True)] = 100.0,
    gap_um: Annotated[Any, In("um", one=True)] = 0.0,
    noise_percent: Annotated[Any, In("percent", one=True)] = 0.5,
    gain: Annotated[Any, In("", one=True)] = 0.3,
    offset_um: Annotated[Any, In("um", one=True)] = 150.0,
    steps: Annotated[Any, In("", whole=True)] = 40,
    seed: Annotated[Any, In("", whole=True)] = 1,
) -> FigureResult:
    """Figure of a quadrant detector: place read against true place, its noise, and the servo that centres the spot.

    spot_um         radius of the spot at 1/e², µm
    gap_um          dead width between the quadrants, µm
    noise_percent   noise of each quadrant, % of the sum of all four
    gain            part of the place read that each step of the servo takes away, above 0 and below 2
    offset_um       of the spot at the start, µm; half of it across
    steps           of the servo, 1 to 10 000
    seed            of the noise

    Raises ValidityError for invalid sizes and a gain that is not stable; ArgumentError for invalid arguments.

    >>> round(plot_quadrant(spot_um=100).numbers["centre_slope"] * 1e6, 3)
    62.666
    """
    from catseye.gateways.optics.quadrant_figures import quadrant_plot

    if not 1 <= steps <= MOST_STEPS:
        raise ArgumentError(f"steps = {steps} is not 1 to {MOST_STEPS}", "steps")
    if not 0.0 < noise_percent <= 100.0:
        raise ArgumentError(f"noise_percent = {noise_percent:g} is not above 0 and up to 100", "noise_percent")
    if not (np.isfinite(offset_um) and abs(offset_um) <= 100.0 * abs(spot_um)):
        raise ArgumentError(f"offset_um = {offset_um:g} is more than 100 radii of the spot", "offset_um")
    if seed < 0:
        raise ArgumentError(f"seed = {seed} is below 0", "seed")
    drawn = quadrant_plot(
        spot_um * MICROMETRE,
        gap=gap_um * MICROMETRE,
        u_signal=0.01 * noise_percent,
        gain=gain,
        offset=offset_um * MICROMETRE,
        steps=steps,
        seed=seed,
    )
    return FigureResult(DRAWN, "quadrant", drawn[1], drawn[0])


@with_units
def plot_visibility(
    site: "str | os.PathLike[str]" = "night-01",
    *,
    solids: "str | os.PathLike[str] | None" = None,
    azimuth_deg: Annotated[Any, In("deg", one=True)] = None,
    elevation_deg: Annotated[Any, In("deg", one=True)] = None,
) -> FigureResult:
    """Figure of which ranger sees which retroreflector in a posture, or why not.

    site                          directory of a campaign or a site
    solids                        what stands in the way; nothing if None
    azimuth_deg, elevation_deg    of the telescope; the site's own if None

    Raises InputError for an unusable record; ArgumentError for a posture out of range.
    """
    from catseye.gateways.scans.visibility import visibility_plot

    if azimuth_deg is not None and not abs(azimuth_deg) <= 540.0:
        raise ArgumentError(f"azimuth_deg = {azimuth_deg:g} is not -540 to 540", "azimuth_deg")
    if elevation_deg is not None and not 0.0 <= elevation_deg <= 95.0:
        raise ArgumentError(f"elevation_deg = {elevation_deg:g} is not 0 to 95", "elevation_deg")
    read = [place_of(item) for item in (site, solids) if item is not None]
    posture = tuple(None if item is None else item * DEGREE for item in (azimuth_deg, elevation_deg))
    drawn = visibility_plot(read[0], read[1] if solids is not None else None, posture)
    return FigureResult(DRAWN, "visibility", drawn[1], drawn[0], tuple(read))
