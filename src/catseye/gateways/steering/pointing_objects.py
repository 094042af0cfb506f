"""Counts of a mirror as text, JSON, and in the format of CAL.EQ."""

from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.writers.cells import aligned
from catseye.gateways.writers.output import atomic_file
from catseye.geometry.sky.time_tag import utc_text
from catseye.reduction.site.stations import Pointings
from catseye.reduction.steering.aiming import AimedPoints
from catseye.reduction.steering.guard import GuardAnswer
from catseye.reduction.steering.sighting import Sighting

MARK = "# catseye point"
HEADINGS = ("x", "y", "z", "range", "N_a", "N_e", "autocoll.", "back retro", "N_a'", "N_e'", "allowed")
UNITS = ("m", "m", "m", "m", "counts", "counts", "counts", "counts", "counts", "counts", "")


def pointing_objects(aimed: AimedPoints) -> list[dict[str, Any]]:
    """Objects of the points, SI keys; `sun`, `keep_out` and `visibility` if requested."""
    pointings, sightings, visibility = aimed.pointings, aimed.sightings, aimed.visibility
    answer = []
    for k, to in enumerate(pointings.to):
        item: dict[str, Any] = {
            "verdict": aimed.verdict_of(k).to_object(),
            "to": to.tolist(),
            "range": float(pointings.aim.range[k]),
            "theta": float(pointings.aim.theta[k]),
            "phi": float(pointings.aim.phi[k]),
            "azimuth_counts": float(pointings.counts[k, 0]),
            "elevation_counts": float(pointings.counts[k, 1]),
            "autocollimation_counts": float(pointings.autocollimation[k]),
            "back_retro_counts": float(pointings.back_retro[k]),
            "prime": {
                "azimuth_counts": float(pointings.prime[k, 0]),
                "elevation_counts": float(pointings.prime[k, 1]),
                "allowed": bool(pointings.prime_allowed[k]),
            },
            "allowed": bool(pointings.allowed[k]),
            "u_azimuth_counts": float(pointings.u[k, 0]),
            "u_elevation_counts": float(pointings.u[k, 1]),
            "uncertainties_lacking": list(pointings.lacking),
        }
        if sightings:
            item |= _sighting_object(sightings[k])
        if visibility is not None:
            angle = float(visibility.incidence[0, k])
            item["visibility"] = {
                "visible": bool(visibility.seen[0, k]),
                "reason": visibility.reason(0, k),
                "incidence": angle,
            }
        answer.append(item)
    return answer


def _sighting_object(sighting: Sighting) -> dict[str, Any]:
    item: dict[str, Any] = {}
    if sighting.sun is not None:
        item["sun"] = {
            **_answer_object(sighting.sun),
            "separation": sighting.separation,
            "altitude": sighting.altitude,
            "azimuth": sighting.azimuth,
            "mjd": sighting.mjd,
            "earth_rotation": sighting.earth_rotation,
        }
    if sighting.keep_out is not None:
        item["keep_out"] = _answer_object(sighting.keep_out)
    return item


def _answer_object(answer: GuardAnswer) -> dict[str, Any]:
    return {
        "allowed": answer.allowed,
        "reason": answer.reason,
        "clearance": answer.clearance,
        "free_at_mjd": answer.free_at_mjd,
    }


def pointing_table(pointings: Pointings) -> str:
    """Table of counts and sights as text."""
    rows: list[tuple[str, ...]] = [HEADINGS, UNITS]
    for k, to in enumerate(pointings.to):
        counts = (*pointings.counts[k], pointings.autocollimation[k], pointings.back_retro[k], *pointings.prime[k])
        rows.append(
            (
                *(f"{v:.4f}" for v in (*to, pointings.aim.range[k])),
                *(f"{v:.2f}" for v in counts),
                _allowed(bool(pointings.allowed[k]), bool(pointings.prime_allowed[k])),
            )
        )
    return "\n".join(aligned(rows))


def _allowed(direct: bool, prime: bool) -> str:
    return {(True, True): "both", (True, False): "direct", (False, True): "prime"}.get((direct, prime), "neither")


def pointing_remarks(aimed: AimedPoints) -> list[str]:
    """Remarks beyond the table, one line each."""
    pointings, sightings, visible = aimed.pointings, aimed.sightings, aimed.visibility
    remarks = []
    if pointings.lacking:
        remarks.append(f"u of the counts unknown: the records do not have {', '.join(pointings.lacking)}")
    else:
        u = np.max(pointings.u, axis=0)
        most = [f"{v:.2f}" if np.isfinite(v) else "unknown" for v in u]
        remarks.append(f"u of the counts at most {most[0]} in azimuth, {most[1]} in elevation")
    for sighting in sightings:
        remarks += [v.reason for v in (sighting.sun, sighting.keep_out) if v is not None and not v.allowed]
    if visible is not None:
        for k, to in enumerate(pointings.to):
            remarks.append(f"{', '.join(f'{v:g}' for v in to)}: {visible.reason(0, k)}")
    suns = [sighting for sighting in sightings if sighting.separation is not None]
    if suns:
        first, near = suns[0], min(float(sighting.separation or 0.0) for sighting in suns) / DEGREE
        altitude, azimuth = float(first.altitude or 0.0) / DEGREE, float(first.azimuth or 0.0) / DEGREE
        remarks.append(
            f"Sun at {utc_text(first.mjd)}: altitude {altitude:.2f} deg, azimuth {azimuth:.2f} deg; nearest beam "
            f"{near:.1f} deg from it; UT1 {first.earth_rotation}"
        )
    return remarks


def output_dat(pointings: Pointings, name: str) -> str:
    """CAL.EQ's output.dat: x y z in mm, N_a, N_e, and N_e of autocollimation, with one decimal."""
    lines = [f"{MARK} {name}: x y z (mm), azimuth, elevation, elevation to autocollimate (counts)"]
    for to, counts, face in zip(pointings.to / MILLIMETRE, pointings.counts, pointings.autocollimation, strict=True):
        lines.append(" ".join([*(f"{v:11.1f}" for v in to), *(f"{v:9.1f}" for v in (*counts, face))]))
    return "\n".join(lines) + "\n"


def write_output_dat(pointings: Pointings, name: str, path: Path) -> None:
    """Write CAL.EQ's output.dat, atomically."""
    with atomic_file(path, "counts", MARK) as pieces:
        pieces.append(output_dat(pointings, name))
