"""Runs of journals into an archive: each epoch as it was stored, and the samples as a campaign."""

import sqlite3

import numpy as np
import pytest

from catseye.coordinator.journal.entries import EPOCH_RANGES, Document, EpochSolution
from catseye.coordinator.journal.writer import Journal
from catseye.errors import InputError
from catseye.gateways.archive.files import create_archive
from catseye.gateways.archive.restored import write_restored
from catseye.records.archive.provenance import read_provenance
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.samples import read_samples
from catseye.records.archive.verification import verify_archive
from catseye.records.night.campaign import read_campaign
from catseye.records.night.live import LivePosture, LiveWeather
from catseye.service.archive.runs import archive_run
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, scene_answer, scene_run
from service.archive.adding_scene import added

POINTS = ("ZEG41040L", "ZY105", "ZY105-F")
CIL = np.diag(np.arange(1.0, 7.0)) * 1e-10


def motion(body, shift):
    return {
        "body": body,
        "pivot": [0.0, 0.0, 1.0],
        "translation": [shift, 0.0, 0.0],
        "rotation": [0.0, 1e-6, 0.0],
        "covariance": CIL.tolist(),
    }


def epoch(number):
    """Solution after `number` shots: three points, a zero, thermometers and poses."""
    covariance = np.arange(81.0).reshape(9, 9) * 1e-10 + number
    answer = {
        "number": number,
        "azimuth": 2.5,
        "elevation": 0.5 + 0.1 * number,
        "names": list(POINTS),
        "x": [[1.0 + number, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, None]],
        "shots": [2, 3, 0],
        "variance_factor": 1.0 + number,
        "degrees_of_freedom": 10.0 * number,
        "refractivity_ppm": 280.0,
        "air": {"WX1": [0.1 * number, 0.05], "bend": [0.0, 0.03]},
        "zeros": {"ZY105": [1e-6 * number, 12e-6]},
        "pose": {"dish": motion("dish", 1e-3 * number), "feed": motion("arm", 2e-3), "missing": ""},
        "doubts": ["the wind shakes the arm"] if number == 3 else [],
    }
    return EpochSolution(START + 200 * number + 90, answer, covariance)


def journal_entries(epochs):
    for k in range(1, 2 * epochs + 1):
        when = START + 200 * k
        yield LivePosture(when, 2.5, 0.5 + 0.01 * k)
        yield LiveWeather("WX1", when, 10.0 + k, 930.0, 70.0)
        yield LiveWeather("WX2", when, 10.0, 925.0, 70.0)
        yield scene_answer(k, ticks=when + 10)
        if k % 2 == 0:
            yield Document(when, EPOCH_RANGES, f'{{"shot": [{k}], "u_range": [5e-05], "residual": [null], "w": [1.5]}}')
            yield epoch(k // 2)


def journal(path, epochs=3, run=None):
    with Journal.open(path, run=run or scene_run(), clock=ManualClock(START / 1e8)) as book:
        book.append(*journal_entries(epochs)).result(MOST_WAIT)
    return path


def test_a_run_s_tables_hold_each_epoch_as_it_was_stored(tmp_path):
    create_archive(tmp_path / "a")
    value = archive_run(str(tmp_path / "a"), str(journal(tmp_path / "j.db")), 1)
    assert value["added"]
    archive = open_archive(tmp_path / "a")
    assert archive.nights == (value["night"],)
    assert value["night"].startswith("night-01-2003-09-07-")
    points = read_table(archive, "points", where={"point": "ZEG41040L"})
    assert points["x"].tolist() == [2.0, 3.0, 4.0]
    assert points["mjd"].tolist() == [(START + 200 * k + 90) / 1e8 for k in (1, 2, 3)]
    assert points["body"].tolist() == ["structure"] * 3
    assert points["yz"].tolist() == [k + 11e-10 for k in (1, 2, 3)]
    assert read_table(archive, "points", ["body"], where={"point": "ZY105-F"})["body"].tolist() == ["fixed point"] * 3
    assert np.isnan(read_table(archive, "points", ["z"], where={"point": "ZY105-F"})["z"]).all()
    dish = read_table(archive, "poses", where={"body": "dish"})
    assert dish["translation_x"].tolist() == pytest.approx([1e-3, 2e-3, 3e-3])
    assert (dish["frame"][0], dish["c22"][0], dish["elevation"][2]) == ("reflector", 2e-10, pytest.approx(0.8))
    assert set(read_table(archive, "poses", ["body"])["body"].tolist()) == {"dish", "feed arm"}
    zeros = read_table(archive, "zeros")
    assert zeros["value"].tolist() == pytest.approx([1e-6, 2e-6, 3e-6])
    weather = read_table(archive, "weather", where={"station": "WX1"})
    assert weather["t_error_c"].tolist() == pytest.approx([0.1, 0.2, 0.3, 0.3, 0.3, 0.3])  # the first epoch after it
    assert np.isnan(read_table(archive, "weather", ["t_error_c"], where={"station": "WX2"})["t_error_c"]).all()
    residuals = read_table(archive, "residuals")
    assert residuals["w"].tolist()[1::2] == [1.5] * 3
    assert np.isnan(residuals["w"][::2]).all()
    assert np.isnan(residuals["residual"]).all()
    assert residuals["elevation"].tolist() == pytest.approx([0.51, 0.52, 0.53, 0.54, 0.55, 0.56], abs=1e-3)
    row = read_table(archive, "nights")
    assert row["variance_factor"][0] == pytest.approx((10 * 2 + 20 * 3 + 30 * 4) / 60)
    assert (row["verdict"][0], row["why"][0], row["shots"][0]) == ("doubtful", "the wind shakes the arm", 6)


def test_a_run_comes_back_as_the_campaign_of_its_samples(tmp_path):
    create_archive(tmp_path / "a")
    archive_run(str(tmp_path / "a"), str(journal(tmp_path / "j.db")), 1)
    archive = open_archive(tmp_path / "a")
    write_restored(archive, archive.nights[0], tmp_path / "campaign")
    campaign = read_campaign(tmp_path / "campaign")
    shots = [scene_answer(k).shot.samples for k in range(1, 7)]
    assert np.array_equal(campaign.frames, np.array(shots))
    assert np.array_equal(read_samples(archive, archive.nights[0], [5, 0]), np.array([shots[5], shots[0]]))
    assert read_provenance(archive, archive.nights[0]).details["journal"]["chain"]["intact"] is True
    assert not list((tmp_path / "a").glob(".catseye-*"))


def test_a_run_that_went_on_replaces_its_earlier_state(tmp_path):
    run = scene_run()
    early, late = journal(tmp_path / "early.db", 2, run), journal(tmp_path / "late.db", 3, run)
    added(tmp_path / "a", early)
    [before] = open_archive(tmp_path / "a").nights
    change = added(tmp_path / "a", late)
    assert change.replaced == (before,)
    archive = open_archive(tmp_path / "a")
    assert len(archive.nights) == 1
    assert len(read_table(archive, "points", ["x"], where={"point": "ZY105"})["x"]) == 3
    assert added(tmp_path / "a", early).outcomes[0].value["added"] is True
    assert open_archive(tmp_path / "a").nights == archive.nights  # the later state stays
    assert verify_archive(tmp_path / "a").strangers == ()


def test_a_journal_that_fails_verification_is_refused(tmp_path):
    path = journal(tmp_path / "j.db")
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE weather SET temperature_c = 0.0 WHERE seq = 2")
    connection.close()
    [outcome] = added(tmp_path / "a", path).outcomes
    assert outcome.state == "failed"
    assert "run 1 fails verification" in outcome.why
    assert open_archive(tmp_path / "a").nights == ()


def test_a_run_without_samples_keeps_its_results_and_its_site(tmp_path):
    path = tmp_path / "j.db"
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as book:
        bare = (
            scene_answer(entry.shot.number, samples=False) if hasattr(entry, "shot") else entry
            for entry in journal_entries(2)
        )
        book.append(*bare).result(MOST_WAIT)
    added(tmp_path / "a", path)
    archive = open_archive(tmp_path / "a")
    [night] = archive.nights
    with pytest.raises(InputError, match="has no samples in the archive"):
        read_samples(archive, night)
    write_restored(archive, night, tmp_path / "site")
    assert (tmp_path / "site/site.toml").is_file()
    assert not (tmp_path / "site/frames.npy").exists()
