"""STAR*NET data of a three-dimensional survey (.dat), by its manual.

Supported are the codes C and E (coordinates), A, D, V, DV, B, M, BM (observations), DB DN DM DE (direction sets), L
(levelling), and the options .UNITS .ORDER .DELTA .SEPARATOR .2D .3D .DATA .MULTIPLIER .REFRACTION .INSTRUMENT
(name only: its library is not in the file); others are refused by name, except options for the listing only.
Text after # is a comment, after ' a description.

Settings of a project file, absent in a .dat, are taken as: metres, degrees-minutes-seconds, north before east,
At-From-To, slope distance and zenith angle, three-dimensional. Standard errors are in the lines, in seconds (with GONS
in milligons) and the line's unit of length. Where they are missing or `&`, a comment must give them:

    # catseye: angle_arcsec = 2, zenith_arcsec = 3, distance_mm = 1, distance_ppm = 1.5

with direction_, azimuth_, zenith_, angle_arcsec, distance_mm + distance_ppm D, elevation_mm, from there on. There
are no other defaults. `!` holds a coordinate; on an observation it means 1e-7 m or 1e-9 rad. `*` frees a coordinate
and excludes an observation, which the network's description lists. A coordinate of C without standard errors is free.

The network is plane: no curvature, no refraction. `.REFRACTION k` turns both on, with the coefficient k, for the zenith
angles of the whole file; horizontal angles are at the mark, distances chords between the ends of the heights. A zenith
angle beyond half a turn is from the second face.

Source: [PARKER04] section 3.2.1 names the format.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.errors import InputError
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.network.names import name_key
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import NUMBER, refusal, shown
from catseye.records.network.claim import NO_CLAIM, RangeClaim
from catseye.records.network.draft import NetworkDraft
from catseye.records.network.kinds import LENGTHS, Row
from catseye.records.network.starnet_lines import (
    StarnetLine,
    StarnetSettings,
    angle_of,
    lines_of,
    number_of,
    set_option,
)

FIXED_LENGTH = 1e-7  # m, standard uncertainty of a `!` observation: negligible in a survey, numerically safe
FIXED_ANGLE = 1e-9  # rad
DEFAULTS = {  # observation -> the comment's key
    "angle": "angle_arcsec",
    "direction": "direction_arcsec",
    "azimuth": "azimuth_arcsec",
    "zenith_angle": "zenith_arcsec",
    "height_difference": "elevation_mm",
}
PROJECT_OPTIONS = {  # names in STAR*NET's project options, Instrument
    "angle_arcsec": "Angle",
    "direction_arcsec": "Direction",
    "azimuth_arcsec": "Azimuth / Bearing",
    "zenith_arcsec": "Zenith",
    "distance_mm": "Distance Constant and PPM",
    "elevation_mm": "Elev Diff Constant",
}
DISTANCES = ("slope_distance", "horizontal_distance")


def read_starnet(path: Path, claim: RangeClaim = NO_CLAIM) -> ObservationNetwork:
    """Network of a STAR*NET .dat file; InputError with the line for invalid or unknown input.

    path    the file
    claim   standard error of distances without one, until a comment in the file changes it

    Source: [STARNET04] chapter 5.
    """
    return starnet_network(Folder(path.parent).text(path.name), path.name, claim)


def starnet_network(text: str, file: str, claim: RangeClaim = NO_CLAIM) -> ObservationNetwork:
    """Network of the file's text.

    text    lines
    file    file name, for messages
    claim   as for `read_starnet`
    """
    reader = _Reader(file)
    for key, value in (("distance_mm", claim.mm), ("distance_ppm", claim.ppm)):
        if value is not None:
            reader.settings.defaults[key] = value
    for line in lines_of(text):
        reader.read(line)
    return reader.network()


class _Reader:
    def __init__(self, file: str) -> None:
        self.draft = NetworkDraft(file, implied=True)
        self.settings = StarnetSettings()
        self.coordinates: dict[str, dict[str, tuple[float, str, str]]] = {}
        self.written: dict[str, str] = {}  # key of a name -> first spelling
        self.sets: dict[str, int] = {}
        self.station, self.orientation = "", -1
        self.left_out: list[str] = []
        self.held: list[str] = []
        self.without: dict[str, list[str]] = {}  # places of observations without standard error, by the comment's key

    def refuse(self, line: StarnetLine, problem: str) -> InputError:
        return self.draft.refuse(line.place, problem)

    def read(self, line: StarnetLine) -> None:
        """Process one line, by its code."""
        if not self.settings.data and not line.code.startswith(".DAT"):
            return
        if line.code.startswith("."):
            set_option(self.settings, line, self.refuse)
        elif line.code in CODES:
            CODES[line.code](self, line)
        else:
            known = ", ".join(CODES)
            raise self.refuse(line, f"{shown(line.text)} is not known here (expected one of the codes {known})")

    def network(self) -> ObservationNetwork:
        """Network of all lines of the file."""
        if self.orientation >= 0:
            raise refusal(self.draft.file, f"ends within the direction set at {shown(self.station)} (expected DE)")
        if self.without:
            raise self._refuse_without()
        for key, values in self.coordinates.items():
            name = self.written[key]
            place = next(iter(values.values()))[2]
            xyz = [values[axis][0] if axis in values else np.nan for axis in "xyz"]
            self.draft.point(name, xyz, fixed=[values.get(a, (0, "", ""))[1] == "!" for a in "xyz"], place=place)
            for axis, (value, error, where) in values.items():
                if error not in ("!", "*"):
                    self.draft.observe(Row("coordinates", (name,), value, float(error), where, component=axis))
        notes = [(self.left_out, "take no part (*)"), (self.held, "are held to 1e-7 m or 1e-9 rad (!)")]
        self.draft.description = "; ".join(f"{', '.join(places)} {what}" for places, what in notes if places)
        if self.settings.refraction is not None:
            bent = {"refraction": self.settings.refraction, "curved": 1.0}
            rows = self.draft.rows
            self.draft.rows = [replace(row, constants=bent) if row.kind == "zenith_angle" else row for row in rows]
        return self.draft.network()

    def _refuse_without(self) -> InputError:
        """Error listing all missing standard errors, in the terms of STAR*NET's project options."""
        missing = [
            f"{PROJECT_OPTIONS[key]} ({len(places)} observation{'s' if len(places) > 1 else ''}, first {places[0]})"
            for key, places in self.without.items()
        ]
        named = f" or the .INSTRUMENT {shown(self.settings.instrument)}" if self.settings.instrument else ""
        keys = ", ".join(f"{key} = ..." for key in self.without)
        return refusal(
            self.draft.file,
            f"has no values for the project options{named}: {', '.join(missing)} (expected standard "
            f"errors in the lines, or above them the comment '# catseye: {keys}')",
        )

    def stations(self, line: StarnetLine, count: int) -> list[str]:
        """Names joined by the separator, in the order At-From-To whatever the file's."""
        words = line.words
        joined = words[1] if len(words) > 1 else ""
        names = joined.split(self.settings.separator)
        if len(names) != count or not all(names):
            form = self.settings.separator.join(["At", "From", "To"][3 - count :] if count > 1 else ["Station"])
            raise self.refuse(line, f"{line.code}: stations {shown(joined)} (expected {form})")
        if count == 3 and not self.settings.at_from_to:
            names = [names[1], names[0], names[2]]
        return names

    def place_coordinates(self, line: StarnetLine) -> None:
        """Process C: north, east, elevation; or E: elevation."""
        settings, words = self.settings, line.words
        axes = "z" if line.code == "E" else ("yx" if settings.north_first else "xy") + ("z" if settings.three_d else "")
        numbers = words[2:]
        if len(numbers) not in (len(axes), 2 * len(axes)):
            form = f"{len(axes)} coordinates and none or {len(axes)} standard errors"
            raise self.refuse(line, f"{line.code}: {len(numbers)} values (expected a name, {form})")
        errors = numbers[len(axes) :] or ["*"] * len(axes)
        self.written.setdefault(name_key(words[1]), words[1])
        point = self.coordinates.setdefault(name_key(words[1]), {})
        for axis, word, error in zip(axes, numbers, errors, strict=False):
            if axis in point:
                raise self.refuse(line, f"{axis} of {shown(words[1])} is in {point[axis][2]} already (expected once)")
            value = number_of(line, word, self.refuse) * settings.length
            if error not in ("!", "*"):
                sigma = number_of(line, error, self.refuse) * settings.length
                error = "!" if sigma == 0.0 else repr(sigma)  # a prior without error holds the coordinate
            point[axis] = (value, error, line.place)

    def measure(
        self, line: StarnetLine, ends: Sequence[str], kinds: Sequence[tuple[str, tuple[str, ...]]], first: int
    ) -> None:
        """Add observations from word `first` on, then all or no standard errors, then optionally HI/HT."""
        words = line.words[first:]
        if len(words) < len(kinds):
            form = " ".join(kind.replace("_", " ") for kind, _ in kinds)
            raise self.refuse(line, f"{line.code}: {len(words)} values (expected {form})")
        values, remainder = words[: len(kinds)], words[len(kinds) :]
        heights = (0.0, 0.0)
        if remainder and "/" in remainder[-1]:
            parts = remainder.pop().split("/")
            if len(parts) != 2:
                raise self.refuse(line, f"{line.code}: heights {shown('/'.join(parts))} (expected HI/HT)")
            heights = tuple(number_of(line, part, self.refuse) * self.settings.length for part in parts)  # type: ignore[assignment]
        if remainder and len(remainder) != len(kinds):
            form = f"none or {len(kinds)}, then perhaps HI/HT"
            raise self.refuse(
                line, f"{line.code}: {len(remainder)} standard errors {shown(' '.join(remainder))} (expected {form})"
            )
        errors = remainder or ["&"] * len(kinds)
        for (kind, points), word, error in zip(kinds, values, errors, strict=True):
            if word != "?":
                self._observe(line, kind, points or tuple(ends), word=word, error=error, heights=heights)

    def _observe(
        self,
        line: StarnetLine,
        kind: str,
        ends: tuple[str, ...],
        *,
        word: str,
        error: str,
        heights: tuple[float, float],
    ) -> None:
        length = kind in LENGTHS
        value = (
            number_of(line, word, self.refuse) * self.settings.length
            if length
            else angle_of(line, word, self.settings, refuse=self.refuse, bearing=kind == "azimuth")
        )
        if kind == "zenith_angle" and np.pi < value < 2.0 * np.pi:
            value = 2.0 * np.pi - value  # the second face
        if error == "*":
            self.left_out.append(f"{kind.replace('_', ' ')} of {line.place}")
            return
        u = self._standard_error(line, kind, error=error, value=value)
        claim = (0.0, 0.0, 1.0)
        if error == "&" and kind in DISTANCES:
            defaults = self.settings.defaults
            claim = (defaults.get("distance_mm", 0.0) * MILLIMETRE, defaults.get("distance_ppm", 0.0) * PPM, 1.0)
        heights = heights if kind in ("slope_distance", "zenith_angle", "height_difference") else (0.0, 0.0)
        parameters = {"orientation": self.orientation} if kind == "direction" else {}
        shifted = heights if any(heights) else ()
        unit = "" if length else "gon" if self.settings.gons else "deg"
        self.draft.observe(
            Row(
                kind=kind,
                ends=ends,
                value=value,
                u=u,
                place=line.place,
                heights=shifted,
                parameters=parameters,
                claim=claim,
                unit=unit,
            )
        )

    def _standard_error(self, line: StarnetLine, kind: str, *, error: str, value: float) -> float:
        length = kind in LENGTHS
        if error == "!":
            self.held.append(f"{kind.replace('_', ' ')} of {line.place}")
            return FIXED_LENGTH if length else FIXED_ANGLE
        if error != "&":
            unit = self.settings.length if length else self.settings.angle_error
            return number_of(line, error, self.refuse) * unit
        defaults = self.settings.defaults
        if kind in DISTANCES and ("distance_mm" in defaults or "distance_ppm" in defaults):
            return defaults.get("distance_mm", 0.0) * MILLIMETRE + defaults.get("distance_ppm", 0.0) * PPM * value
        key = DEFAULTS.get(kind, "distance_mm")
        if key not in defaults:
            self.without.setdefault(key, []).append(line.place)
            return FIXED_LENGTH  # never used: `network` refuses the file, all that is missing at once
        return defaults[key] * (MILLIMETRE if length else np.pi / 648_000.0)

    def _distance_and_height(self, ends: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
        """Kinds of observation between two points in a line, by the mode."""
        settings = self.settings
        if not settings.three_d:
            return [("horizontal_distance", ends)]
        if settings.delta:
            return [("horizontal_distance", ends), ("height_difference", ends)]
        return [("slope_distance", ends), ("zenith_angle", ends)]

    def angle(self, line: StarnetLine) -> None:
        self.measure(line, self.stations(line, 3), [("angle", ())], 2)

    def distance(self, line: StarnetLine) -> None:
        self.measure(line, self.stations(line, 2), [(self._distance_and_height(())[0][0], ())], 2)

    def vertical(self, line: StarnetLine) -> None:
        if not self.settings.three_d:
            raise self.refuse(line, "V: a vertical observation in two dimensions (expected .3D above it)")
        self.measure(line, self.stations(line, 2), [(self._distance_and_height(())[1][0], ())], 2)

    def distance_vertical(self, line: StarnetLine) -> None:
        ends = tuple(self.stations(line, 2))
        self.measure(line, ends, self._distance_and_height(ends), 2)

    def bearing(self, line: StarnetLine) -> None:
        self.measure(line, self.stations(line, 2), [("azimuth", ())], 2)

    def all_measures(self, line: StarnetLine) -> None:
        at, back, to = self.stations(line, 3)
        self.measure(line, (), [("angle", (at, back, to)), *self._distance_and_height((at, to))], 2)

    def bearing_measures(self, line: StarnetLine) -> None:
        ends = tuple(self.stations(line, 2))
        self.measure(line, ends, [("azimuth", ends), *self._distance_and_height(ends)], 2)

    def begin_set(self, line: StarnetLine) -> None:
        if self.orientation >= 0:
            raise self.refuse(line, f"DB: the set at {shown(self.station)} is still open (expected DE before it)")
        if len(line.words) != 2:
            raise self.refuse(line, f"DB: {shown(line.text)} (expected DB and one station)")
        self.station = line.words[1]
        self.sets[self.station] = self.sets.get(self.station, 0) + 1
        name = f"orientation {self.station} set {self.sets[self.station]}"
        self.orientation = self.draft.parameter(name, unit="rad")

    def in_set(self, line: StarnetLine) -> None:
        if self.orientation < 0:
            raise self.refuse(line, f"{line.code}: outside a direction set (expected DB before it)")
        if len(line.words) < 2:
            raise self.refuse(line, f"{line.code}: {shown(line.text)} (expected a station)")
        ends = (self.station, line.words[1])
        more = self._distance_and_height(ends) if line.code == "DM" else []
        self.measure(line, ends, [("direction", ends), *more], 2)

    def end_set(self, line: StarnetLine) -> None:
        if self.orientation < 0:
            raise self.refuse(line, "DE: no direction set is open (expected DB before it)")
        self.station, self.orientation = "", -1

    def level(self, line: StarnetLine) -> None:
        """L: height difference, length of the section, standard error.

        The length only matters for project defaults.
        """
        ends = tuple(self.stations(line, 2))
        words = line.words[2:]
        if len(words) == 3 and NUMBER.fullmatch(words[1]):
            words = [words[0], words[2]]
        elif len(words) != 1:
            raise self.refuse(line, f"L: {len(words)} values (expected height difference, length and standard error)")
        error = words[1] if len(words) == 2 else "&"
        self._observe(line, "height_difference", ends, word=words[0], error=error, heights=(0.0, 0.0))


CODES: dict[str, Callable[[_Reader, StarnetLine], None]] = {
    "C": _Reader.place_coordinates,
    "E": _Reader.place_coordinates,
    "A": _Reader.angle,
    "D": _Reader.distance,
    "V": _Reader.vertical,
    "DV": _Reader.distance_vertical,
    "B": _Reader.bearing,
    "M": _Reader.all_measures,
    "BM": _Reader.bearing_measures,
    "DB": _Reader.begin_set,
    "DN": _Reader.in_set,
    "DM": _Reader.in_set,
    "DE": _Reader.end_set,
    "L": _Reader.level,
}
