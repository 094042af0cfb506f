"""Checked XML tree of a .gkf file with line numbers; anything outside Gama's schema is refused."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.records.files.refusal import NUMBER, refusal, shown

GON = 0.9 * DEGREE
NAMESPACE = "http://www.gnu.org/software/gama/gama-local"
SEXAGESIMAL = re.compile(r"([+-]?)([0-9]+)-([0-9]+)-([0-9]+(?:\.[0-9]*)?)")
MOST_DEEP = 10  # nested elements; the schema needs 5

OBSERVATIONS = ("direction", "distance", "angle", "s-distance", "z-angle", "azimuth")
CHILDREN: dict[str, tuple[str, ...]] = {
    "gama-local": ("network",),
    "network": ("description", "parameters", "points-observations"),
    "points-observations": ("point", "obs", "coordinates", "height-differences", "vectors"),
    "obs": (*OBSERVATIONS, "cov-mat"),
    "height-differences": ("dh", "cov-mat"),
    "coordinates": ("point", "cov-mat"),
    "vectors": ("vec", "cov-mat"),
}
TO = ("to", "val"), ("stdev", "from_dh", "to_dh", "extern")
FROM_TO = ("to", "val"), ("from", "stdev", "from_dh", "to_dh", "extern")
ATTRIBUTES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # required, optional
    "gama-local": ((), ("xmlns", "version")),
    "network": ((), ("axes-xy", "angles", "epoch")),
    "description": ((), ()),
    "parameters": (
        (),
        (
            *("sigma-apr", "conf-pr", "tol-abs", "sigma-act", "update-constrained-coordinates", "algorithm"),
            *("language", "encoding", "angles", "latitude", "ellipsoid", "cov-band"),
        ),
    ),
    "points-observations": (
        (),
        ("distance-stdev", "direction-stdev", "angle-stdev", "zenith-angle-stdev", "azimuth-stdev"),
    ),
    "point": (("id",), ("x", "y", "z", "fix", "adj")),
    "obs": ((), ("from", "orientation", "from_dh")),
    "direction": TO,
    "distance": FROM_TO,
    "s-distance": FROM_TO,
    "z-angle": FROM_TO,
    "azimuth": FROM_TO,
    "angle": (("bs", "fs", "val"), ("from", "stdev", "from_dh", "bs_dh", "fs_dh", "extern")),
    "height-differences": ((), ()),
    "dh": (("from", "to", "val"), ("stdev", "dist", "extern")),
    "coordinates": ((), ()),
    "vectors": ((), ()),
    "vec": (("from", "to", "dx", "dy", "dz"), ("from_dh", "to_dh", "extern")),
    "cov-mat": (("dim", "band"), ()),
}
TEXT = ("description", "cov-mat")


@dataclass(eq=False)
class XmlElement:
    """Element of the file and the line where it starts."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["XmlElement"] = field(default_factory=list)
    text: str = ""

    @property
    def place(self) -> str:
        return f"line {self.line}"


def tree_of(raw: bytes, file: str) -> XmlElement:
    """Root of a .gkf file with only known elements and attributes; else InputError.

    raw    content of the file
    file   file name, for messages
    """
    if not raw.strip():
        raise refusal(file, f"holds {len(raw)} bytes and no text: empty")
    parser = expat.ParserCreate()
    stack = [XmlElement("", {}, 0)]

    def refuse(problem: str) -> InputError:
        return refusal(file, f"line {parser.CurrentLineNumber}, {problem}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        parent, element = stack[-1], XmlElement(tag, attributes, parser.CurrentLineNumber)
        _check(parent, element, refuse)
        if len(stack) > MOST_DEEP:
            raise refuse(f"<{tag}> is {len(stack)} elements deep (expected at most {MOST_DEEP})")
        parent.children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

    def text(data: str) -> None:
        if stack[-1].tag in TEXT:
            stack[-1].text += data
        elif data.strip():
            raise refuse(f"text {shown(data.strip())} in <{stack[-1].tag}> (expected elements only)")

    def doctype(name: str, *_: object) -> None:
        raise refuse(f"<!DOCTYPE {name}> (expected none: entities are not read)")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, doctype
    try:
        parser.Parse(raw, True)
    except expat.ExpatError as problem:
        message = expat.errors.messages.get(problem.code, str(problem))
        raise refusal(file, f"line {problem.lineno}, column {problem.offset + 1}, is not XML: {message}") from problem
    except (ValueError, LookupError) as problem:  # an encoding unknown to Python
        raise refusal(file, f"cannot be read as XML: {problem}") from problem
    root = stack[0].children[0]
    if len(root.children) != 1:
        raise refusal(file, f"holds {len(root.children)} networks (expected one)")
    return root


def _check(parent: XmlElement, element: XmlElement, refuse: Callable[[str], InputError]) -> None:
    tag = element.tag
    allowed = CHILDREN.get(parent.tag, ()) if parent.tag else ("gama-local",)
    if tag not in allowed:
        inside = f"in <{parent.tag}>" if parent.tag else "at the top"
        raise refuse(f"<{tag}> {inside} is not known (expected {' '.join(allowed) or 'no element'})")
    if parent.children and parent.children[-1].tag == "cov-mat":
        raise refuse(f"<{tag}> stands after <cov-mat> (expected before it)")
    must, may = ATTRIBUTES[tag]
    for name in element.attributes:
        if name not in must and name not in may:
            raise refuse(f"{tag}: {name} = {shown(element.attributes[name])} is not known ({' '.join((*must, *may))})")
    for name in must:
        if not element.attributes.get(name, "").strip():
            raise refuse(f"{tag}: {name} is missing (expected {' '.join(must)})")
    if element.attributes.get("xmlns", NAMESPACE) != NAMESPACE:
        raise refuse(f"xmlns = {shown(element.attributes['xmlns'])} (expected {NAMESPACE})")


def number_of(
    file: str, element: XmlElement, name: str, *, default: float | None = None, word: str | None = None
) -> float:
    """Attribute as a number; the default if absent.

    file      file name, for messages
    element   element with the attribute
    name      name of the attribute
    default   None makes the attribute required
    word      part of the attribute to convert; None for all
    """
    if name not in element.attributes and default is not None:
        return default
    text = (element.attributes.get(name, "") if word is None else word).strip()
    if not NUMBER.fullmatch(text):
        raise refusal(file, f"{element.place}, {element.tag}: {name} = {shown(text)} (expected a number)")
    return float(text)


def angle_of(file: str, element: XmlElement, name: str) -> tuple[float, bool]:
    """Attribute as an angle in rad, and True if written in degrees (57-32-28.428), else gon.

    >>> angle, degrees = angle_of("a.gkf", XmlElement("azimuth", {"val": "57-32-28.428"}, 1), "val")
    >>> round(angle / GON, 4), degrees
    (63.9347, True)
    """
    text = element.attributes[name].strip()
    parts = SEXAGESIMAL.fullmatch(text)
    if parts is None:
        return number_of(file, element, name) * GON, False
    minutes, seconds = float(parts[3]), float(parts[4])
    if minutes >= 60.0 or seconds >= 60.0:
        raise refusal(file, f"{element.place}, {element.tag}: {name} = {shown(text)} (expected ' and \" below 60)")
    size = (float(parts[2]) + minutes / 60.0 + seconds / 3600.0) * DEGREE
    return (-size if parts[1] == "-" else size), True


def band_matrix(file: str, element: XmlElement, rows: int) -> np.ndarray:
    """Symmetric matrix (rows, rows) of a <cov-mat>: upper band by rows, in the file's units.

    file      file name, for messages
    element   the <cov-mat>
    rows      number of observations
    """

    def refuse(problem: str) -> InputError:
        return refusal(file, f"{element.place}, cov-mat: {problem}")

    size = []
    for name in ("dim", "band"):
        if not re.fullmatch(r"[0-9]{1,6}", element.attributes[name].strip()):
            raise refuse(f"{name} = {shown(element.attributes[name])} (expected a whole number)")
        size.append(int(element.attributes[name]))
    dim, band = size
    if dim != rows:
        raise refuse(f"dim = {dim}, of {rows} observations (expected {rows})")
    if band >= dim:
        raise refuse(f"band = {band} (expected 0 to {dim - 1})")
    words = element.text.split()
    expected = dim * (band + 1) - band * (band + 1) // 2
    if len(words) != expected:
        raise refuse(f"holds {len(words)} values (expected {expected} for dim {dim}, band {band})")
    for word in words:
        if not NUMBER.fullmatch(word):
            raise refuse(f"{shown(word)} (expected a number)")
    row = np.repeat(np.arange(dim), np.minimum(band + 1, dim - np.arange(dim)))
    column = row + np.arange(len(row)) - np.searchsorted(row, row)
    matrix = np.zeros((dim, dim))
    matrix[row, column] = matrix[column, row] = np.array(words, dtype=float)
    return matrix
