"""Target search by its return: spiral, scan, fitted spot.

    find                  the whole search, from a predicted pointing and a measuring function; the spot by `spot_fit`
    adjustment_readings   a table of the results, for the adjustment of zeros and angles

A target that is not found is a status with the searched area, never an exception.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.mirror.search_pattern import LEAST_REACH, Pattern, count_size, offsets_of_counts, raster, spiral
from catseye.geometry.sky.time_tag import TimeTag
from catseye.optics.spot import reach
from catseye.reduction.steering.spot_fit import SearchHead, Spot, fit_spot

Measure = Callable[[Array], float]  # amplitude, V, at (2,) counts; NaN without a reading
Allowed = Callable[[Array, Array], bool]  # from counts (2,) to counts (2,), now

WIDER = 1.6  # half a scan's width over the spot's radius
RECENTRED = 3  # scans at most


def find(
    predicted: ArrayLike,
    head: SearchHead,
    measure: Measure,
    *,
    search_radius: float,
    allowed: Allowed | None = None,
    standing: ArrayLike | None = None,
) -> Spot:
    """Pointing of a target's largest return, near a predicted one.

    predicted       (2,) counts (Na, Ne), real, direct or prime
    head            the ranger
    measure         amplitude at (2,) whole counts
    search_radius   rad on the sky, 0 or more
    allowed         True if the mirror may go from counts to counts now (Sun, structure: `Guard.slew`); called before
                    every look, so that a long search avoids the moving Sun; always True if None
    standing        (2,) counts of the mirror at the start; those of the first look if None

    A spiral of looks, without gaps for a spot that falls to the threshold no sooner than to half its peak (a status
    reports it where whole counts are too coarse for that), until one is above the threshold; a raster about it, moved
    until the spot's centre is well inside; then `fit_spot`. Light that is no spot (a spike, a reflection) does not end
    the search: the spiral continues.

    Source: the notes' practice of searching at predicted counts; patterns in `geometry.mirror.search_pattern`.
    """
    looked: dict[tuple[float, ...], float] = {}
    refused: set[tuple[float, ...]] = set()
    position = None if standing is None else np.asarray(standing, dtype=float)

    def look(at: Array) -> float:
        nonlocal position
        if tuple(at) in looked:
            return looked[tuple(at)]
        if allowed is not None and not allowed(at if position is None else position, at):
            refused.add(tuple(at))
            return np.nan
        position = at
        looked[tuple(at)] = float(measure(at))
        return looked[tuple(at)]

    within = max(float(reach(head.radius, 0.5)), LEAST_REACH)
    pattern = spiral(predicted, head.zeros, search_radius, reach=within, limits=head.azimuth_limits)
    spot, light = Spot(""), None
    for at in pattern.counts:
        before = tuple(at) in looked  # by a scan of light that was no spot
        if look(at) > head.threshold_volt and not before:
            spot, light = _centred(at, head, look, looked), at
            if spot.found:
                break
    amplitudes = list(looked.values())
    status = spot.status
    if light is None:
        status = _dark_status(pattern, len(refused), amplitudes, predicted, head, search_radius)
    elif not spot.found:
        status = f"{status} (light of {np.nanmax(amplitudes):.2f} V near {light[0]:.0f}, {light[1]:.0f})"
    return replace(spot, status=status, looked_at=np.array(list(looked)).reshape(-1, 2), seen=np.array(amplitudes))


def _centred(
    hit: Array,
    head: SearchHead,
    look: Measure,
    looked: Mapping[tuple[float, ...], float],
) -> Spot:
    """Spot about a place with light.

    Scanned again until its centre is well inside.
    """
    fine = float(max(0.5 * np.hypot(*count_size(hit, head.zeros)) * 1.001, 0.25 * head.radius))
    centre, half = hit, WIDER * head.radius
    spot = Spot("")
    for _ in range(RECENTRED):
        try:
            scan = raster(centre, head.zeros, (half, half), reach=fine, limits=head.azimuth_limits)
        except ValidityError:  # the azimuth axis lies within the scan: a raster has no rows there
            scan = spiral(centre, head.zeros, half, reach=max(fine, LEAST_REACH), limits=head.azimuth_limits)
        for at in scan.counts:
            look(at)
        places, values = np.array(list(looked)), np.array(list(looked.values()))
        near = offsets_of_counts(centre, head.zeros, places)
        use = np.hypot(near[:, 0], near[:, 1]) <= 2.0 * half
        spot = fit_spot(places[use], values[use], head)
        off = offsets_of_counts(centre, head.zeros, spot.counts[None])[0] if spot.found else np.zeros(2)
        if not spot.found or np.hypot(*off) <= 0.5 * half:
            break
        centre = np.rint(spot.counts)
    return spot


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of the search for one target: name, spot with status, time."""

    target: str
    spot: Spot
    when: TimeTag


def adjustment_readings(results: Sequence[SearchResult], places: Mapping[str, ArrayLike], ne0: float) -> str:
    """CSV text of found targets with their places.

    In the format of the calibration kind `search-results`.

    results    of one ranger; those not found have no row
    places     target: (3,) m, ground
    ne0        counts, elevation at Phi = 0: below it is the prime pointing

    Raises ValidityError where none was found, or where a found target has no place.
    """
    hits = [result for result in results if result.spot.found]
    missing = [result.target for result in hits if result.target not in places]
    if missing or not hits:
        what = f"{missing[0]} was found but has no place" if missing else f"none of {len(results)} targets was found"
        raise ValidityError(f"{what}: no readings for an adjustment")
    _refuse_commas(hits)
    lines = ["target,x_m,y_m,z_m,azimuth_counts,elevation_counts,u_azimuth_counts,u_elevation_counts,pointing,mjd_utc"]
    for result in hits:
        (na, ne), u = result.spot.counts, result.spot.u_counts
        where = [f"{x:.5f}" for x in np.asarray(places[result.target], dtype=float)]
        pointing = "prime" if ne < ne0 else "direct"
        counts = (f"{na:.3f}", f"{ne:.3f}", f"{u[0]:.3g}", f"{u[1]:.3g}")
        lines.append(",".join([result.target, *where, *counts, pointing, result.when.text()]))
    return "\n".join(lines) + "\n"


def _refuse_commas(results: Sequence[SearchResult]) -> None:
    for result in results:
        if not result.target or any(mark in result.target for mark in ',"\r\n'):
            raise ValidityError(
                f"target {result.target!r} is not a valid name for a table (expected no comma, quote, line end)"
            )


def _dark_status(
    pattern: Pattern, forbidden: int, amplitudes: list[float], predicted: ArrayLike, head: SearchHead, radius: float
) -> str:
    """Status of a search without light."""
    na, ne = np.asarray(predicted, dtype=float)
    readings = [value for value in amplitudes if np.isfinite(value)]
    gaps = {
        "beyond the stops": pattern.left_out,
        "forbidden": forbidden,
        "without a reading": len(amplitudes) - len(readings),
    }
    omitted = ", ".join(f"{number} {what}" for what, number in gaps.items() if number)
    narrow = "; the spot is narrower than the step of whole counts" if reach(head.radius, 0.5) < LEAST_REACH else ""
    most = f"; the largest was {max(readings):.3f} V" if readings else ""
    return (
        f"not found: nothing above {head.threshold_volt:g} V at {len(readings)} places within {1e3 * radius:.3g} mrad "
        f"of {na:.1f}, {ne:.1f}{f' ({omitted})' if omitted else ''}{most}{narrow}"
    )
