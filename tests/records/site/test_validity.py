"""A certificate against the day of the data: the last day counts, the next does not."""

from dataclasses import replace
from datetime import date

import pytest

import catseye
from catseye.records.files.record import Certificate
from catseye.records.site.validity import expired, expired_of_site


@pytest.mark.parametrize(
    ("mjd", "word"), [(52_891.99, ""), (52_892.99, ""), (52_893.0, "2003-09-11"), (60_000.0, "2023-02-25")]
)
def test_the_last_day_is_valid_and_the_next_is_not(mjd, word):
    """MJD 52 892 is 2003-09-10."""
    found = expired({"ZP103": Certificate(valid_until=date(2003, 9, 10)), "ZP104": Certificate()}, mjd)
    assert len(found) == bool(word)
    assert all("ZP103 ended on 2003-09-10" in each and word in each for each in found)


def test_night_01_has_none():
    assert expired_of_site(catseye.load("night-01")) == ()


def test_night_after_a_mirrors_certificate_is_doubtful():
    night = catseye.load("night-01")
    old = night.mirrors["ZP101"].model_copy(update={"valid_until": date(2001, 1, 1)})
    answer = catseye.reduce(replace(night, mirrors={**night.mirrors, "ZP101": old}))
    assert answer.verdict.word == "doubtful"
    assert "ZP101 ended on 2001-01-01" in answer.verdict.why
    assert any("ZP101 ended on 2001-01-01" in note for note in answer.notes)
