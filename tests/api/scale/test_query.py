"""`catseye.query`: its questions, and what it refuses."""

import re

import astropy.units as u
import pytest
from astropy.time import Time

import catseye
from archive_scene import NEW_YEAR, written_year
from catseye.errors import ArgumentError, InputError


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    place = tmp_path_factory.mktemp("year") / "archive"
    written_year(place, nights=12, points=15)
    return place


def test_without_a_question_its_nights(year):
    result = catseye.query(year)
    assert (result.question, result.nights, len(result.to_table())) == ("nights", 12, 12)
    assert result.verdict.word == "good"


@pytest.mark.parametrize(
    ("arguments", "names", "text"),
    [
        ({"point": "ZP00001", "ranger": "ZY101"}, ("point", "ranger"), "several questions"),
        ({"sql": "SELECT 1", "surface": True}, ("surface", "sql"), "several questions"),
        ({"ranger": "ZY101", "frame": "reflector"}, ("frame", "point"), "goes with point only"),
        ({"point": "ZP00001", "frame": "sky"}, ("frame",), "expected one of ground, reflector"),
        ({"point": "ZP00001", "calibrations": "gbt"}, ("calibrations", "again"), "goes with again only"),
        ({"sql": "SELECT 1", "since": 60000}, ("since", "sql"), "does not go with sql"),
        ({"certificates": "year-003", "until": 60000}, ("until", "certificates"), "does not go with certificates"),
        ({"point": "ZP00001", "since": "yesterday"}, ("since",), "yesterday"),
    ],
)
def test_arguments_that_do_not_fit_together(year, arguments, names, text):
    with pytest.raises(ArgumentError, match=text) as problem:
        catseye.query(year, **arguments)
    assert problem.value.names == names


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"point": "ZP1"}, "point 'ZP1' is not in the archive"),
        ({"certificates": "year-9"}, "night 'year-9' is not in the archive"),
        ({"certificates": "year"}, "night 'year' is the beginning of several"),
        ({"again": "year-003"}, "has no inputs in the archive"),
        ({"again": "year-003", "calibrations": "nowhere"}, "nowhere"),
        ({"surface": True}, "no night has a surface"),
    ],
)
def test_what_cannot_be_answered_is_one_line(year, arguments, text):
    with pytest.raises(InputError, match=re.escape(text)) as problem:
        catseye.query(year, **arguments)
    assert "\n" not in str(problem.value)


def test_a_directory_that_is_no_archive(tmp_path):
    with pytest.raises(InputError, match=r"holds no archive\.toml"):
        catseye.query(tmp_path)
    with pytest.raises(InputError, match="is not a directory"):
        catseye.query(tmp_path / "nowhere", point="ZP00001")


def test_a_span_in_several_spellings(year):
    first = NEW_YEAR + 5.0
    for since in (first, first * u.d, Time(first, format="mjd"), "2026-01-06T00:00"):
        assert len(catseye.query(year, point="ZP00001", since=since).to_table()) == 7


def test_an_answer_is_not_written_into_its_archive(year, tmp_path):
    result = catseye.query(year, ranger="ZY101")
    before = sorted(path for path in year.rglob("*"))
    with pytest.raises(InputError):
        catseye.save(result, year)
    assert sorted(path for path in year.rglob("*")) == before
    assert (catseye.save(result, tmp_path / "out") / "zeros.csv").exists()


def test_the_index_of_an_answer_follows_its_nights(year, tmp_path):
    other = tmp_path / "archive"
    written_year(other, nights=11, points=15)
    assert catseye.query(year).inputs() == catseye.query(year, point="ZP00001").inputs()
    assert catseye.query(other).inputs() != catseye.query(year).inputs()
