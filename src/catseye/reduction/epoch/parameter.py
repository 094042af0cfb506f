"""Parameters of an adjustment: comparable values with texts."""

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

XYZ = ("x", "y", "z")


class ParameterKind(Enum):
    """Kind of a parameter; the value formats its text.

    The text names its owner and its part.
    """

    POINT = "{of} {part}"
    FIXED_POINT = "{of}-F {part}"  # a monument's Kelvin fixed point is ZY101-F, its ranger's scan point ZY101
    REFERENCE_PLACE = "{of}@0 {part}"  # place of a point in the reference epoch, in its frame
    VELOCITY = "{of} rate {part}"  # m/s in its frame
    ZERO = "zero {of}"
    LEAKAGE = "leakage {of} {part}"
    AXES = "axes {of} {part}"  # errors of the sheet's four offsets of the mirror's axes and the beam
    AMPLITUDE = "amplitude {of}"
    CYCLIC = "cyclic {of} {part}"
    SECOND_PASS = "second pass {of} {part}"  # errors of the sheet's light that the detector sends out again
    BODY = "body {of} {part}"  # departure of the dish or the arm as a whole from the nominal posture
    NORMAL = "normal {of} {part}"  # tilts of a prism's face or of a triplet's plate
    GLASS = "glass {of}"
    PATH = "path {of} {part}"  # constant error of a line's index, ppm: of a ranger, to a target
    REPEATS = "repeats {of} {part}"  # the same for the error that shots on one line share in a campaign, ppm
    ELECTRONICS = "electronics {of} {part}"  # errors that a ranger's shots share between reference shots
    THERMOMETER = "the air {of}"  # of a weather station
    PROFILE = "the air {part}"  # "bend" or "gradient"
    SOUND = "the air {of} - {part}"  # of a line whose temperature sound measured: from, to
    LAG = "lag {of}"  # s, of a weather station's thermometer
    RADIATION = "sunshine on {of}"  # °C, bias of its thermometer for the Sun in the zenith
    AIR = "air's {of} {part}"  # a knot of the process in time: of its level, slope, east, north
    FAMILY = "unexplained {of} {part}"  # of a bin of `self_check`: of a family of shots, its number
    RECORD = "error of {of} {part}"  # of a record that changes ranges and has no prior: modulation, pressure, movement
    TELESCOPE = "telescope's {of} {part}"  # a knot of the telescope's motion and expansion during a campaign


AIR_KINDS = (
    ParameterKind.THERMOMETER,
    ParameterKind.PROFILE,
    ParameterKind.SOUND,
    ParameterKind.LAG,
    ParameterKind.RADIATION,
    ParameterKind.AIR,
)
POINT_KINDS = (ParameterKind.POINT, ParameterKind.FIXED_POINT)


class Parameter(NamedTuple):
    """A parameter, or the first of a quantity of several.

    kind   of the quantity
    of     its owner: a point, a ranger, a unit, a station, a sounded line
    part   of the quantity; "" where it has but one, and of a quantity as a whole

    >>> str(Parameter(ParameterKind.LEAKAGE, "ZY101", "real")), str(Parameter(ParameterKind.GLASS, "DP001"))
    ('leakage ZY101 real', 'glass DP001')
    """

    kind: ParameterKind
    of: str
    part: str = ""

    def __str__(self) -> str:
        return self.kind.value.format(of=self.of, part=self.part).strip()


GRADIENT = Parameter(ParameterKind.PROFILE, "", "gradient")
BEND = Parameter(ParameterKind.PROFILE, "", "bend")


def point_parameters(kind: ParameterKind, names: Iterable[str]) -> list[Parameter]:
    """Three parameters for each of some points."""
    return [Parameter(kind, name, axis) for name in names for axis in XYZ]
