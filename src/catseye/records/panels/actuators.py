"""actuators.csv: what each actuator of a dish has to do; positions.csv: where each stands now.

Both are tables, a row an actuator; docs/formats/surface.md says each column.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from catseye.records.files.reading import Folder
from catseye.records.files.record import Name, Record, Within
from catseye.records.files.refusal import refusal, shown

LIMIT_MM = 25.4  # of an actuator's travel, both ways from its middle
STEP_MM = 0.025  # of its encoder

Travel = Annotated[float, Within(-1000, 1000)]
Spread = Annotated[float, Within(0, 1000)]
Place = Annotated[float, Within(-1e4, 1e4)]


class ActuatorPosition(Record):
    """One row of positions.csv: the actuator's travel from its middle, above zero towards the focus."""

    actuator: Name
    position_mm: Travel


class ActuatorCorrection(Record):
    """One row of actuators.csv.

    x_m, y_m, z_m              where it holds the panels, reflector frame, as designed
    deviation_mm               of the surface there, along the normal, above zero towards the focus
    correction_mm              of its travel: the deviation's opposite
    steps, left_mm             whole steps of its encoder, and what they leave of the correction
    position_mm, target_mm     before and after; 0 where no position is known
    within_limits              whether the target is
    prisms, weight             the three prisms that support it most, joined by spaces, and their part of the weights
    how                        "measured": it has a prism of its own; "foretold": it has none that was seen
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
    """Each actuator's travel, mm, by its name; InputError for a file that cannot be used or a name given twice.

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
    """The rows of a table of corrections, as `catseye surface --actuators` writes it; InputError for another file."""
    path = Path(path)
    return Folder(path.parent).table(path.name, ActuatorCorrection)
