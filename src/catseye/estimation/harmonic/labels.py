"""Names of the unknowns of a harmonic fit, for its messages."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HarmonicLabels:
    """Names of a fit's unknowns; numbers where there are none.

    body       name of the body
    points     n names
    functions  m names of the points' functions, then K of the body's
    own        m, number of the points' functions
    """

    body: str = "the body"
    points: tuple[str, ...] = ()
    functions: tuple[str, ...] = ()
    own: int = 0

    def point(self, index: int) -> str:
        """Name of a point.

        >>> HarmonicLabels().point(3), HarmonicLabels(points=("A", "B")).point(1)
        ('point 3 (counted from 0)', 'B')
        """
        return self.points[index] if self.points else f"point {index} (counted from 0)"

    def point_function(self, point: int, function: int) -> str:
        """Name of a function of a point."""
        if self.functions:
            return f"{self.point(point)} by {self.functions[function]!r}"
        return f"point {point} by its function {function + 1}"

    def body_function(self, function: int) -> str:
        """Name of a function of the body."""
        if self.functions:
            return f"{self.body} by {self.functions[self.own + function]!r}"
        return f"{self.body}'s function {function + 1}"


NUMBERED = HarmonicLabels()
