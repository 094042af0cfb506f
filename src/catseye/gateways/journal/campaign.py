"""Campaign directory of a journal's run, for `catseye reduce`.

Readings and shots that the live reduction rejected are in doubts.csv, jitter of the telescope's bodies in jitter.csv,
and, if the telescope moved, its positions in postures.csv. The directory is validated before it appears.
"""

import csv
import io
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from catseye.coordinator.journal.campaign import JournalCampaign
from catseye.gateways.journal.chain import chain_object
from catseye.gateways.journal.export import seal
from catseye.gateways.writers.output import atomic_directory
from catseye.gateways.writers.written import origin
from catseye.ranger.line import stamp_text
from catseye.records.night.campaign import read_campaign
from catseye.records.night.doubt import DOUBTS, DoubtRow
from catseye.records.night.jitter import JITTER, JitterRow
from catseye.records.night.live import LiveWeather
from catseye.records.night.postures import POSTURES, PostureRow
from catseye.records.night.shot import ShotRow
from catseye.records.night.weather import WeatherSample
from catseye.records.site.folder import site_files


def write_campaign(campaign: JournalCampaign, out: Path) -> None:
    """Write shots, samples and weather as docs/formats/campaign.md, atomically.

    campaign   from `journal_campaign`, its reader still open

    Raises InputError for a directory that is not catseye's.
    """
    reader = campaign.reader
    with atomic_directory(out, Path(reader.place)) as directory:
        for path, text in site_files(campaign.site).items():
            (directory / path).parent.mkdir(exist_ok=True)
            (directory / path).write_text(text, encoding="utf-8", newline="")
        for name in ("monuments", "mirrors", "triplets"):  # required, even if empty
            (directory / name).mkdir(exist_ok=True)
        (directory / "weather.csv").write_text(_weather_csv(campaign.readings), encoding="utf-8", newline="")
        (directory / "shots.csv").write_text(_shots_csv(campaign), encoding="utf-8", newline="")
        motion = campaign.motion
        for name, rows in ((DOUBTS, campaign.doubts), (JITTER, motion.jitter), (POSTURES, motion.postures)):
            if rows:
                (directory / name).write_text(_table(rows), encoding="utf-8", newline="")
        _write_frames(campaign, directory / "frames.npy")
        read_campaign(directory)
        provenance = origin(datetime.now(UTC), campaign.run.hashes)
        chains = [] if campaign.chain is None else [chain_object(campaign.chain)]
        remarks = {
            "run": campaign.run.uuid,
            "notes": list(campaign.notes),
            "chains": chains,
            "verdict": campaign.verdict.to_object(),
        }
        seal(directory, reader, {"made_by": "catseye export", **provenance, **remarks})


def _table(rows: Sequence[DoubtRow | JitterRow | PostureRow]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, tuple(type(rows[0]).model_fields), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(row.model_dump() | {"mjd_utc": f"{row.mjd_utc:.8f}"})
    return text.getvalue()


def _shots_csv(campaign: JournalCampaign) -> str:
    """Table of shots by number, or by seq where numbers are not unique."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(ShotRow.model_fields)
    for frame, (number, shot) in enumerate(zip(campaign.numbers, campaign.shots, strict=True)):
        row = (number, stamp_text(shot.ticks), shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle, frame)
        writer.writerow(row)
    return text.getvalue()


def _weather_csv(readings: Sequence[LiveWeather]) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(WeatherSample.model_fields)
    for read in readings:
        values = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
        writer.writerow((stamp_text(read.ticks), read.station, *(repr(float(value)) for value in values)))
    return text.getvalue()


def _write_frames(campaign: JournalCampaign, path: Path) -> None:
    """Write frames, one row per shot, zero-padded to the longest; one buffer in memory at a time.

    Written, not mapped: on a full disk a mapped file would kill the process.
    """
    width = max(shot.cycles * shot.samples_per_cycle for shot in campaign.shots)
    rows = {shot.seq: row for row, shot in enumerate(campaign.shots)}
    with path.open("wb") as file:
        header = {"descr": "<i2", "fortran_order": False, "shape": (len(campaign.shots), width)}
        np.lib.format.write_array_header_1_0(file, header)
        first = file.tell()
        file.truncate(first + 2 * width * len(campaign.shots))
        for seq, entry in campaign.reader.shots(campaign.run.run):
            if seq in rows and entry.shot.samples is not None:
                file.seek(first + 2 * width * rows[seq])
                file.write(np.asarray(entry.shot.samples, "<i2").tobytes())
