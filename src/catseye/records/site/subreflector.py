"""subreflector.toml: the actuators that move a subreflector, and its pivot."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import MILLIMETRE
from catseye.records.files.record import Name, Record, Vector, Version, Within, broken_rule

COUNT = 6
Span = Annotated[float, Within(10, 50_000)]  # mm, between the joints


class SubreflectorActuator(Record):
    """[[actuator]]: one actuator between a fixed joint and one on the subreflector.

    fixed_mm      joint that does not move, prime-focus frame
    moving_mm     joint on the subreflector at rest, prime-focus frame
    least_mm, most_mm   limits of its length between the joints
    u_length_mm   standard uncertainty of this length
    name          name of the actuator
    """

    name: Name
    fixed_mm: Vector
    moving_mm: Vector
    least_mm: Span
    most_mm: Span
    u_length_mm: Annotated[float, Within(0, 100)] = 0.0

    @model_validator(mode="after")
    def _rests_within_its_limits(self) -> "SubreflectorActuator":
        at_rest_mm = float(np.linalg.norm(np.subtract(self.moving_mm, self.fixed_mm)))
        if not self.least_mm <= at_rest_mm <= self.most_mm:
            raise broken_rule(
                f"{self.name} is {at_rest_mm:.6g} mm long at rest (expected within least_mm = {self.least_mm:g} and "
                f"most_mm = {self.most_mm:g})"
            )
        return self


class SubreflectorMount(Record):
    """Complete file.

    pivot_mm          of the turns, prime-focus frame
    focal_length_mm   of the dish: the prime-focus frame stands at this height in the reflector frame
    actuator          six actuators
    """

    format: Annotated[int | str, Version("subreflector")] = 1
    pivot_mm: Vector = (0.0, 0.0, 0.0)
    focal_length_mm: Annotated[float, Within(100, 1e6)] = 60_000.0
    actuator: Annotated[tuple[SubreflectorActuator, ...], Field(strict=False)]

    @model_validator(mode="after")
    def _has_six_names(self) -> "SubreflectorMount":
        names = [actuator.name for actuator in self.actuator]
        if len(names) != COUNT:
            raise broken_rule(f"actuator: {len(names)} tables (expected {COUNT}, as six degrees of freedom need)")
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise broken_rule(f"actuator: the name {twice!r} stands twice (expected each once)")
        return self

    @property
    def joints(self) -> dict[str, np.ndarray]:
        """Joints `fixed` and `moving` (6, 3) and the `pivot` (3,), m, prime-focus frame."""
        return {
            "fixed": np.array([actuator.fixed_mm for actuator in self.actuator]) * MILLIMETRE,
            "moving": np.array([actuator.moving_mm for actuator in self.actuator]) * MILLIMETRE,
            "pivot": np.array(self.pivot_mm) * MILLIMETRE,
        }
