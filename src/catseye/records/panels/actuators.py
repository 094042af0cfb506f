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

    path   CSV with the header actuator,position_mm
    """
    path = Path(path)
    positions: dict[str, float] = {}
    for row, record in enumerate(Folder(path.parent).table(path.name, ActuatorPosition), start=1):
        if record.actuator in positions:
            raise refusal(path.name, f"row {row}, actuator = {shown(record.actuator)} is given twice (expected once)")
        positions[record.actuator] = record.position_mm
    return positions


def read_corrections(path: Path | str) -> list[ActuatorCorrection]:
    """Corrections of a table from `catseye surface --actuators`; InputError for other files."""
    path = Path(path)
    return Folder(path.parent).table(path.name, ActuatorCorrection)
