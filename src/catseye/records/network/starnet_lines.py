"""Lines, units and options of a STAR*NET file."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.records.files.refusal import NUMBER, shown

Refuse = Callable[["StarnetLine", str], InputError]

GON = 0.9 * DEGREE
DMS = re.compile(r"([+-]?)([0-9]+)-([0-9]+)(?:-([0-9]+(?:\.[0-9]*)?))?")
QUADRANT = re.compile(r"([NS])(.+)([EW])", re.IGNORECASE)
UNITS = {"METERS": 1.0, "METRES": 1.0, "FEETUS": 1200.0 / 3937.0, "FEETINT": 0.3048}  # m; US survey foot exact
OPTION = re.compile(r"\.[A-Za-z23]")
COMMENT = re.compile(r"\s*catseye:(.*)", re.IGNORECASE)
DEFAULT_KEYS = (
    *("angle_arcsec", "direction_arcsec", "azimuth_arcsec", "zenith_arcsec"),
    *("distance_mm", "distance_ppm", "elevation_mm"),
)
SHAPING = ("RELATIVE", "PTOLERANCE", "ELLIPSE", "COPYINPUT", "LOSTSTATIONS", "PAGE", "TITLE")  # the listing only
OPTIONS = (
    "UNITS",
    "ORDER",
    "DELTA",
    "SEPARATOR",
    "2D",
    "3D",
    "DATA",
    "MULTIPLIER",
    "REFRACTION",
    "INSTRUMENT",
    "CATSEYE",
)
SHORTEST = 3  # shortest abbreviation of an option


@dataclass(frozen=True)
class StarnetLine:
    """Line of data: its words without comment and description."""

    place: str
    text: str
    words: list[str]

    @property
    def code(self) -> str:
        return self.words[0].upper()


@dataclass
class StarnetSettings:
    """Current settings by options.

    unit, multiplier    m per unit of length, and the factor of `.MULTIPLIER`
    gons                angles are in gon
    decimal             angles are in decimal degrees
    north_first         coordinates are north, east
    at_from_to          angles are At-From-To, else From-At-To
    delta               horizontal distance and elevation difference, else slope distance and zenith angle
    three_d             lines are three-dimensional
    separator           of stations
    data                lines are read
    refraction          coefficient, or None for a plane network
    instrument          last name given by `.INSTRUMENT`
    defaults            standard errors by the comment's key
    """

    unit: float = 1.0
    multiplier: float = 1.0
    gons: bool = False
    decimal: bool = False
    north_first: bool = True
    at_from_to: bool = True
    delta: bool = False
    three_d: bool = True
    separator: str = "-"
    data: bool = True
    instrument: str = ""
    refraction: float | None = None
    defaults: dict[str, float] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Metres per unit of a number in the file."""
        return self.unit * self.multiplier

    @property
    def angle_error(self) -> float:
        """Radians per unit of an angular standard error in the file: seconds, or milligons."""
        return 1e-3 * GON if self.gons else ARCSECOND


def lines_of(text: str) -> list[StarnetLine]:
    """Lines with words; catseye's comment becomes the option .CATSEYE.

    A last word `&` continues a line if the next one has no code, that is begins with no letter or option; else it
    means a default standard error.

    >>> [line.words for line in lines_of("M 2-1-3 45-00-00 10.0 90-00-00 & &\\n  & 1.5/1.6  # heights\\n")]
    [['M', '2-1-3', '45-00-00', '10.0', '90-00-00', '&', '&', '1.5/1.6']]
    """
    lines: list[StarnetLine] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        body, _, comment = raw.partition("#")
        place = f"line {number}"
        if note := COMMENT.fullmatch(comment):
            lines.append(StarnetLine(place, raw.strip(), [".CATSEYE", note[1].strip()]))
        words = body.partition("'")[0].split()
        if not words:
            continue
        starts = words[0][0].isalpha() or OPTION.match(words[0])
        if lines and lines[-1].words[-1] == "&" and not starts:
            last = lines.pop()
            lines.append(StarnetLine(last.place, f"{last.text} {body.strip()}", [*last.words[:-1], *words]))
        else:
            lines.append(StarnetLine(place, body.strip(), words))
    return lines


def number_of(line: StarnetLine, word: str, refuse: Refuse) -> float:
    """Number written as a word of a line."""
    if not NUMBER.fullmatch(word):
        raise refuse(line, f"{line.code}: {shown(word)} (expected a number)")
    return float(word)


def angle_of(
    line: StarnetLine, word: str, settings: StarnetSettings, *, refuse: Refuse, bearing: bool = False
) -> float:
    """Word as an angle in rad: gon, decimal degrees, or ddd-mm-ss.s; bearings also N34-23-45.7E.

    line       line of the word
    word       the angle
    settings   units
    refuse     function that makes the error
    bearing    True if a quadrant is allowed
    """
    if bearing and (parts := QUADRANT.fullmatch(word)):
        acute = angle_of(line, parts[2], settings, refuse=refuse)
        if not 0.0 <= acute <= 90.0 * DEGREE * (1.0 + 1e-12):
            raise refuse(line, f"{line.code}: bearing {shown(word)} (expected a quadrant of 0 to 90 degrees)")
        south, west = parts[1].upper() == "S", parts[3].upper() == "W"
        from_north = 180.0 * DEGREE - acute if south else acute
        return 360.0 * DEGREE - from_north if west else from_north
    if settings.gons:
        return number_of(line, word, refuse) * GON
    if settings.decimal or re.fullmatch(r"[+-]?[0-9]+", word):
        return number_of(line, word, refuse) * DEGREE
    if NUMBER.fullmatch(word):
        choice = "expected degrees-minutes-seconds, or .UNITS DD above it for decimal degrees"
        raise refuse(line, f"{line.code}: angle {shown(word)} could be decimal or packed ({choice})")
    parts = DMS.fullmatch(word)
    if parts is None or float(parts[3]) >= 60.0 or float(parts[4] or 0.0) >= 60.0:
        raise refuse(line, f"{line.code}: angle {shown(word)} (expected degrees-minutes-seconds, ' and \" below 60)")
    size = (float(parts[2]) + float(parts[3]) / 60.0 + float(parts[4] or 0.0) / 3600.0) * DEGREE
    return -size if parts[1] == "-" else size


def set_option(settings: StarnetSettings, line: StarnetLine, refuse: Refuse) -> None:
    """Apply an option line, which begins with a point; an unknown one is refused by name."""
    word, values = line.code[1:], [value.upper() for value in line.words[1:]]
    if word == "CATSEYE":
        _set_defaults(settings, line, refuse)
        return
    matching = [o for o in (*OPTIONS, *SHAPING) if o == word or (len(word) >= SHORTEST and o.startswith(word))]
    if len(matching) != 1:
        names = " ".join(f".{o}" for o in OPTIONS[:-1])
        raise refuse(line, f"{shown(line.text)} is not known here (expected one of {names})")
    name = matching[0]
    if name == "UNITS":
        _set_units(settings, line, values, refuse)
    elif name == "ORDER":
        _set_order(settings, line, values, refuse)
    elif name in ("DELTA", "DATA"):
        if values not in (["ON"], ["OFF"]):
            raise refuse(line, f".{name} {shown(' '.join(values))} (expected ON or OFF)")
        setattr(settings, name.lower(), values == ["ON"])
    elif name in ("2D", "3D"):
        settings.three_d = name == "3D"
    elif name == "SEPARATOR":
        if len(values) > 1 or (values and len(values[0]) != 1):
            raise refuse(line, f".SEPARATOR {shown(' '.join(values))} (expected one character)")
        settings.separator = line.words[1] if values else "-"
    elif name == "MULTIPLIER":
        settings.multiplier = number_of(line, values[0], refuse) if values else 1.0
        if settings.multiplier <= 0.0:
            raise refuse(line, f".MULTIPLIER {shown(values[0])} (expected above 0)")
    elif name == "INSTRUMENT":
        settings.instrument = " ".join(line.words[1:])
    elif name == "REFRACTION":
        value = number_of(line, values[0], refuse) if len(values) == 1 else 0.0
        if len(values) != 1 or settings.refraction not in (None, value):
            raise refuse(line, f"{shown(line.text)} (expected one coefficient for the whole file)")
        settings.refraction = value


def _set_units(settings: StarnetSettings, line: StarnetLine, values: list[str], refuse: Refuse) -> None:
    if not values:  # back to the defaults
        settings.unit, settings.gons, settings.decimal = 1.0, False, False
    for value in values:
        if value in UNITS:
            settings.unit = UNITS[value]
        elif value in ("DMS", "GONS", "DD"):
            settings.gons, settings.decimal = value == "GONS", value == "DD"
        else:
            raise refuse(line, f".UNITS {shown(value)} (expected {' '.join(UNITS)}, DMS, GONS or DD)")


def _set_order(settings: StarnetSettings, line: StarnetLine, values: list[str], refuse: Refuse) -> None:
    for value in values:
        if value in ("NE", "EN"):
            settings.north_first = value == "NE"
        elif value in ("ATFROMTO", "FROMATTO"):
            settings.at_from_to = value == "ATFROMTO"
        else:
            raise refuse(line, f".ORDER {shown(value)} (expected NE, EN, ATFROMTO or FROMATTO)")


def _set_defaults(settings: StarnetSettings, line: StarnetLine, refuse: Refuse) -> None:
    for part in filter(None, (part.strip() for part in line.words[1].split(","))):
        key, _, value = (word.strip() for word in part.partition("="))
        if key not in DEFAULT_KEYS or not NUMBER.fullmatch(value) or float(value) <= 0.0:
            raise refuse(line, f"# catseye: {shown(part)} (expected {', '.join(DEFAULT_KEYS)} = a number above 0)")
        settings.defaults[key] = float(value)
