"""Many simulated runs and many journals, each as if it were the only one."""

import json
import shutil

import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from cli.living_scene import recorded, smallest_site

SHORT = {"minutes": 0.22, "round_s": 5.0}  # two epochs


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two runs with their journals, and where they are."""
    out = tmp_path_factory.mktemp("runs") / "out"
    made = catseye.simulate_runs(smallest_site(), runs=2, directory=out, seed=7, journal="n.db", processes=2, **SHORT)
    return made, out


def test_a_run_of_many_is_the_run_of_its_seed(two):
    made, out = two
    assert [(o.name, o.state, o.value["seed"]) for o in made.outcomes] == [("seed-7", "done", 7), ("seed-8", "done", 8)]
    alone = catseye.simulate(smallest_site(), seed=8, **SHORT)
    stored = json.loads((out / "seed-8" / "result.json").read_text())
    assert stored["epochs"] == json.loads(alone.to_json())["epochs"]
    assert stored["epochs"][-1]["rms_mm"] == made.outcomes[1].value["rms_mm"]
    assert made.outcomes[0].value["digest"] != made.outcomes[1].value["digest"]
    assert list(made.to_table()["rms_mm"]) == [o.value["rms_mm"] for o in made.outcomes]


def test_runs_tell_their_scatter(two):
    made, _ = two
    points = made.scatter[0]
    assert (points.quantity, points.runs) == ("points", 2)
    assert points.terms == sum(o.value["coordinates"] for o in made.outcomes)
    assert next(iter(made.to_table("scatter")["quantity"])) == "points"
    assert any(passage.title == "Scatter of points" for passage in made.passages())
    assert isinstance(made.to_object(), list)


def test_runs_are_resumed_and_only_missing_ones_are_done(two):
    made, out = two
    again = catseye.simulate_runs(
        smallest_site(), runs=2, directory=out, seed=7, journal="n.db", resume=True, processes=1, **SHORT
    )
    assert [o.state for o in again.outcomes] == ["resumed", "resumed"]
    assert [o.value for o in again.outcomes] == [o.value for o in made.outcomes]
    shutil.rmtree(out / "seed-8")
    third = catseye.simulate_runs(
        smallest_site(), runs=2, directory=out, seed=7, journal="n.db", resume=True, processes=1, **SHORT
    )
    assert [o.state for o in third.outcomes] == ["resumed", "done"]
    assert third.outcomes[1].value["digest"] == made.outcomes[1].value["digest"]


def test_journals_of_runs_are_replayed_bit_for_bit(two, tmp_path):
    _, out = two
    journals = [shutil.copy(out / f"seed-{seed}" / "n.db", tmp_path / f"{seed}.db") for seed in (7, 8)]
    many = catseye.replay_journals(journals, tmp_path / "again", processes=1)
    assert [o.value["same"] for o in many.outcomes] == [True, True]
    assert many.verdict.word == "good"
    assert json.loads((tmp_path / "again" / "7" / "result.json").read_text())["identical"] is True
    resumed = catseye.replay_journals(journals, tmp_path / "again", processes=1, resume=True)
    assert [o.state for o in resumed.outcomes] == ["resumed", "resumed"]


def test_a_journal_that_cannot_be_read_does_not_stop_the_others(tmp_path):
    good = shutil.copy(recorded(), tmp_path / "good.db")
    (tmp_path / "bad.db").write_bytes(b"not a journal" * 100)
    many = catseye.replay_journals([tmp_path / "bad.db", good], processes=1)
    assert [(o.name, o.state) for o in many.outcomes] == [("bad", "failed"), ("good", "done")]
    assert "bad.db" in many.outcomes[0].why
    assert many.verdict.word == "failed"
    assert many.outcomes[1].value["same"] is True


def test_journals_of_one_name_have_their_folders_and_the_same_twice_is_refused(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "n.db").write_bytes(b"not a journal")
    many = catseye.replay_journals([tmp_path / "a" / "n.db", tmp_path / "b" / "n.db"], processes=1)
    assert [(o.name, o.state) for o in many.outcomes] == [("a-n", "failed"), ("b-n", "failed")]
    with pytest.raises(ArgumentError, match="its name 'a-n' is taken"):
        catseye.replay_journals([tmp_path / "a" / "n.db", tmp_path / "a" / "n.db"])


def test_runs_that_cannot_be_are_refused_before_any_begins(tmp_path):
    with pytest.raises(ArgumentError, match="runs = 0"):
        catseye.simulate_runs("gbt", runs=0)
    with pytest.raises(ArgumentError, match="never ends"):
        catseye.simulate_runs("gbt", runs=2, minutes=0.0)
    with pytest.raises(ArgumentError, match="each run has its own"):
        catseye.simulate_runs("gbt", runs=2, journal="n.db")
    with pytest.raises(ArgumentError, match="nothing is stored"):
        catseye.simulate_runs("gbt", runs=2, resume=True)
    with pytest.raises(InputError, match="unknown ranger"):
        catseye.simulate_runs(smallest_site(), runs=2, drop=["ZY999"], directory=tmp_path / "out")
    assert not (tmp_path / "out").exists()
