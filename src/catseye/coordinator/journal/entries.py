"""Entries of a journal: the run, and its events in order. No database here."""

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
EPOCH_START = "epoch-begun"  # name of the document that marks when an epoch's shots were taken out
EPOCH_RANGES = "epoch-ranges"  # of the one behind a solution: its ranges with residuals and corrections
LIVE_CHANGED = "live-changed"  # of the one that marks a change of the reduction: parameters, reference epoch
CLOCK_CORRECTED = "clock-corrected"  # of the one that marks a correction of the count of UTC, and its size


# JSON's types; a non-finite number is None
Json = None | bool | int | float | str | list["Json"] | dict[str, "Json"]


@dataclass(frozen=True, eq=False)
class AnsweredShot:
    """A shot and the reduction's answer.

    status, text    "used", "reference", "blocked" ... and the reason; empty if not reduced
    range_, u_range, misfit   m, NaN if there is none
    """

    shot: LiveShot
    status: str = ""
    text: str = ""
    range_: float = NAN
    u_range: float = NAN
    misfit: float = NAN

    @classmethod
    def of(cls, shot: LiveShot, answer: "ShotAnswer") -> "AnsweredShot":
        """The shot with an answer of `Live.shot`."""
        return cls(
            shot=shot,
            status=str(answer.status),
            text=answer.text,
            range_=answer.range_,
            u_range=answer.u_range,
            misfit=answer.misfit,
        )


@dataclass(frozen=True)
class SentCommand:
    """A line sent to a ranger and its first reply.

    Without a reply it is empty and `ok` None.

    ticks   of the reply, or of the present if there is none
    reply   its values, 200 characters of them; none of a buffer's
    """

    ticks: int
    ranger: str
    tid: int
    line: str
    reply: str = ""
    ok: bool | None = None


class StoredAnswer(TypedDict, total=False):
    """Stored answer of an epoch: `EpochAnswer` without covariance, JSON types.

    Empty if nothing was solved. Non-finite numbers are None; keys of dictionaries are text.
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
    reference: int


@dataclass(frozen=True, eq=False)
class EpochSolution:
    """Result of an epoch's solution, as plain values.

    A failed one is stored too, since it used up its shots.

    ticks        argument of `Live.begin`
    answer       empty if nothing was solved
    covariance   (n, n), in the answer's units, or None
    """

    ticks: int
    answer: StoredAnswer
    covariance: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, ticks: int, answer: object) -> "EpochSolution":
        """Solution from an epoch answer: any dataclass or mapping, or None.

        Its matrix `covariance` is stored separately, bit for bit; its `ranges` are a document of their own.

        Raises InputError for a value that JSON cannot hold.
        """
        if answer is None:
            return cls(ticks, {})
        values = dict(answer) if isinstance(answer, Mapping) else named_fields(answer)
        values.pop("ranges", None)
        matrix = values.get("covariance")
        if isinstance(matrix, np.ndarray) and matrix.ndim == 2:
            del values["covariance"]
            matrix = np.array(matrix, dtype=np.float64)
        else:
            matrix = None
        return cls(ticks, cast(StoredAnswer, plain(values, "answer")), matrix)

    @property
    def text(self) -> str:
        """The answer as JSON, keys sorted; equal texts are equal bits."""
        return json.dumps(self.answer, sort_keys=True, allow_nan=False, ensure_ascii=False)


def ranges_document(ticks: int, answer: object) -> "Document | None":
    """Document of an epoch's ranges; None for an answer without them."""
    ranges = getattr(answer, "ranges", None)
    if not ranges:
        return None
    return Document(ticks, EPOCH_RANGES, json.dumps(plain(ranges, EPOCH_RANGES), allow_nan=False))


@dataclass(frozen=True)
class Document:
    """A text of the run: a plan, a changed setting, a certificate."""

    ticks: int
    name: str
    text: str


Entry = AnsweredShot | LiveWeather | LivePosture | Happening | SentCommand | EpochSolution | Document
Item = Entry | LiveShot  # a bare shot is one without an answer


@dataclass(frozen=True, eq=False)
class Run:
    """Start of a run of the coordinator.

    site       its records
    settings   that affect an answer, in JSON's types
    seed       of a simulated site; None at a real one
    extra      further files, text by relative path, stored with the site's
    uuid       of the run
    """

    site: SiteFolder
    settings: Mapping[str, object] = field(default_factory=dict)
    seed: int | None = None
    extra: Mapping[str, str] = field(default_factory=dict)
    uuid: str = field(default_factory=lambda: str(uuid.uuid4()))

    def files(self) -> dict[str, str]:
        """The site's files by relative path, unchanged, or rewritten if changed since."""
        return {path: self._as_read(path) or text for path, text in site_files(self.site).items()} | dict(self.extra)

    def _as_read(self, path: str) -> str | None:
        try:
            raw = (self.site.directory / path).read_bytes()
        except OSError:
            return None
        return raw.decode("utf-8") if hashlib.sha256(raw).hexdigest() == self.site.hashes.get(path) else None


def named_fields(value: object) -> dict[str, object]:
    """Fields of a dataclass by name, not copied."""
    if not is_dataclass(value) or isinstance(value, type):
        raise InputError(f"solution of type {type(value).__name__} (expected a dataclass or a mapping)")
    return {item.name: getattr(value, item.name) for item in fields(value)}


def plain(value: object, place: str) -> Json:
    """A value in JSON types; non-finite numbers become None.

    place   its name, for messages

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
