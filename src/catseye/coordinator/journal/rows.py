"""Conversion of entries to table rows, and of samples to bytes."""

import json
import zlib
from collections.abc import Callable, Mapping

import numpy as np
import sqlalchemy
from numpy.typing import NDArray

from catseye.coordinator.journal.cells import json_object
from catseye.coordinator.journal.entries import AnsweredShot, Document, Entry, EpochSolution, Item, SentCommand
from catseye.errors import InputError
from catseye.records.night.live import Happening, LivePosture, LiveShot, LiveWeather

RAW, PACKED = 0, 1  # int16 little-endian as taken; or the differences from a cycle earlier, in two planes, deflated
LARGEST_INTEGER = 2**63 - 1
Samples = NDArray[np.int16]
Cell = None | bool | int | float | str | bytes | Samples
Row = dict[str, Cell]  # by column, for writing
StoredRow = sqlalchemy.Row[tuple[object, ...]]  # as read, with the table's columns as attributes
Rows = list[tuple[str, Row]]  # table's name, row without run and seq


def rows_of(item: Item, buffers: bool) -> Rows:
    """Rows of an entry; `pack` makes bytes of a shot's samples.

    buffers   True to store samples

    Raises InputError: not an entry, or a value that no column holds.
    """
    if isinstance(item, LiveShot):
        item = AnsweredShot(item)
    table, row = _row(item)
    if buffers and isinstance(item, AnsweredShot) and item.shot.samples is not None:
        samples = np.array(item.shot.samples, dtype="<i2")
        return [(table, row), ("buffers", {"samples": samples, "lag": int(item.shot.samples_per_cycle)})]
    return [(table, row)]


def _row(item: object) -> tuple[str, Row]:
    """Table and row of an entry, without a shot's samples.

    Raises InputError: not an entry.
    """
    if isinstance(item, AnsweredShot):
        return _shot(item)
    if isinstance(item, LiveWeather):
        return _weather(item)
    if isinstance(item, LivePosture):
        return _posture(item)
    if isinstance(item, SentCommand):
        return _command(item)
    if isinstance(item, Happening):
        return _happening(item)
    if isinstance(item, EpochSolution):
        return _solution(item)
    if isinstance(item, Document):
        return _document(item)
    raise InputError(f"a {type(item).__name__} cannot be journalled (expected a shot, reading, happening, ...)")


def _shot(item: AnsweredShot) -> tuple[str, Row]:
    shot = item.shot
    return "shots", {
        "number": _integer("shot number", shot.number),
        "ranger": _text(shot.ranger),
        "target": _text(shot.target),
        "ticks": _integer("shot ticks", shot.ticks),
        "cycles": _integer("cycles", shot.cycles),
        "samples_per_cycle": _integer("samples_per_cycle", shot.samples_per_cycle),
        "if_hz": _integer("if_hz", shot.if_hz),
        "volts_per_code": _number(shot.volts_per_code),
        "amplitude_v": _number(shot.amplitude),
        "phase_rad": _number(shot.phase),
        "status": _text(item.status),
        "text": _text(item.text),
        "range_m": _number(item.range_),
        "u_range_m": _number(item.u_range),
        "misfit_m": _number(item.misfit),
    }


def _weather(item: LiveWeather) -> tuple[str, Row]:
    return "weather", {
        "station": _text(item.station),
        "ticks": _integer("weather ticks", item.ticks),
        "temperature_c": _number(item.temperature_c),
        "pressure_hpa": _number(item.pressure_hpa),
        "humidity_percent": _number(item.humidity_percent),
    }


def _posture(item: LivePosture) -> tuple[str, Row]:
    return "postures", {
        "ticks": _integer("posture ticks", item.ticks),
        "azimuth_rad": _number(item.azimuth),
        "elevation_rad": _number(item.elevation),
        "azimuth_rate_rad_s": _number(item.azimuth_rate),
        "elevation_rate_rad_s": _number(item.elevation_rate),
    }


def _command(item: SentCommand) -> tuple[str, Row]:
    return "commands", {
        "ticks": _integer("command ticks", item.ticks),
        "ranger": _text(item.ranger),
        "tid": _integer("TID", item.tid),
        "line": _text(item.line),
        "reply": _text(item.reply),
        "ok": None if item.ok is None else bool(item.ok),
    }


def _happening(item: Happening) -> tuple[str, Row]:
    try:
        details = json.dumps({key: _detail(value) for key, value in item.details.items()}, ensure_ascii=False)
    except TypeError as problem:
        raise InputError(f"happening {item.kind!r} has a detail that JSON cannot hold: {problem}") from problem
    return "happenings", {
        "ticks": _integer("happening ticks", item.ticks),
        "who": _text(item.who),
        "kind": _text(item.kind),
        "severity": _text(item.severity),
        "text": _text(item.text),
        "details": _text(details),
    }


def _detail(value: object) -> object:
    """JSON value; a non-finite number becomes text that `float` reads."""
    plain = value.item() if isinstance(value, np.generic) else value
    return repr(plain) if isinstance(plain, float) and not np.isfinite(plain) else plain


def _solution(item: EpochSolution) -> tuple[str, Row]:
    matrix = item.covariance
    return "solutions", {
        "ticks": _integer("solution ticks", item.ticks),
        "answer": _text(item.text),
        "size": 0 if matrix is None else len(matrix),
        "covariance": None if matrix is None else np.ascontiguousarray(matrix, dtype="<f8").tobytes(),
    }


def _document(item: Document) -> tuple[str, Row]:
    return "documents", {
        "ticks": _integer("document ticks", item.ticks),
        "name": _text(item.name),
        "text": _text(item.text),
    }


def entry_of(table: str, row: StoredRow, samples: Samples | None = None) -> Entry:
    """Entry of a table's row.

    samples   of a shot, if stored
    """
    return READERS[table](row, samples)


def _read_shot(row: StoredRow, samples: Samples | None) -> AnsweredShot:
    shot = LiveShot(
        ranger=row.ranger,
        target=row.target,
        ticks=row.ticks,
        cycles=row.cycles,
        samples_per_cycle=row.samples_per_cycle,
        if_hz=row.if_hz,
        volts_per_code=_back(row.volts_per_code),
        samples=samples,
        amplitude=_back(row.amplitude_v),
        phase=_back(row.phase_rad),
        number=row.number,
    )
    return AnsweredShot(
        shot=shot,
        status=row.status,
        text=row.text,
        range_=_back(row.range_m),
        u_range=_back(row.u_range_m),
        misfit=_back(row.misfit_m),
    )


def _read_solution(row: StoredRow, _: object) -> EpochSolution:
    matrix = None
    if row.covariance is not None:
        matrix = np.frombuffer(row.covariance, dtype="<f8").reshape(row.size, -1 if row.size else 0)
    return EpochSolution(row.ticks, json_object(row.answer), matrix)


READERS: Mapping[str, Callable[[StoredRow, Samples | None], Entry]] = {
    "shots": _read_shot,
    "weather": lambda row, _: LiveWeather(
        row.station, row.ticks, _back(row.temperature_c), _back(row.pressure_hpa), _back(row.humidity_percent)
    ),
    "postures": lambda row, _: LivePosture(
        row.ticks,
        _back(row.azimuth_rad),
        _back(row.elevation_rad),
        _back(row.azimuth_rate_rad_s),
        _back(row.elevation_rate_rad_s),
    ),
    "commands": lambda row, _: SentCommand(
        ticks=row.ticks, ranger=row.ranger, tid=row.tid, line=row.line, reply=row.reply, ok=row.ok
    ),
    "happenings": lambda row, _: Happening(
        ticks=row.ticks,
        who=row.who,
        kind=row.kind,
        text=row.text,
        severity=row.severity,
        details=json_object(row.details),
    ),
    "solutions": _read_solution,
    "documents": lambda row, _: Document(row.ticks, row.name, row.text),
}


def pack(samples: Samples, lag: int, packing: int) -> Row:
    """Columns of a buffer: packing, CRC-32 of the original samples, bytes.

    samples   (n,) int16 little-endian
    lag       samples of a cycle: a sample is compared with one a cycle earlier
    packing   RAW or PACKED; packed is 0.5 to 0.65 of raw, 0.2 ms for 8192 samples

    >>> pack(np.arange(4, dtype="<i2"), 2, RAW)["samples"]
    b'\\x00\\x00\\x01\\x00\\x02\\x00\\x03\\x00'
    """
    raw = samples.tobytes()
    if packing == RAW:
        return {"packing": RAW, "crc32": zlib.crc32(raw), "samples": raw}
    differences = samples.copy()
    differences[lag:] -= samples[:-lag]  # wraps around, and back when undone
    planes = differences.view(np.uint8).reshape(-1, 2).T.tobytes()
    return {"packing": PACKED, "crc32": zlib.crc32(raw), "samples": zlib.compress(planes, 1)}


def unpack(row: StoredRow, lag: int, place: str) -> Samples:
    """Samples (n,) of a row of `buffers`.

    lag     samples of a cycle
    place   for messages

    Raises InputError if they fail the checksum.
    """
    problem = f"{place}: samples are damaged (expected CRC-32 {row.crc32:08x}); restore the journal from a copy"
    raw = row.samples
    if row.packing == PACKED:
        try:
            planes = np.frombuffer(zlib.decompress(raw), dtype=np.uint8)
        except zlib.error as why:
            raise InputError(problem) from why
        samples = np.ascontiguousarray(planes.reshape(2, -1).T).view("<i2").ravel()
        padded = np.zeros(-(-len(samples) // lag) * lag, dtype="<i2")
        padded[: len(samples)] = samples
        raw = np.cumsum(padded.reshape(-1, lag), axis=0, dtype="<i2").ravel()[: len(samples)].tobytes()
    if zlib.crc32(raw) != row.crc32:
        raise InputError(problem)
    return np.frombuffer(raw, dtype="<i2")


def _integer(name: str, value: int) -> int:
    if not -LARGEST_INTEGER <= value <= LARGEST_INTEGER:
        raise InputError(f"{name} = {value} does not fit 64 bits (expected a whole number within)")
    return int(value)


def _number(value: float) -> float | None:
    """A number, NULL for NaN, which SQLite cannot hold."""
    number = float(value)
    return None if number != number else number


def _back(value: float | None) -> float:
    return float("nan") if value is None else value


def _text(value: str) -> str:
    """Text without NUL and anything that UTF-8 cannot encode."""
    return value.replace("\0", "\\x00").encode("utf-8", "backslashreplace").decode("utf-8")
