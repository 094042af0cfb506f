"""Star offsets as TPOINT text: places of sources, and encoder readings on them.

Format: docs/formats/star-offsets.md. Angles become radians; azimuth is clockwise from north.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.constants import DEGREE
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import NUMBER, refusal, shown

COMMENT, OPTION, END = "!", ":", "END"
MARK = "! azimuth clockwise from north and elevation in degrees: of the source, then of the encoders"  # of our files
LARGEST_OFFSET = 5.0 * DEGREE  # largest difference of sky and encoders; more indicates another column order or unit


@dataclass(frozen=True, eq=False)
class StarOffsets:
    """Observed sources of an altazimuth telescope, one per row, as read-only columns.

    file                 name, for messages
    caption              first line
    options              words after the colons, such as NODA
    latitude             rad
    run                  words of the run's line after the latitude, unchanged: date, weather, ...
    azimuth, elevation   (n,) rad, of the source on the sky, refracted ("observed place")
    azimuth_encoder, elevation_encoder   (n,) rad, encoder readings with the beam on the source
    auxiliary            (n, k) further readings of each line, in their own units
    line                 (n,) line number in the file
    digest               SHA-256 of the file, "" without one
    """

    file: str
    caption: str
    options: tuple[str, ...]
    latitude: float
    run: tuple[str, ...]
    azimuth: np.ndarray
    elevation: np.ndarray
    azimuth_encoder: np.ndarray
    elevation_encoder: np.ndarray
    auxiliary: np.ndarray
    line: tuple[int, ...]
    digest: str

    def __len__(self) -> int:
        return len(self.azimuth)

    @property
    def correction(self) -> np.ndarray:
        """Encoders minus sky, (n, 2) rad: azimuth (within half a turn) times cos E, and elevation."""
        across = (self.azimuth_encoder - self.azimuth + math.pi) % (2.0 * math.pi) - math.pi
        return np.column_stack([across * np.cos(self.elevation), self.elevation_encoder - self.elevation])


def read_star_offsets(path: Path | str) -> StarOffsets:
    """Star offsets of a TPOINT file; InputError names file, line, value and expectation."""
    path = Path(path)
    text = Folder(path.parent).text(path.name)
    return parsed(text, path.name, hashlib.sha256(path.read_bytes()).hexdigest())


def parsed(text: str, file: str, digest: str = "") -> StarOffsets:
    """Star offsets from the text of a file.

    text     complete
    file     file name, for messages
    digest   SHA-256, if known
    """
    lines = [(k, row.strip()) for k, row in enumerate(text.replace("\r\n", "\n").split("\n"), start=1)]
    numbered = [(k, row) for k, row in lines if row and not row.startswith(COMMENT)]
    if not numbered:
        raise refusal(file, "holds comments only (expected a caption line)")
    caption, remainder = numbered[0][1], numbered[1:]
    options = [(k, word) for k, row in remainder if row.startswith(OPTION) for word in row.lstrip(": ").split()]
    mount = _refuse_options(file, options)
    body = [(k, row) for k, row in remainder if not row.startswith(OPTION)]
    ends = [i for i, (_, row) in enumerate(body) if row.upper() == END]
    body = body[: ends[0]] if ends else body
    if not body:
        raise refusal(file, "has no line with the latitude (expected degrees, minutes, seconds after the options)")
    _refuse_missing_run(file, body)
    latitude, run = _run(file, *body[0])
    rows = [_numbers(file, k, row) for k, row in body[1:]]
    if not rows:
        raise refusal(file, "has no observations (expected lines of azimuth, elevation, azimuth, elevation, degrees)")
    width = len(rows[0])
    for (k, _), row in zip(body[1:], rows, strict=True):
        _refuse_row(file, k, row, width)
    table = np.array(rows)
    offsets = StarOffsets(
        file=file,
        caption=caption,
        options=tuple(word for _, word in options if word != mount),
        latitude=latitude,
        run=run,
        azimuth=table[:, 0] * DEGREE,
        elevation=table[:, 1] * DEGREE,
        azimuth_encoder=table[:, 2] * DEGREE,
        elevation_encoder=table[:, 3] * DEGREE,
        auxiliary=table[:, 4:],
        line=tuple(k for k, _ in body[1:]),
        digest=digest,
    )
    _refuse_far(offsets)
    return offsets


def _refuse_options(file: str, options: Sequence[tuple[int, str]]) -> str:
    """Mount option; InputError for an equatorial telescope."""
    for k, word in options:
        if word.upper() == "EQUAT":
            raise refusal(file, f"line {k}, option EQUAT is an equatorial mount (expected ALTAZ)")
    mounts = [word for _, word in options if word.upper() == "ALTAZ"]
    if not mounts:
        raise refusal(file, "has no option ': ALTAZ' (expected it: without, the columns are hour angles, declinations)")
    return mounts[0]


def _refuse_missing_run(file: str, body: Sequence[tuple[int, str]]) -> None:
    """Raise InputError if the line in the place of the latitude is an observation."""
    (line, row), words = body[0], body[0][1].split()
    if len(body) < 2 or len(words) != len(body[1][1].split()) or not all(NUMBER.fullmatch(word) for word in words):
        return
    a, e, b, f = ([float(word) for word in words] + [math.inf] * 4)[:4]
    if math.hypot((b - a + 180.0) % 360.0 - 180.0, f - e) * DEGREE <= LARGEST_OFFSET:
        raise refusal(
            file,
            f"line {line}, {shown(row)} is an observation like those below it: the line with the latitude is missing "
            "(expected degrees minutes seconds after the options)",
        )


def _run(file: str, line: int, row: str) -> tuple[float, tuple[str, ...]]:
    """Latitude, rad, from degrees, minutes, seconds; words after it."""
    words = row.split()
    if len(words) < 3 or not all(NUMBER.fullmatch(w) for w in words[:3]):
        raise refusal(file, f"line {line}, {shown(row)} (expected the latitude: degrees minutes seconds)")
    degrees, minutes, seconds = (float(w) for w in words[:3])
    if degrees % 1.0 or minutes % 1.0:
        raise refusal(file, f"line {line}, latitude {' '.join(words[:3])} (expected whole degrees, minutes; seconds)")
    if not (abs(degrees) <= 90.0 and 0.0 <= minutes < 60.0 and 0.0 <= seconds < 60.0):
        raise refusal(file, f"line {line}, latitude {' '.join(words[:3])} (expected -90 to 90, 0 to 60, 0 to 60)")
    size = abs(degrees) + minutes / 60.0 + seconds / 3600.0
    if size > 90.0:
        raise refusal(file, f"line {line}, latitude {' '.join(words[:3])} is beyond the pole (expected -90 to 90)")
    return (-size if words[0].startswith("-") else size) * DEGREE, tuple(words[3:])


def _numbers(file: str, line: int, row: str) -> list[float]:
    words = row.split()
    for word in words:
        if not NUMBER.fullmatch(word):
            raise refusal(file, f"line {line}, {shown(word)} is not a number (expected numbers, ! before a comment)")
    return [float(word) for word in words]


def _refuse_row(file: str, line: int, row: Sequence[float], width: int) -> None:
    if len(row) < 4 or len(row) != width:
        expected = "4 or more: azimuth, elevation, azimuth, elevation" if width < 4 else f"{width} as in the first"
        raise refusal(file, f"line {line} has {len(row)} numbers (expected {expected})")
    for value, name, low, high in zip(row, ("azimuth", "elevation") * 2, (-540, -5) * 2, (540, 95) * 2, strict=False):
        if not low <= value <= high:
            raise refusal(file, f"line {line}, {name} = {value} (expected {low} to {high} degrees)")


def _refuse_far(offsets: StarOffsets) -> None:
    size = np.hypot(*offsets.correction.T)
    worst = int(np.argmax(size))
    if size[worst] > LARGEST_OFFSET:
        raise refusal(
            offsets.file,
            f"line {offsets.line[worst]}, sky and encoders are {size[worst] / DEGREE:.2f} degrees apart (expected up "
            f"to {LARGEST_OFFSET / DEGREE:g}: azimuth clockwise from north in both pairs)",
        )


def star_offsets_text(offsets: StarOffsets) -> str:
    """Star offsets as TPOINT text, angles in degrees to 1e-7, 0.4 milliarcseconds."""
    total = round(abs(offsets.latitude) / DEGREE * 36_000.0)
    sign = "-" if offsets.latitude < 0.0 else ""
    place = f"{sign}{total // 36_000:02d} {total % 36_000 // 600:02d} {total % 600 / 10:04.1f}"
    head = [
        offsets.caption,
        ": ALTAZ",
        *(f": {word}" for word in offsets.options),
        " ".join([place, *offsets.run]),
        MARK,
    ]
    angles = np.column_stack(
        [offsets.azimuth, offsets.elevation, offsets.azimuth_encoder, offsets.elevation_encoder]
    ) / DEGREE  # fmt: skip
    rows = [
        " ".join([*(f"{v:12.7f}" for v in row), *(f"{v:.9g}" for v in more)])
        for row, more in zip(angles, offsets.auxiliary, strict=True)
    ]
    return "\n".join([*head, *rows, END]) + "\n"
