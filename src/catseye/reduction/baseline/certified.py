"""Results of a baseline as calibrated quantities, each with its budget."""

import math
from collections.abc import Iterator

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.reduction.baseline.result import BaselineCalibration
from catseye.reduction.calibrations.budget import (
    SCATTER,
    UNSTATED,
    Contribution,
    significant,
    welch_satterthwaite,
)
from catseye.reduction.calibrations.calibration import Quantity
from catseye.reduction.calibrations.kind import student

SCATTERS = ("noise", "noise, as it is estimated")  # causes that the sets' own scatter tells


def baseline_quantities(calibration: BaselineCalibration) -> tuple[Quantity, ...]:
    """Zero, scale, cyclic terms, and the place of each pillar along the line.

    Source: [JCGM100] G.4.1, Welch and Satterthwaite, as `BaselineSolution.freedom_of`.
    """
    return tuple(
        _quantity(calibration, *each) for each in _selection(calibration) if each[0] in calibration.solution.names
    )


def _selection(calibration: BaselineCalibration) -> Iterator[tuple[str, str, str, float, str]]:
    """Parameter, key, unit, its size in SI units, and meaning."""
    yield "zero", "zero_mm", "mm", MILLIMETRE, "by which the instrument reads too much at any distance"
    yield "scale", "scale_ppm", "ppm", PPM, "by which it reads too much in proportion to the distance"
    for name in calibration.cyclic:
        _, function, order = name.split(" ")
        key = f"cyclic_{function}_{order}_mm"
        yield name, key, "mm", MILLIMETRE, f"by which it reads too much, times the {function} of order {order}"
    for number in calibration.order:
        name = calibration.names[number]
        meaning = f"pillar {name} along the line, from the first pillar, in the height of the distances"
        yield f"x {number}", f"x_{name}_m", "m", 1.0, meaning


def _quantity(calibration: BaselineCalibration, name: str, key: str, unit: str, size: float, meaning: str) -> Quantity:
    solution = calibration.solution
    at = solution.names.index(name)
    value, u = solution.of(name)
    parts = {cause: float(part[at]) / size for cause, part in solution.parts.items()}
    scatter = math.hypot(*(parts.pop(cause) for cause in SCATTERS))
    estimated = bool(np.isfinite(solution.u_noise).any())
    rows = [
        Contribution(
            source="scatter of the sets",
            u=scatter,
            unit=unit,
            evaluation="A" if estimated else "B",
            distribution=SCATTER if estimated else UNSTATED,
            degrees=float(max(solution.freedom_sets, 1)) if estimated else np.inf,
            sensitivity=1.0,
        ),
        *(Contribution(cause, part, unit, "B", UNSTATED, np.inf, 1.0) for cause, part in parts.items()),
    ]
    degrees = welch_satterthwaite(rows)
    return Quantity(
        key=key,
        value=value / size,
        u=u / size,
        unit=unit,
        meaning=meaning,
        coverage=float(student(degrees, 2.0)),
        budget=significant(rows),
        degrees=degrees,
    )
