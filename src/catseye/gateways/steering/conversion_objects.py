"""Converted points as text and JSON."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.writers.cells import aligned
from catseye.gateways.writers.passage import Passage
from catseye.geometry.antenna.rigid_telescope import PARENTS
from catseye.names import counted
from catseye.reduction.steering.conversion import ConvertedPoints
from catseye.verdict import Verdict

BENDING = (
    "a rigid telescope on a perfect track: gravity, temperature and track move a real one by some millimetres, which "
    "neither coordinates nor u include"
)


def words_of(frame: str) -> str:
    """Name of a frame for people.

    >>> words_of("feed_arm")
    'feed arm'
    """
    return frame.replace("_", " ")


def conversion_object(conversion: ConvertedPoints, verdict: Verdict) -> dict[str, Any]:
    """JSON object of a conversion, SI keys."""
    transform, telescope = conversion.transform, conversion.telescope
    posture = {"azimuth": telescope.azimuth, "elevation": telescope.elevation} if conversion.posture_known else None
    points = []
    for k, name in enumerate(conversion.names):
        x, y, z = conversion.after[k].tolist()
        spread = None if conversion.covariance is None else conversion.covariance[k].tolist()
        points.append(
            {"name": name, "from": conversion.before[k].tolist(), "x": x, "y": y, "z": z, "covariance": spread}
        )
    return {
        "verdict": verdict.to_object(),
        "from_frame": transform.from_,
        "to_frame": transform.to,
        "posture": posture,
        "transform": {
            "frame": transform.to,
            "pivot": transform.translation.tolist(),
            "rotation": transform.rotation.tolist(),
            "translation": transform.translation.tolist(),
        },
        "subreflector": {
            "frame": "prime_focus",
            "pivot": list(telescope.subreflector_pivot),
            "shift": list(telescope.subreflector_shift),
            "turn": list(telescope.subreflector_turn),
        },
        "points": points,
    }


def conversion_passages(conversion: ConvertedPoints) -> Iterator[Passage]:
    """Sentences of a conversion: frames, transform, subreflector, limits."""
    transform, telescope = conversion.transform, conversion.telescope
    text = f"{counted(len(conversion.names), 'point')} of the frame {words_of(transform.from_)} in the frame "
    text += words_of(transform.to)
    if conversion.posture_known:
        text += f", azimuth {telescope.azimuth / DEGREE:.10g} deg, elevation {telescope.elevation / DEGREE:.10g} deg"
    yield Passage("Conversion", text)
    place = ", ".join(f"{v:.6f}" for v in transform.translation.round(9) + 0.0)
    axes = [", ".join(f"{v:.9f}" for v in column) for column in (transform.rotation.T.round(12) + 0.0)]
    yield Passage(
        "Origin", f"of {words_of(transform.from_)}, and pivot of its turn: {place} m, {words_of(transform.to)}"
    )
    yield Passage("Axes", "; ".join(f"{name} ({axis})" for name, axis in zip("xyz", axes, strict=True)))
    if "subreflector" in (*_chain(transform.to), *_chain(transform.from_)):
        shift = ", ".join(f"{v / MILLIMETRE:g}" for v in telescope.subreflector_shift)
        turn = ", ".join(f"{v / DEGREE:g}" for v in telescope.subreflector_turn)
        pivot = ", ".join(f"{v:g}" for v in telescope.subreflector_pivot)
        yield Passage(
            "Subreflector", f"shift {shift} mm, turn {turn} deg about x, y, z; frame prime focus, pivot {pivot} m"
        )
    if conversion.bends:
        yield Passage("Note", BENDING)


def conversion_lines(conversion: ConvertedPoints) -> list[str]:
    """Table of the points as text."""
    before, after = words_of(conversion.transform.from_), words_of(conversion.transform.to)
    headings = ["point", *(f"{axis}, {before}" for axis in "xyz"), *(f"{axis}, {after}" for axis in "xyz")]
    units = ["", *("m",) * 6]
    u = None
    if conversion.covariance is not None:
        u = np.sqrt(np.diagonal(conversion.covariance, axis1=1, axis2=2)) / MILLIMETRE
        headings += [f"u_{axis}" for axis in "xyz"]
        units += ["mm"] * 3
    rows = [headings, units]
    for k, name in enumerate(conversion.names):
        row = [name, *(f"{v:.6f}" for v in (*conversion.before[k], *conversion.after[k].round(9) + 0.0))]
        rows.append(row if u is None else [*row, *(f"{v:.3f}" for v in u[k])])
    return aligned(rows)


def _chain(frame: str | None) -> Iterator[str]:
    """Frame with all those in which it stands."""
    while frame is not None:
        yield frame
        frame = PARENTS[frame]
