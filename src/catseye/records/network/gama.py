"""GNU Gama's description of a local network in XML (.gkf), by its documentation and schema 1.00.

Lengths are in metres, their stdev in mm. Angles are in gon with stdev in cc (1e-4 gon), or written ddd-mm-ss.s with
stdev in arcseconds; both may occur in one file. A stdev is the a-priori sigma whatever `sigma-apr` is, which is used
only where a levelled section has its length instead of a stdev: sigma-apr sqrt(km) mm. A cov-mat overrides stdevs.

x points along the first letter of `axes-xy`, y along the second. `angles="left-handed"` are clockwise.
Fixed coordinates are held. Upper case in `adj` makes coordinates part of the inner constraints of a free network,
relative to those of the file, if given there. Coordinates of neither kind are held where the file
gives them and otherwise absent; an observation that depends on either is refused (Gama omits it
silently). Heights of instruments are along the plumb line:
no curvature, no refraction; a file that asks for an ellipsoid is refused.
"""

from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.network.names import name_key
from catseye.records.files.refusal import refusal, shown, unreadable
from catseye.records.network.draft import NetworkDraft
from catseye.records.network.gama_xml import GON, XmlElement, angle_of, band_matrix, number_of, tree_of
from catseye.records.network.kinds import Row

CC = 1e-4 * GON
DIRECTIONS = {"n": (0.0, 1.0), "s": (0.0, -1.0), "e": (1.0, 0.0), "w": (-1.0, 0.0)}  # east, north
AXES = ("ne", "sw", "es", "wn", "en", "nw", "se", "ws")
KINDS = {
    "direction": "direction",
    "distance": "horizontal_distance",
    "angle": "angle",
    "s-distance": "slope_distance",
    "z-angle": "zenith_angle",
    "azimuth": "azimuth",
    "dh": "height_difference",
}
IMPLIED_STDEV = {"direction": "direction", "angle": "angle", "z-angle": "zenith-angle", "azimuth": "azimuth"}
NEEDS = {"direction": "xy", "distance": "xy", "angle": "xy", "azimuth": "xy", "dh": "z"}  # default: all three
CASES = ("xy", "XY", "z", "Z", "xyz", "XYZ", "XYz", "xyZ")
SIGMA_APR = 10.0  # Gama's default


def read_gama(path: Path) -> ObservationNetwork:
    """Network of a .gkf file, in the axes of this package; InputError if invalid.

    path   the file

    Source: [GAMA18] chapter XML input data format.
    """
    try:
        raw = path.read_bytes()
    except OSError as problem:
        raise unreadable(path.name, problem) from problem
    return gama_network(raw, path.name)


def gama_network(raw: bytes, file: str) -> ObservationNetwork:
    """Network of the file's content.

    raw    XML, in its stated encoding
    file   file name, for messages
    """
    network = tree_of(raw, file).children[0]
    _check_parameters(network, file)
    draft = NetworkDraft(file, axes=axes_of(network, file))
    draft.description = "\n".join(e.text.strip() for e in network.children if e.tag == "description")
    sections = [element for element in network.children if element.tag == "points-observations"]
    reader = _Reader(draft, network)
    for section in sections:
        for element in section.children:
            for point in [element] if element.tag == "point" else element.children:
                if point.tag == "point":
                    reader.note_point(point, observed=element.tag == "coordinates")
    reader.add_points()
    for section in sections:
        for element in section.children:
            if element.tag == "coordinates":
                reader.coordinates(element)
            elif element.tag == "vectors":
                reader.vectors(element)
            elif element.tag != "point":
                reader.set_of(element, section)
    return draft.network()


def axes_of(network: XmlElement, file: str) -> np.ndarray:
    """Matrix (3, 3) from coordinates of the file to east, north, up."""
    name = network.attributes.get("axes-xy", "ne")
    if name not in AXES:
        raise refusal(file, f"{network.place}, axes-xy = {shown(name)} (expected {' '.join(AXES)})")
    axes = np.eye(3)
    axes[:2, :2] = np.transpose([DIRECTIONS[letter] for letter in name])
    return axes


def _check_parameters(network: XmlElement, file: str) -> None:
    """Raise InputError for parameters that would change the result but are not supported."""
    for element in network.children:
        if element.tag != "parameters":
            continue
        if "ellipsoid" in element.attributes:
            value = shown(element.attributes["ellipsoid"])
            raise refusal(file, f"{element.place}, ellipsoid = {value} (expected none: a local plane network)")
        if element.attributes.get("sigma-act", "apriori") not in ("apriori", "aposteriori"):
            value = shown(element.attributes["sigma-act"])
            raise refusal(file, f"{element.place}, sigma-act = {value} (expected apriori or aposteriori)")


class _Reader:
    """Converter of elements to a draft, with the network's attributes and points."""

    def __init__(self, draft: NetworkDraft, network: XmlElement) -> None:
        self.draft, self.network = draft, network
        sense = network.attributes.get("angles", "left-handed")
        if sense not in ("left-handed", "right-handed"):
            raise self.refuse(network, f"angles = {shown(sense)} (expected left-handed or right-handed)")
        self.clockwise = 1.0 if sense == "left-handed" else -1.0
        self.points: dict[str, dict[str, Any]] = {}
        self.sets: dict[str, int] = {}
        self.sigma_apr = SIGMA_APR
        for element in network.children:
            if element.tag == "parameters" and "sigma-apr" in element.attributes:
                self.sigma_apr = self.number(element, "sigma-apr")
                if self.sigma_apr <= 0.0:
                    raise self.refuse(element, f"sigma-apr = {self.sigma_apr:.6g} (expected above 0)")

    def refuse(self, element: XmlElement, problem: str) -> InputError:
        return self.draft.refuse(element.place, f"{element.tag}: {problem}")

    def number(self, element: XmlElement, name: str, default: float | None = None) -> float:
        return number_of(self.draft.file, element, name, default=default)

    def note_point(self, element: XmlElement, *, observed: bool) -> None:
        """Record coordinates and status of a point, given in parts but each only once."""
        name = element.attributes["id"]
        point = self.points.setdefault(name_key(name), {"place": element.place, "name": name})
        if ("x" in element.attributes) != ("y" in element.attributes):
            raise self.refuse(element, f"{shown(name)} has one of x and y (expected both or none)")
        for key in ("x", "y", "z"):
            if key in element.attributes and not (observed and key in point):
                self._refuse_repeated(element, name, key)
                point[key] = self.number(element, key)
        for key in ("adj", "fix"):
            case = element.attributes.get(key, "").strip()
            if case and case not in CASES:
                raise self.refuse(element, f"{key} = {shown(case)} (expected {' '.join(CASES)})")
            for letter in case:
                status = "fix" if key == "fix" else "adj" if letter.islower() else "ADJ"
                if key == "fix" or point.get(f"is {letter.lower()}") != "fix":  # fix overrides adj
                    point[f"is {letter.lower()}"] = status

    def _refuse_repeated(self, element: XmlElement, name: str, key: str) -> None:
        if key in self.points[name_key(name)]:
            first = self.points[name_key(name)]["place"]
            raise self.refuse(element, f"{shown(name)} has its {key} in {first} already (expected each name once)")

    def add_points(self) -> None:
        for point in self.points.values():
            xyz = [point.get(key, np.nan) for key in "xyz"]
            status = [point.get(f"is {key}") for key in "xyz"]
            fixed = [s == "fix" or (s is None and not np.isnan(v)) for s, v in zip(status, xyz, strict=True)]
            datum = [s == "ADJ" and not np.isnan(value) for s, value in zip(status, xyz, strict=True)]
            self.draft.point(point["name"].strip(), xyz, fixed=fixed, datum=datum, place=point["place"])

    def need(self, element: XmlElement, name: str, axes: str) -> str:
        """Point name; InputError unless all coordinates used by the observation have a status."""
        for axis in axes:
            if f"is {axis}" not in self.points.get(name_key(name), {f"is {axis}": ""}):
                raise self.refuse(element, f"needs {axis} of {shown(name)}, which is neither fix nor adj there")
        return name

    def set_of(self, element: XmlElement, section: XmlElement) -> None:
        """Add rows of <obs> and <height-differences>, with covariance if given."""
        start, scales = len(self.draft.rows), []
        matrix = next((child for child in element.children if child.tag == "cov-mat"), None)
        orientation = -1
        for child in element.children:
            if child.tag == "cov-mat":
                continue
            if child.tag == "direction" and orientation < 0:
                orientation = self._orientation(element)
            scales.append(self._row(child, element, section, orientation=orientation, has_matrix=matrix is not None))
        if matrix is not None:
            covariance = band_matrix(self.draft.file, matrix, len(scales)) * np.outer(scales, scales)
            self.draft.correlate(start, covariance, matrix.place)

    def _row(
        self, child: XmlElement, parent: XmlElement, section: XmlElement, *, orientation: int, has_matrix: bool
    ) -> float:
        """Add the row of one element; unit of its stdev, with the sign of its value."""
        attributes = child.attributes
        start = attributes.get("from", parent.attributes.get("from", "")).strip()
        if not start:
            raise self.refuse(child, "has no station (expected from, here or in obs)")
        targets = ("bs", "fs") if child.tag == "angle" else ("to",)
        ends = [start, *(attributes[name].strip() for name in targets)]
        for name in ends:
            self.need(child, name, NEEDS.get(child.tag, "xyz"))
        if child.tag in ("distance", "s-distance", "dh"):
            value, unit, turned, written = self.number(child, "val"), MILLIMETRE, 1.0, ""
        else:
            value, degrees = angle_of(self.draft.file, child, "val")
            written = "deg" if degrees else "gon"
            unit, turned = (ARCSECOND if degrees else CC), (1.0 if child.tag == "z-angle" else self.clockwise)
        if child.tag == "z-angle" and not 0.0 < value < np.pi:
            raise self.refuse(child, f"val = {shown(attributes['val'])} (expected the first face, below half a turn)")
        u = 1.0 if has_matrix else self._stdev(child, section, value) * unit
        heights = tuple(self.number(child, f"{name}_dh", 0.0) for name in targets)
        instrument = self.number(child, "from_dh", self.number(parent, "from_dh", 0.0))
        parameters = {"orientation": orientation} if child.tag == "direction" else {}
        claim = (0.0, 0.0, 1.0)
        if not has_matrix and "stdev" not in child.attributes and child.tag in ("distance", "s-distance"):
            a, b, c = self._distance_stdev(section)
            claim = (a * MILLIMETRE, b * MILLIMETRE * 1e-3**c, c)  # of a length in km
        row = Row(
            kind=KINDS[child.tag],
            ends=tuple(ends),
            value=turned * value,
            u=u,
            place=child.place,
            heights=(instrument, *heights),
            parameters=parameters,
            claim=claim,
            unit=written,
        )
        self.draft.observe(row)
        return unit * turned

    def _stdev(self, child: XmlElement, section: XmlElement, value: float) -> float:
        """Standard deviation in the file's unit: the element's, or the section's for its kind."""
        if "stdev" in child.attributes:
            return self.number(child, "stdev")
        if child.tag == "dh" and "dist" in child.attributes:
            return self.sigma_apr * self.number(child, "dist") ** 0.5
        if child.tag in ("distance", "s-distance") and "distance-stdev" in section.attributes:
            a, b, c = self._distance_stdev(section)
            return a + b * (value / 1000.0) ** c
        name = f"{IMPLIED_STDEV.get(child.tag, '')}-stdev"
        if name not in section.attributes:
            raise self.refuse(child, "has no stdev, and neither points-observations nor a cov-mat gives one")
        return self.number(section, name)

    def _distance_stdev(self, section: XmlElement) -> tuple[float, float, float]:
        """Terms a, b, c of a + b D^c, mm and km."""
        words = section.attributes["distance-stdev"].split()
        if not 1 <= len(words) <= 3:
            raise self.refuse(section, f"distance-stdev holds {len(words)} values (expected a, a b or a b c)")
        terms = [number_of(self.draft.file, section, "distance-stdev", word=word) for word in words]
        a, b, c = [*terms, *(0.0, 1.0)[len(terms) - 1 :]]
        return a, b, c

    def _orientation(self, element: XmlElement) -> int:
        """Parameter of a set's zero azimuth; `orientation` in the file is its bearing from the x axis."""
        station = element.attributes.get("from", "").strip()
        self.sets[station] = self.sets.get(station, 0) + 1
        start = 0.0
        if "orientation" in element.attributes:
            of_x = np.arctan2(self.draft.axes[0, 0], self.draft.axes[1, 0])
            start = float(of_x + self.clockwise * angle_of(self.draft.file, element, "orientation")[0])
        return self.draft.parameter(f"orientation {station} set {self.sets[station]}", start, unit="rad")

    def coordinates(self, element: XmlElement) -> None:
        start, turns = len(self.draft.rows), []
        for point in element.children:
            if point.tag != "point":
                continue
            name, axes = point.attributes["id"].strip(), [k for k in "xyz" if k in point.attributes]
            if not axes:
                raise self.refuse(point, f"{shown(name)} has no coordinates (expected x and y, or z, or all)")
            self.need(point, name, "".join(axes))
            at = ["xyz".index(k) for k in axes]
            turn = self.draft.axes[np.ix_(at, at)]
            self._components(point, "coordinates", (name,), turn @ [self.number(point, k) for k in axes], at)
            turns.append(turn)
        self._turned_covariance(element, start, turns)

    def vectors(self, element: XmlElement) -> None:
        start, turns = len(self.draft.rows), []
        for vec in element.children:
            if vec.tag != "vec":
                continue
            ends = (vec.attributes.get("from", "").strip(), vec.attributes["to"].strip())
            for name in ends:
                self.need(vec, name, "xyz")
            difference = np.array([self.number(vec, f"d{k}") for k in "xyz"])
            # the vector between marks: minus the target's height, plus the instrument's
            difference[2] += self.number(vec, "from_dh", 0.0) - self.number(vec, "to_dh", 0.0)
            self._components(vec, "vector", ends, self.draft.axes @ difference, [0, 1, 2])
            turns.append(self.draft.axes)
        self._turned_covariance(element, start, turns)

    def _components(
        self, element: XmlElement, kind: str, ends: tuple[str, ...], values: np.ndarray, axes: list[int]
    ) -> None:
        for value, axis in zip(values, axes, strict=True):
            self.draft.observe(Row(kind, ends, float(value), 1.0, element.place, component="xyz"[axis]))

    def _turned_covariance(self, element: XmlElement, start: int, turns: list[np.ndarray]) -> None:
        matrix = next((child for child in element.children if child.tag == "cov-mat"), None)
        size = sum(len(turn) for turn in turns)
        if matrix is None or not turns:
            raise self.refuse(element, f"has {size} values and no cov-mat (expected both)")
        turn, at = np.zeros((size, size)), 0
        for block in turns:
            turn[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        covariance = turn @ band_matrix(self.draft.file, matrix, size) @ turn.T
        self.draft.correlate(start, covariance * MILLIMETRE**2, matrix.place)
