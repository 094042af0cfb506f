"""Status of a target's position, as a value and in words."""

from enum import IntEnum


class PositionStatus(IntEnum):
    """Status of one target; only FOUND and CONTRADICTING have coordinates."""

    FOUND = 0
    CONTRADICTING = 1
    TOO_FEW = 2
    COLLINEAR = 3
    NOT_HELD = 4
    DISJOINT = 5
    AMBIGUOUS = 6
    AT_STATION = 7
    NOT_CONVERGED = 8
    REFUSED = 9


TEXTS = {
    PositionStatus.FOUND: "found",
    PositionStatus.CONTRADICTING: "its {ranges} ranges contradict each other: residuals are {ratio:.3g} times "
    "their sigma (limit 10); one of them or a station is grossly wrong",
    PositionStatus.TOO_FEW: "seen by {ranges} ranges only: three are needed; measure from another station",
    PositionStatus.COLLINEAR: "the stations that see it lie on one line: it may be anywhere on a circle about that "
    "line; measure from a station off the line",
    PositionStatus.NOT_HELD: "its ranges do not determine it in one direction: it lies in one plane with the stations "
    "that see it, or too far from them for their extent; measure from a station off that plane",
    PositionStatus.DISJOINT: "its {ranges} ranges do not meet in a point: they miss each other by {ratio:.3g} times "
    "their sigma (limit 5); a range is too short, or a station or target was mistaken",
    PositionStatus.AMBIGUOUS: "the stations that see it lie in one plane and its two mirror images fit equally well; "
    "give a point on its side of the plane (`near`), or a range from off the plane",
    PositionStatus.AT_STATION: "it is within four sigma of a station, where a range has no direction; "
    "leave that range out",
    PositionStatus.NOT_CONVERGED: "not converged after {iterations} steps, residuals {ratio:.3g} times their sigma; "
    "check its ranges and the stations",
    PositionStatus.REFUSED: "a range of it is negative or infinite, or the sigma of a range is not positive and finite",
}
