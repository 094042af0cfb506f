"""Counts of a mirror for people, for programs, and as CAL.EQ printed them."""

from typing import Any

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.sky.time_tag import utc_text
from catseye.reduction.site.stations import Pointings
from catseye.reduction.steering.guard import GuardAnswer
from catseye.reduction.steering.sighting import Sighting
from catseye.reduction.steering.visibility import Visibility

MARK = "# catseye point"
HEADINGS = ("x", "y", "z", "range", "N_a", "N_e", "autocoll.", "back retro", "N_a'", "N_e'", "allowed")
UNITS = ("m", "m", "m", "m", "counts", "counts", "counts", "counts", "counts", "counts", "")


def pointing_objects(
    found: Pointings, sightings: list[Sighting], seen: Visibility | None = None
) -> list[dict[str, Any]]:
    """One object a point, SI keys; `sun`, `keep_out` and `visibility` where they were asked for."""
    answer = []
    for k, to in enumerate(found.to):
        item: dict[str, Any] = {
            "to": to.tolist(),
            "range": float(found.aim.range[k]),
            "theta": float(found.aim.theta[k]),
            "phi": float(found.aim.phi[k]),
            "azimuth_counts": float(found.counts[k, 0]),
            "elevation_counts": float(found.counts[k, 1]),
            "autocollimation_counts": float(found.autocollimation[k]),
            "back_retro_counts": float(found.back_retro[k]),
            "prime": {
                "azimuth_counts": float(found.prime[k, 0]),
                "elevation_counts": float(found.prime[k, 1]),
                "allowed": bool(found.prime_allowed[k]),
            },
            "allowed": bool(found.allowed[k]),
            "u_azimuth_counts": float(found.u[k, 0]),
            "u_elevation_counts": float(found.u[k, 1]),
            "uncertainties_lacking": list(found.lacking),
        }
        if sightings:
            item |= _sighting_object(sightings[k])
        if seen is not None:
            angle = float(seen.incidence[0, k])
            item["visibility"] = {"visible": bool(seen.seen[0, k]), "reason": seen.reason(0, k), "incidence": angle}
        answer.append(item)
    return answer


def _sighting_object(seen: Sighting) -> dict[str, Any]:
    item: dict[str, Any] = {}
    if seen.sun is not None:
        item["sun"] = {
            **_verdict_object(seen.sun),
            "separation": seen.separation,
            "altitude": seen.altitude,
            "azimuth": seen.azimuth,
            "mjd": seen.mjd,
            "earth_rotation": seen.earth_rotation,
        }
    if seen.keep_out is not None:
        item["keep_out"] = _verdict_object(seen.keep_out)
    return item


def _verdict_object(verdict: GuardAnswer) -> dict[str, Any]:
    return {
        "allowed": verdict.allowed,
        "reason": verdict.reason,
        "clearance": verdict.clearance,
        "free_at_mjd": verdict.free_at_mjd,
    }


def pointing_table(found: Pointings) -> str:
    """Counts and sights as columns of text for people."""
    rows: list[tuple[str, ...]] = [HEADINGS, UNITS]
    for k, to in enumerate(found.to):
        counts = (*found.counts[k], found.autocollimation[k], found.back_retro[k], *found.prime[k])
        rows.append(
            (
                *(f"{v:.4f}" for v in (*to, found.aim.range[k])),
                *(f"{v:.2f}" for v in counts),
                _allowed(bool(found.allowed[k]), bool(found.prime_allowed[k])),
            )
        )
    width = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    return "\n".join("  ".join(cell.rjust(w) for cell, w in zip(row, width, strict=True)).rstrip() for row in rows)


def _allowed(direct: bool, prime: bool) -> str:
    return {(True, True): "both", (True, False): "direct", (False, True): "prime"}.get((direct, prime), "neither")


def pointing_remarks(found: Pointings, sightings: list[Sighting], visible: Visibility | None = None) -> list[str]:
    """What the table does not show, one line each."""
    remarks = []
    if found.lacking:
        remarks.append(f"u of the counts unknown: the records do not have {', '.join(found.lacking)}")
    else:
        u = np.max(found.u, axis=0)
        most = [f"{v:.2f}" if np.isfinite(v) else "unknown" for v in u]
        remarks.append(f"u of the counts at most {most[0]} in azimuth, {most[1]} in elevation")
    for seen in sightings:
        remarks += [v.reason for v in (seen.sun, seen.keep_out) if v is not None and not v.allowed]
    if visible is not None:
        for k, to in enumerate(found.to):
            remarks.append(f"{', '.join(f'{v:g}' for v in to)}: {visible.reason(0, k)}")
    suns = [seen for seen in sightings if seen.separation is not None]
    if suns:
        first, near = suns[0], min(float(seen.separation or 0.0) for seen in suns) / DEGREE
        altitude, azimuth = float(first.altitude or 0.0) / DEGREE, float(first.azimuth or 0.0) / DEGREE
        remarks.append(
            f"Sun at {utc_text(first.mjd)}: altitude {altitude:.2f} deg, azimuth {azimuth:.2f} deg; nearest beam "
            f"{near:.1f} deg from it; UT1 {first.earth_rotation}"
        )
    return remarks


def output_dat(found: Pointings, name: str) -> str:
    """CAL.EQ's output.dat: x y z in mm, N_a, N_e, and N_e to autocollimate, counts with one decimal as it had."""
    lines = [f"{MARK} {name}: x y z (mm), azimuth, elevation, elevation to autocollimate (counts)"]
    for to, counts, face in zip(found.to / MILLIMETRE, found.counts, found.autocollimation, strict=True):
        lines.append(" ".join([*(f"{v:11.1f}" for v in to), *(f"{v:9.1f}" for v in (*counts, face))]))
    return "\n".join(lines) + "\n"
