"""Shots of a journal: lists, one with its chain of numbers, its samples and what was detected in them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from sqlalchemy import text

from catseye.constants import MILLIMETRE, SECONDS_PER_DAY
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.rows import unpack
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.reduction.live.ranges import range_steps
from catseye.service.watch.calibrations import mirror_certificate
from catseye.service.watch.entries import SHOT, Object, columns, mjd_of, number, numbers, words
from catseye.service.watch.epochs import EpochRecord
from catseye.service.watch.history import History, require_limit, shot_object
from catseye.service.watch.index import first_seq, limits
from catseye.service.watch.site_map import SiteMap

ROW = "number, ticks, ranger, target, status, range_m, u_range_m, misfit_m"
MOST_SEARCHED = 400_000  # events of a journal through which a filter looks back at a time
ONE = text("SELECT * FROM shots WHERE run = :run AND seq >= :seq ORDER BY seq LIMIT 1")
BUFFER = text("SELECT packing, crc32, samples FROM buffers WHERE run = :run AND seq = :seq")
HARMONICS = tuple(range(2, 9))


def shots_object(
    history: History,
    *,
    ranger: str | None,
    target: str | None,
    epoch: int | None,
    status: str | None,
    since: float | None,
    until: float | None,
    limit: int,
) -> Object:
    """Columns of shots, oldest first, the latest `limit` that fit."""
    limit = require_limit(limit)
    if epoch is not None:
        return _of_epoch(EpochRecord(history, epoch), ranger, target, status, limit)
    (low, high), values = limits(since, until), {"ranger": ranger, "target": target, "status": status}
    wanted = {key: value for key, value in values.items() if value is not None}
    conditions = "".join(f" AND {key} = :{key}" for key in wanted)
    by_ranger = text(
        f"SELECT {ROW} FROM shots WHERE run = :run AND ticks >= :since AND ticks <= :until{conditions} "
        "ORDER BY ticks DESC LIMIT :limit"
    )
    by_seq = text(
        f"SELECT {ROW} FROM shots WHERE run = :run AND seq >= :low AND seq < :high AND ticks >= :since "
        f"AND ticks <= :until{conditions} ORDER BY seq DESC LIMIT :limit"
    )
    rows: list[Sequence[Any]] = []
    for stretch in history.index.stretches("shots", since, until):
        asked = {"run": stretch.run, "since": low, "until": high, "limit": limit - len(rows)} | wanted
        with stretch.part.reading() as connection:
            if ranger is not None:
                rows += connection.execute(by_ranger, asked)
            else:
                start = max(stretch.low, stretch.high - MOST_SEARCHED) if len(wanted) else stretch.low
                rows += connection.execute(by_seq, asked | {"low": start, "high": stretch.high})
        if len(rows) >= limit:
            break
    return columns(SHOT, [list(shot_object(row).values()) for row in reversed(rows)])


def _of_epoch(record: EpochRecord, ranger: str | None, target: str | None, status: str | None, limit: int) -> Object:
    rows = []
    for shot, row in sorted(record.shots().items()):
        of, to, ticks, word, *values = row
        if (ranger in (None, of)) and (target in (None, to)) and (status in (None, word)):
            rows.append((shot, mjd_of(ticks), words(of), words(to), words(word), *numbers(values)))
    return columns(SHOT, rows[-limit:])


class ShotRecord:
    """One shot of a journal.

    Raises InputError for a number that the run does not have.
    """

    def __init__(self, history: History, count: int, *, run: int | None = None, at: float | None = None):
        self._history, self.number = history, count
        self.run = history.index.run(run, at).run
        for part in history.index.parts(self.run):
            with part.reading() as connection:
                seq = first_seq(connection, "shots", self.run, count, "number")
                row = connection.execute(ONE, {"run": self.run, "seq": seq}).mappings().first()
            if row is not None and row["number"] == count:
                self.row, self._part, self.seq = dict(row), part, int(row["seq"])
                return
        raise InputError(f"shot {count} is not in run {self.run} of the journal (expected one of its shots)")

    def samples(self) -> np.ndarray | None:
        """Samples (n,) int16; None where none were stored.

        Raises InputError for damaged ones.
        """
        part: JournalReader = self._part
        if "buffers" not in part.tables:
            return None
        with part.reading() as connection:
            buffer = connection.execute(BUFFER, {"run": self.run, "seq": self.seq}).first()
        if buffer is None:
            return None
        place = f"journal {part.place}: run {self.run}, event {self.seq}"
        return unpack(buffer, max(1, int(self.row["samples_per_cycle"])), place)

    @property
    def has_samples(self) -> bool:
        """True if its samples were stored."""
        if "buffers" not in self._part.tables:
            return False
        with self._part.reading() as connection:
            query = text("SELECT 1 FROM buffers WHERE run = :run AND seq = :seq")
            return connection.execute(query, {"run": self.run, "seq": self.seq}).first() is not None

    def epoch(self) -> EpochRecord | None:
        """Epoch that took the shot; None if none did."""
        for summary in reversed(self._history.latest_epochs(*self._about(), 12)):
            if summary["run"] != self.run:
                continue
            record = EpochRecord(self._history, summary["number"], run=self.run)
            if self.number in (record.answer.get("used") or ()) or str(self.number) in (
                record.answer.get("rejected") or {}
            ):
                return record
        return None

    def _about(self) -> tuple[float, float]:
        """MJD between which its epoch was solved."""
        mjd = self.row["ticks"] / TICKS_PER_DAY
        return mjd - 5.0 / SECONDS_PER_DAY, mjd + 150.0 / SECONDS_PER_DAY


def shot_detail(record: ShotRecord, site: SiteMap) -> Object:
    """JSON object of a shot: its answer, the chain of numbers, weather, posture, certificate."""
    row, history = record.row, record._history
    mjd = row["ticks"] / TICKS_PER_DAY
    ranger, target = words(row["ranger"]), words(row["target"])
    epoch = record.epoch()
    parts = tuple(reversed(history.index.parts(record.run)))
    posture, weather = history.surroundings(record.run, parts, row["ticks"])
    return {
        "number": record.number,
        "run": record.run,
        "mjd": mjd,
        "ranger": ranger,
        "target": target,
        "status": words(row["status"]),
        "text": words(row["text"]),
        "range": number(row["range_m"]),
        "u_range": number(row["u_range_m"]),
        "misfit": number(row["misfit_m"]),
        "amplitude_v": number(row["amplitude_v"]),
        "phase": number(row["phase_rad"]),
        "cycles": row["cycles"],
        "samples_per_cycle": row["samples_per_cycle"],
        "if_hz": row["if_hz"],
        "epoch": None if epoch is None else epoch.number,
        "correction": _chain(record, epoch, site),
        "weather": weather,
        "posture": posture,
        "certificate": mirror_certificate(site.site, ranger, mjd),
        "has_samples": record.has_samples,
    }


def _chain(record: ShotRecord, epoch: EpochRecord | None, site: SiteMap) -> list[Object]:
    """Numbers from phase to range: by the adjustment of the shot's epoch where they are stored."""
    row, records = record.row, site.site
    steps: Sequence[tuple[str, float | None, str]] = ()
    if epoch is not None and words(row["ranger"]) in records.rangers:
        d0 = records.mirror_of(words(row["ranger"])).d0_mm * MILLIMETRE
        modulation = records.site.ranging.modulation_hz
        steps = range_steps(epoch.ranges(), record.number, d0=d0, modulation_hz=modulation)
    if not steps:
        steps = (
            ("phase by the ranger", row["phase_rad"], "rad"),
            ("range by this shot alone", row["range_m"], "m"),
            ("standard uncertainty of the range", row["u_range_m"], "m"),
            ("less the prediction", row["misfit_m"], "m"),
        )
    return [{"name": name, "value": number(value), "unit": unit} for name, value, unit in steps]


def samples_object(record: ShotRecord) -> Object:
    """Samples of a shot in volts, their spectrum, harmonics, phase of each cycle, and the detection.

    Raises InputError where no samples were stored, or damaged ones.
    """
    from catseye.signal.detection.cycle_scatter import cycle_phasors
    from catseye.signal.detection.phase import detect

    samples, row = record.samples(), record.row
    if samples is None:
        raise InputError(f"shot {record.number} has no samples in the journal (expected a run that keeps buffers)")
    n, m, volts = int(row["samples_per_cycle"]), int(row["cycles"]), float(row["volts_per_code"])
    if len(samples) != n * m or n < 3:
        raise InputError(f"shot {record.number} has {len(samples)} samples, not {m} cycles of {n}")
    rate = float(row["if_hz"]) * n
    wave = samples.astype(float) * volts
    orders = tuple(k for k in HARMONICS if 2 * k < n)
    detection = detect(samples, n, volts, harmonics=orders) if orders else detect(samples, n, volts)
    cycles = cycle_phasors(samples, n, volts)
    spectrum = np.abs(np.fft.rfft(wave)) * (2.0 / len(wave))
    spectrum[0] *= 0.5
    phase = np.unwrap(np.angle(cycles))
    return {
        "number": record.number,
        "sample_rate_hz": rate,
        "volts": np.round(wave, 7).tolist(),
        "spectrum": {
            "frequency_hz": np.fft.rfftfreq(len(wave), 1.0 / rate).tolist(),
            "amplitude_v": spectrum.tolist(),
        },
        "harmonics": [
            {"n": k, "frequency_hz": k * float(row["if_hz"]), "amplitude_v": number(value)}
            for k, value in zip((1, *orders), (_one(detection.amplitude), *_many(detection.harmonics)), strict=False)
        ],
        "cycle_phase": {"t": (np.arange(m) / float(row["if_hz"])).tolist(), "phase": numbers(phase.tolist())},
        "fit": {
            "amplitude_v": number(_one(detection.amplitude)),
            "u_amplitude_v": number(_one(detection.u_amplitude)),
            "phase": number(_one(detection.phase)),
            "u_phase": number(_one(detection.u_phase)),
            "offset_v": number(_one(detection.offset)),
            "noise_v": number(_one(detection.noise)),
            "largest_v": number(_one(detection.largest)),
            "clipped": int(_one(detection.clipped)),
            "distortion": number(_one(detection.distortion)),
        },
    }


def _one(value: Any) -> float:
    return float(np.asarray(value).ravel()[0])


def _many(value: Any) -> list[float]:
    return [float(v) for v in np.asarray(value).ravel()]
