"""A journal and a simulated site from Python."""

import dataclasses
import inspect
from datetime import date

import pytest

import catseye
from catseye.api.live import serving
from catseye.cli.commands import app, join_commands
from catseye.errors import ArgumentError, InputError
from repository import ROOT

JOURNAL = ROOT / "tests" / "vectors" / "formats" / "journal-1.db"


def test_a_journal_is_loaded_and_says_itself():
    found = catseye.load(JOURNAL)
    assert repr(found).startswith("<Journal ")
    assert len(found.runs()) >= 1


def test_what_is_no_journal_is_refused(tmp_path):
    with pytest.raises(InputError):
        catseye.replay(tmp_path / "nothing.db")
    with pytest.raises(InputError, match="minutes = 0"):
        catseye.simulate(minutes=0.0)


@pytest.mark.parametrize(
    ("more", "name"),
    [
        ({"seed": -1}, "seed"),
        ({"round_s": 1.0}, "round_s"),
        ({"filter_": "kalman"}, "filter_"),
        ({"conditions": "nice"}, "conditions"),
        ({"motion": "track 0 95"}, "motion"),
        ({"faults": ["sleepy ZY101"]}, "faults"),
        ({"start_mjd": "yesterday"}, "start_mjd"),
        ({"start_mjd": 2e6}, "start_mjd"),
        ({"port_base": 70_000}, "port_base"),
        ({"minutes": float("nan")}, "minutes"),
    ],
)
def test_an_argument_out_of_its_range_is_named(more, name):
    with pytest.raises(ArgumentError) as refused:
        catseye.simulate("gbt", **more)
    assert name in refused.value.names


def test_real_time_reads_its_site_from_a_folder():
    with pytest.raises(ArgumentError, match="expected a folder, or fast"):
        catseye.simulate(catseye.load("gbt"), fast=False)


TERMINAL = {"json", "quiet"}


@pytest.mark.parametrize("name", ["zy", "ziy", "serve"])
def test_a_blocking_function_takes_every_option_of_its_command(name):
    join_commands()
    command = next(each.callback for each in app.registered_commands if each.callback.__name__ == name)
    taken = set(inspect.signature(getattr(serving, name)).parameters)
    taken |= set(inspect.signature(serving.coordinator_orders).parameters) if "orders" in taken else set()
    assert set(inspect.signature(command).parameters) - TERMINAL <= taken
    assert set(serving.OrderOptions.__annotations__) == set(inspect.signature(serving.coordinator_orders).parameters)


def test_a_site_whose_certificate_has_ended_measures_and_is_told():
    site = catseye.load("gbt")
    old = site.mirrors["ZP101"].model_copy(update={"valid_until": date(2001, 1, 1)})
    site = dataclasses.replace(site, mirrors={**site.mirrors, "ZP101": old})
    told = catseye.simulate(site, minutes=0.02, drop=[name for name in site.rangers if name != "ZY101"]).to_object()
    [ended] = [each for each in told["troubles"] if each["kind"] == "certificate-expired"]
    assert (ended["who"], ended["count"]) == ("records", 1)
    assert "ZP101 ended on 2001-01-01" in ended["text"]


@pytest.mark.slow
def test_a_site_is_simulated_and_its_journal_gives_the_same_bits(tmp_path):
    site = catseye.simulate("gbt", minutes=0.5, journal=tmp_path / "site.db")
    assert site.verdict.word == "good"
    assert len(site.to_table()) == len(site.epochs) >= 1
    again = catseye.replay(tmp_path / "site.db")
    assert again.same
    assert again.identical
    assert again.verdict.word == "good"
    assert again.shots == again.same_shots > 100
    assert catseye.replay(catseye.load(tmp_path / "site.db")).same
