"""actuators.csv: required motions of a dish's actuators; positions.csv: current positions.

Both are tables with one row per actuator; columns in docs/formats/surface.md.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from catseye.records.files.reading import Folder
from catseye.records.files.record import Name, Record, Within
from catseye.records.files.refusal import refusal, shown

LIMIT_MM = 25.4  # of an actuator's travel, in both directions from its middle
STEP_MM = 0.025  # of its encoder

Travel = Annotated[float, Within(-1000, 1000)]
Spread = Annotated[float, Within(0, 1000)]
Place = Annotated[float, Within(-1e4, 1e4)]


class ActuatorPosition(Record):
    """Row of positions.csv: an actuator's travel from its middle, positive towards the focus.

    actuator      name of the actuator
    position_mm   travel from its middle
    """

    actuator: Name
    position_mm: Travel


class ActuatorCorrection(Record):
    """Row of actuators.csv.

    x_m, y_m, z_m              design position of its support of the panels, reflector frame
    deviation_mm               deviation of the surface there, along the normal, positive towards the focus
    correction_mm              correction of its travel: the deviation's opposite
    steps, left_mm             whole steps of its encoder, and the remaining correction
    position_mm, target_mm     before and after; 0 without a known position
    within_limits              True if the target is
    prisms, weight             the three prisms with the largest weights, joined by spaces, and their sum of weights
    how                        "measured": it has its own prism; "foretold": predicted without one
    actuator                   name of the actuator
    """

    actuator: Name
    x_m: Place
    y_m: Place
    z_m: Place
    deviation_mm: Travel
    u_deviation_mm: Spread
    correction_mm: Travel
    u_correction_mm: Spread
    steps: Annotated[int, Within(-100_000, 100_000)]
    left_mm: Travel
    position_mm: Travel
    target_mm: Travel
    within_limits: Literal["yes", "no"]
    how: Literal["measured", "foretold"]
    prisms: Annotated[str, Field(min_length=1)]
    weight: Annotated[float, Within(0, 1.000001)]


def read_positions(path: Path | str) -> dict[str, float]:
    """Travel of each actuator, mm, by name; InputError for an invalid file or a repeated name.

    path   CSV with the header actuator,position_mm; or actuators.csv of `catseye surface`, whose whole steps were made:
           the travel is then that after them, from 0 where that table knew no position

    Raises InputError too for a table of corrections with a target beyond its actuator's limits, which no step reaches.
    """
    path = Path(path)
    positions: dict[str, float] = {}
    earlier = _corrections(path)
    table = Folder(path.parent).table(path.name, ActuatorPosition) if earlier is None else ()
    rows = earlier or {n: (record.actuator, record.position_mm) for n, record in enumerate(table, start=1)}
    for row, (actuator, position_mm) in rows.items():
        if actuator in positions:
            raise refusal(path.name, f"row {row}, actuator = {shown(actuator)} is given twice (expected once)")
        positions[actuator] = position_mm
    return positions


def _corrections(path: Path) -> dict[int, tuple[str, float]] | None:
    """Actuator and travel after its whole steps, mm, by row of a table of corrections; None for another table."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            if "target_mm" not in file.readline().split(","):
                return None
    except OSError:  # refused by the reader of positions
        return None
    rows = Folder(path.parent).table(path.name, ActuatorCorrection)
    for row, one in enumerate(rows, start=1):
        if one.within_limits == "no":
            text = f"row {row}, actuator {shown(one.actuator)} cannot reach target_mm = {one.target_mm:g}"
            raise refusal(path.name, f"{text}, so that its position is unknown (expected positions as read)")
    return {n: (one.actuator, one.target_mm - one.left_mm) for n, one in enumerate(rows, start=1)}
