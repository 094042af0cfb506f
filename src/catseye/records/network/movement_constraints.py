"""movement-constraints.toml: which points move together, in a plane, along a line, or not at all."""

from collections import Counter
from typing import Annotated, Any

from pydantic import Field, model_validator

from catseye.records.files.record import Length, Name, Record, Vector, Version, Within, broken_rule

Points = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
Direction = Annotated[Vector, Length(1e-6, 1e6)]


class RigidConstraint(Record):
    """[[body]]: points that move together, by a shift and a small turn.

    name     of the body
    points   names of three points or more, not on one line
    """

    name: Name
    points: Annotated[tuple[str, ...], Field(strict=False, min_length=3)]


class PlaneConstraint(Record):
    """[[plane]]: points each of which moves in a plane, such as bearings that do not move up or down.

    name     of the constraint
    points   names
    normal   direction in which none of them moves, of any length
    """

    name: Name
    points: Points
    normal: Direction


class LineConstraint(Record):
    """[[line]]: points each of which moves along one direction.

    name     of the constraint
    points   names
    along    the direction, of any length
    """

    name: Name
    points: Points
    along: Direction


class StillConstraint(Record):
    """[[still]]: points that do not move.

    name     of the constraint
    points   names
    """

    name: Name
    points: Points


class MovementConstraints(Record):
    """Complete file: a point is in one constraint at most; others are free.

    u_excluded_mm   standard uncertainty of a movement that a constraint excludes: widens the covariance
    body            points that move together
    plane           points that each move in a plane
    line            points that each move along a line
    still           points that do not move
    """

    format: Annotated[int | str, Version("movement-constraints")] = 1
    u_excluded_mm: Annotated[float, Within(0, 1000)] = 0.0
    body: Annotated[tuple[RigidConstraint, ...], Field(strict=False)] = ()
    plane: Annotated[tuple[PlaneConstraint, ...], Field(strict=False)] = ()
    line: Annotated[tuple[LineConstraint, ...], Field(strict=False)] = ()
    still: Annotated[tuple[StillConstraint, ...], Field(strict=False)] = ()

    @property
    def every(self) -> tuple[Any, ...]:
        """All constraints, bodies first."""
        return (*self.body, *self.plane, *self.line, *self.still)

    @model_validator(mode="after")
    def _has_each_once(self) -> "MovementConstraints":
        for what, names in (
            ("constraint", [item.name for item in self.every]),
            ("point", [name for item in self.every for name in item.points]),
        ):
            twice = [name for name, count in Counter(names).items() if count > 1]
            if twice:
                raise broken_rule(f"{what} {twice[0]!r} occurs twice (expected once)")
        return self
