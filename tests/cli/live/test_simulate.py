"""A whole site: in virtual time against the truth and again the same, in real time started and ended clean."""

import json
import signal
import subprocess
import time
from contextlib import suppress

import numpy as np
import pytest

from catseye.api import living
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from cli.living_scene import (
    PATIENCE,
    ROUNDS,
    RUN,
    ended,
    few_rangers,
    processes_with,
    recorded,
    small_site,
    smallest_site,
    started,
    write_site,
)
from process_scene import ends_with_us
from sun_scene import astropy_sun

OPTIONS = {"capture_output": True, "text": True, "timeout": PATIENCE, "check": True}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--minutes", "-1"], "-1 is not 0 to"),
        (["--round-s", "0.5"], "0.5 is not 2 to 600 s"),
        (["--filter", "kalman"], "'kalman' is not one of random_walk, constant_velocity"),
        (["--fault", "sleepy ZY101"], "expected KIND WHOM"),
        (["--motion", "track 1e9 45"], "azimuth 1e+09 is outside -540 to 540"),
        (["--seed", "-3"], "-3 is not 0 to"),
        (["--unknown"], "No such option"),
    ],
)
def test_what_cannot_be_meant_is_wrong_usage(catseye, words, said):
    status, out, err = catseye("simulate", "gbt", *words)
    assert (status, out) == (2, "")
    assert said in " ".join(err.split())


def test_unless_told_otherwise_it_begins_at_night_at_green_bank():
    """22 h local mean time; the Sun, by astropy's own position, is far below the horizon for the four hours to come."""
    assert pytest.approx(22.0, abs=0.5) == living.NIGHT % 1.0 * 24.0 + 24.0 - 79.839835 / 15.0
    up = astropy_sun(living.NIGHT + np.linspace(0.0, 4.0 / 24.0, 9))[:, 2]
    assert np.degrees(np.arcsin(up)).max() < -30.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--fault", "dead-ranger ZY999"], "unknown ranger ZY999"),
        (["--drop", "ZY999"], "drop ZY999: unknown ranger"),
        (["--journal", "/nowhere/x.db"], "directory /nowhere is missing"),
        (["--journal", __file__], "is not a journal"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_leaves_nothing(catseye, words, said):
    status, out, err = catseye("simulate", smallest_site(), "--fast", "--minutes", "0.1", "--json", *words)
    assert (status, out) == (1, "")
    assert said in err
    assert err.count("\n") == 1


def test_a_run_in_virtual_time_is_as_true_as_it_claims_and_the_same_each_time(tmp_path):
    """The same seed in two processes: shots and epochs to the last bit, as far as the shorter run goes.

    The first epochs know most points to some tenths of a millimetre: the worst coordinate within 30 mm, since rangers
    of the feed arm start from what the records have, 10 mm each coordinate, and are seen by few at first.
    """
    journal = tmp_path / "again.db"
    words = ["simulate", str(small_site()), "--fast", "--minutes", "0.2", *ROUNDS, "--json"]
    words += ["--journal", str(journal)]
    run = subprocess.run([*RUN, *words], **OPTIONS, preexec_fn=ends_with_us())
    told = json.loads(run.stdout)
    assert run.stderr == ""
    assert told["shots"] == told["acknowledged"] > 50
    assert told["used"] > 0.7 * told["shots"]
    assert told["used"] + sum(told["rejected"].values()) == told["shots"]
    assert told["seconds"] == pytest.approx(60.0 * 0.2, abs=0.2)
    assert len(told["epochs"]) == 2
    for epoch in told["epochs"]:
        assert {"number", "mjd", "points", "rms_mm", "mean_u_mm", "chi2_per_coordinate"} <= set(epoch)
        assert epoch["worst_mm"] < 30.0
        assert epoch["chi2_per_coordinate"] < 3.0
    short, long = (what_was_said(JournalReader(path)) for path in (journal, recorded()))
    assert 100 < len(short[1]) < len(long[1])
    assert short[0] == long[0][:2]
    until_last = round(told["epochs"][-1]["mjd"] * 1e8)
    assert [s for s in short[1] if s[0] < until_last] == [s for s in long[1] if s[0] < until_last]


def what_was_said(reader):
    """Solutions, and shots with stamp, samples and answer."""
    with reader:
        solutions = [solution.text for _, solution in reader.solutions(1)]
        return solutions, [
            (s.shot.ticks, s.shot.ranger, s.shot.samples.tobytes(), repr(s.range_)) for _, s in reader.shots(1)
        ]


@pytest.mark.slow
def test_another_seed_is_another_site():
    words = ["simulate", str(small_site()), "--fast", "--minutes", "0.2", *ROUNDS, "--json", "--seed"]
    one, two = (
        json.loads(subprocess.run([*RUN, *words, seed], **OPTIONS, preexec_fn=ends_with_us()).stdout)
        for seed in ("1", "2")
    )
    assert (one["seed"], two["seed"]) == (1, 2)
    assert one["journal"] is two["journal"] is None
    assert one["epochs"]
    assert [e["rms_mm"] for e in one["epochs"]] != [e["rms_mm"] for e in two["epochs"]]


@pytest.mark.parametrize(
    ("number", "status"), [pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow), (signal.SIGTERM, 143)]
)
def test_a_run_in_real_time_ends_clean_while_it_measures(tmp_path, number, status):
    """Status in time, no child, no temporary file, and a journal without a lock that says what was acknowledged."""
    journal = tmp_path / "out" / "night.db"
    journal.parent.mkdir()
    (tmp_path / "tmp").mkdir()
    site = tmp_path / "site"  # of its own: other workers have processes of the shared one
    write_site(site, few_rangers())
    words = ["simulate", site, "--minutes", "0", "--port-base", "0", "--journal", journal]
    with started(*words, home=tmp_path / "tmp") as process:
        said = [process.stdout.readline(), process.stdout.readline()]
        assert said == ["starting the twin\n", "starting the coordinator\n"]
        wait_for_shots(journal, process)
        code, out, err = ended(process, number)
    assert (code, err) == (status, "")
    assert "Shots" in out
    assert [path.name for path in journal.parent.iterdir()] == ["night.db"]
    assert list((tmp_path / "tmp").iterdir()) == []
    assert processes_with(str(site)) == []
    with JournalReader(journal) as reader:
        assert reader.run().ended is not None


@pytest.mark.parametrize("moment", [0.0, 1.0, 4.0])
def test_a_run_in_real_time_ends_clean_at_its_start(tmp_path, moment):
    with started("simulate", smallest_site(), "--port-base", "0", "--quiet", home=tmp_path) as process:
        try:
            process.wait(timeout=moment + 0.2)
        except subprocess.TimeoutExpired:
            assert ended(process, signal.SIGINT) == (130, "", "")
        assert process.returncode == 130
    assert list(tmp_path.iterdir()) == []


def wait_for_shots(journal, process):
    """Until the journal has some; a process that ends instead is a mistake."""

    def some():
        try:
            with JournalReader(journal) as reader:
                return any(True for _ in reader.events(1, kinds=["shots"], buffers=False))
        except InputError:  # it is being made
            return False

    since = time.monotonic()
    while not some():
        assert time.monotonic() - since < PATIENCE
        with suppress(subprocess.TimeoutExpired):
            pytest.fail(f"it ended with {process.wait(timeout=0.1)}")
