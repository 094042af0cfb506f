"""A journal and a simulated site from Python."""

import dataclasses
from datetime import date

import pytest

import catseye
from catseye.errors import InputError
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
