"""Archive of samplers: complete FITS files of all rows, also around failures and kills."""

import asyncio
import os
import signal
import subprocess
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.clients.server import ZiyServer
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.rings import Samplers
from catseye.errors import InputError
from catseye.gateways.writers.samplers_fits import read_samplers
from catseye.ranger.line import stamp_text
from catseye.service.archive.samplers import SamplerArchive
from cli.living_scene import PATIENCE, smallest_site, started
from coordinator.link_scene import LoopClock, network, run, until
from coordinator.samplers.test_corrections import solution
from coordinator.ziy_scene import Site, weather

NOON = 5_288_950_000_000  # ticks


def files(directory):
    return sorted(directory.glob("*/*.fits"))


class Stepping:
    """A clock advanced by hand, from noon."""

    def __init__(self):
        self.seconds = 0.0

    def now_ns(self):
        return NOON * 864_000 + round(self.seconds * 1e9)


def archive(directory, clock=None, every=20.0, **options):
    return SamplerArchive(
        directory, every=every, clock=clock or Stepping(), site="gbt", report=lambda trouble: None, **options
    )


def test_each_period_has_a_file_with_every_row_of_a_running_coordinator(tmp_path):
    async def story():
        async with Site() as site:
            server = ZiyServer(site.ziy, port=0, network=network())
            await server.start()
            made = archive(tmp_path / "a", LoopClock())
            told = []
            server.board.samplers.listeners += [made.add, lambda name, row: told.append((name, row[0]))]
            writing = asyncio.ensure_future(made.run())
            await until(lambda: len(made.written) >= 3)
            site.ziy.intake.take(weather())
            await asyncio.sleep(1.0)
            writing.cancel()
            made.finish()
            await server.stop()
            return told, made.written

    told, written = run(story)
    assert files(tmp_path / "a") == sorted(written)
    assert len(written) == 4
    tables = [read_samplers(path) for path in written]
    for name in ("RANGES", "EPOCHS", "POSTURE", "CORRECTIONS", "HEALTH", "EVENTS", "WEATHER"):
        kept = [stamp_text(t) for table in tables if name in table for t in table[name].columns["TICKS"].values]
        assert kept == [stamp for which, stamp in told if which == name], name
    assert all(len(table["RANGES"].mjd) > 10 for table in tables[:3])


def test_rows_are_read_back_with_units(tmp_path):
    made = archive(tmp_path)
    samplers = Samplers()
    samplers.listeners.append(made.add)
    entry = solution(3)
    samplers.add(replace(entry, answer=entry.answer | {"x": [[1.0, 2.0, 3.0]]}, covariance=1e-8 * np.eye(3)))
    samplers.add(weather_at(NOON))
    made.finish()
    [path] = files(tmp_path)
    assert path.name.startswith("samplers-")
    assert path.parent.name == "2003-09-07"
    tables = read_samplers(path)
    assert set(tables) == {"EPOCHS", "POINTS", "POSE", "BEAM", "FOCUS", "WEATHER"}
    points = tables["POINTS"]
    assert points.frame == "ground"
    assert (points.columns["XX_M2"].unit, points.columns["XX_M2"].values.tolist()) == ("m2", [1e-8])
    assert (points.columns["X_M"].values.tolist(), points.columns["POINT"].values.tolist()) == ([1.0], ["TR01"])
    assert np.isnan(points.columns["USED"].values).all()
    kelvin = tables["WEATHER"].columns["TEMPERATURE_K"]
    assert (kelvin.unit, kelvin.values.tolist()) == ("K", [283.15])
    assert tables["POSE"].columns["X_RX_M_RAD"].unit == "m rad"


def weather_at(ticks):
    from catseye.records.night.live import LiveWeather

    return LiveWeather("WX1", ticks, 10.0, 930.0, 50.0)


def test_every_sampler_has_its_table(tmp_path):
    made = archive(tmp_path)
    for name, columns in COLUMNS.items():
        made.add(name, (stamp_text(NOON), *("none" for _ in columns)))
    made.finish()
    [path] = files(tmp_path)
    assert list(read_samplers(path)) == list(COLUMNS)


def test_second_process_of_a_period_writes_beside_the_first(tmp_path):
    for _ in range(3):
        made = archive(tmp_path)
        made.add("EVENTS", (stamp_text(NOON), "note", "a", "b", "c"))
        made.finish()
    assert [path.name.count("-") for path in files(tmp_path)].count(2) == 2
    assert len(files(tmp_path)) == 3


def test_disk_that_fails_loses_nothing_until_it_works_again(tmp_path, monkeypatch):
    clock = Stepping()
    made = archive(tmp_path, clock)
    broken = True

    def fsync(descriptor):
        if broken:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fsync)
    for k in range(3):
        clock.seconds = 20.0 * k + 1.0
        made.add("EVENTS", (stamp_text(NOON), "note", "a", "b", f"number {k}"))
        made.finish()
        assert "No space left on device" in made.trouble
    assert files(tmp_path) == []
    broken = False
    made.finish()
    assert made.trouble is None
    texts = [read_samplers(path)["EVENTS"].columns["TEXT"].values[0] for path in made.written]
    assert texts == ["number 0", "number 1", "number 2"]
    assert not list(tmp_path.glob("*/.unfinished-*"))


def test_what_a_killed_process_left_is_taken_away(tmp_path):
    (tmp_path / "2003-09-07").mkdir()
    (tmp_path / "2003-09-07" / ".unfinished-samplers-120000").write_bytes(b"SIMPLE")
    archive(tmp_path)
    assert list((tmp_path / "2003-09-07").iterdir()) == []


def test_directory_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "a").write_text("mine")
    with pytest.raises(InputError, match="cannot hold an archive"):
        archive(tmp_path / "a")
    assert (tmp_path / "a").read_text() == "mine"


def test_killed_process_leaves_complete_files_and_the_next_goes_on(tmp_path):
    """Killed with SIGKILL as soon as a second file is there; what is there can be read, checksums and all."""
    words = ("simulate", smallest_site(), "--minutes", "0", "--round-s", "5", "--port-base", "0", "--port", "0")
    kept = tmp_path / "kept"
    for _ in range(2):
        before = len(files(kept))
        with started(*words, "--archive-samplers", kept, "--archive-every-s", "5", "--quiet") as process:
            until_time = time.monotonic() + PATIENCE
            while len(files(kept)) < before + 2 and time.monotonic() < until_time and process.poll() is None:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(0.1)
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
        assert len(files(kept)) >= before + 2
    for path in files(kept):
        tables = read_samplers(path)
        assert sum(len(table.mjd) for table in tables.values()) > 0
