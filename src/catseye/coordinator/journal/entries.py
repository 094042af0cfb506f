"""What a journal holds: the run, and in one order all that happened in it. No database here."""

import hashlib
import json
import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from catseye.errors import InputError
from catseye.records.night.live import Happening, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import SiteFolder, site_files

if TYPE_CHECKING:
    from catseye.reduction.live.shots import ShotAnswer

NAN = float("nan")
EPOCH_BEGUN = "epoch-begun"  # name of the document that says when an epoch's shots were taken out
CLOCK_CORRECTED = "clock-corrected"  # of the one that says when the count of UTC was corrected, and by how much


# JSON's own types; what is no finite number is None
Json = None | bool | int | float | str | list["Json"] | dict[str, "Json"]


@dataclass(frozen=True, eq=False)
class AnsweredShot:
    """A shot and what the reduction said of it.

    status, text    "used", "reference", "blocked" ... and why; empty where it was not asked
    range_, u_range, misfit   m, NaN where it gave none
    """

    shot: LiveShot
    status: str = ""
    text: str = ""
    range_: float = NAN
    u_range: float = NAN
    misfit: float = NAN

    @classmethod
    def of(cls, shot: LiveShot, answer: "ShotAnswer") -> "AnsweredShot":
        """The shot with the answer that `Live.shot` gave."""
        return cls(shot, str(answer.status), answer.text, answer.range_, answer.u_range, answer.misfit)


@dataclass(frozen=True)
class SentCommand:
    """A line sent to a ranger and its first reply; a reply that never came is empty and `ok` None.

    ticks   of the reply, or of now where none came
    reply   its values, 200 characters of them; none of a buffer's
    """

    ticks: int
    ranger: str
    tid: int
    line: str
    reply: str = ""
    ok: bool | None = None


class StoredAnswer(TypedDict, total=False):
    """An epoch's answer as a journal holds it: `EpochAnswer` without its covariance, in JSON's types.

    Empty where nothing was solved. What was no finite number is None; keys of dictionaries are text.
    """

    number: int
    ticks: int
    azimuth: float
    elevation: float
    names: list[str]
    x: list[list[float]]
    shots: list[int]
    used: list[int]
    rejected: dict[str, str]
    variance_factor: float | None
    degrees_of_freedom: float | None
    refractivity_ppm: float | None
    air: dict[str, list[float]]
    zeros: dict[str, list[float]]
    pose: dict[str, Json] | None
    notes: list[str]
    jitter_mm: dict[str, float]
    doubts: list[str]
    biases: dict[str, dict[str, Json]]
    returned: list[dict[str, Json]]


@dataclass(frozen=True, eq=False)
class EpochSolution:
    """What an epoch's solving gave, as plain values; one that gave nothing is kept too, since it used up its shots.

    ticks        the time that `Live.begin` was asked for
    answer       empty where nothing was solved
    covariance   (n, n), in the answer's units, or None
    """

    ticks: int
    answer: StoredAnswer
    covariance: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, ticks: int, answer: object) -> "EpochSolution":
        """An epoch answer, any dataclass or mapping, or None; its matrix `covariance` is kept apart, bit for bit.

        Raises InputError for a value that JSON cannot hold.
        """
        if answer is None:
            return cls(ticks, {})
        values = dict(answer) if isinstance(answer, Mapping) else named_fields(answer)
        matrix = values.get("covariance")
        if isinstance(matrix, np.ndarray) and matrix.ndim == 2:
            del values["covariance"]
            matrix = np.array(matrix, dtype=np.float64)
        else:
            matrix = None
        return cls(ticks, cast(StoredAnswer, plain(values, "answer")), matrix)

    @property
    def text(self) -> str:
        """The answer as JSON, keys sorted: two answers are the same to the last bit where this is."""
        return json.dumps(self.answer, sort_keys=True, allow_nan=False, ensure_ascii=False)


@dataclass(frozen=True)
class Document:
    """A text that belongs to the run: a plan, a setting changed under way, a certificate."""

    ticks: int
    name: str
    text: str


Entry = AnsweredShot | LiveWeather | LivePosture | Happening | SentCommand | EpochSolution | Document
Item = Entry | LiveShot  # a bare shot is one without an answer


@dataclass(frozen=True, eq=False)
class Run:
    """What a run of the coordinator starts from.

    site       what stands there
    settings   of everything that decides an answer, in JSON's own types
    seed       of a simulated site; None at a real one
    extra      further files, text by relative path, kept beside the site's
    uuid       the run's own name in the world
    """

    site: SiteFolder
    settings: Mapping[str, object] = field(default_factory=dict)
    seed: int | None = None
    extra: Mapping[str, str] = field(default_factory=dict)
    uuid: str = field(default_factory=lambda: str(uuid.uuid4()))

    def files(self) -> dict[str, str]:
        """The site's files by relative path, each as it was read; one that has changed since is written anew."""
        return {path: self._as_read(path) or text for path, text in site_files(self.site).items()} | dict(self.extra)

    def _as_read(self, path: str) -> str | None:
        try:
            raw = (self.site.directory / path).read_bytes()
        except OSError:
            return None
        return raw.decode("utf-8") if hashlib.sha256(raw).hexdigest() == self.site.hashes.get(path) else None


def named_fields(value: object) -> dict[str, object]:
    """The fields of a dataclass by name, not copied."""
    if not is_dataclass(value) or isinstance(value, type):
        raise InputError(f"solution of type {type(value).__name__} (expected a dataclass or a mapping)")
    return {each.name: getattr(value, each.name) for each in fields(value)}


def plain(value: object, place: str) -> Json:
    """A value in JSON's own types; what is no finite number becomes None.

    place   its name, for the refusal

    >>> plain({"x": np.array([1.0, np.nan]), "n": (np.int64(3),)}, "answer")
    {'x': [1.0, None], 'n': [3]}
    """
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist(), place)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{place}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{place}[{at}]") for at, item in enumerate(value)]
    if is_dataclass(value) and not isinstance(value, type):
        return plain(named_fields(value), place)
    raise InputError(f"{place} is a {type(value).__name__}, which JSON cannot hold (expected numbers, text, lists)")
