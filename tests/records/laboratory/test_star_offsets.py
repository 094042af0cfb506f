"""TPOINT text in and out: what is accepted is read to the digit, everything else is refused with its line."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.records.laboratory.star_offsets import parsed, read_star_offsets, star_offsets_text

GOOD = """\
! Caption record:
SDSS-like pointing data 2011-12-11
! options
: ALTAZ
: NODA ALLSKY
! Run parameters: telescope latitude deg min sec, date
38 25 59.236 2001 12 28

!  Az          Alt         Az          Alt      rotator
 145.300000   30.000000  145.301000   30.004000  12.5
 359.999000   60.000000    0.001000   59.999000 -3.0
! a comment between
  10.0 45.0 370.0 45.0 0
END
anything after does not count
"""


def test_a_file_as_observatories_write_it_is_read():
    found = parsed(GOOD, "stars.dat")
    assert found.caption == "SDSS-like pointing data 2011-12-11"
    assert found.options == ("NODA", "ALLSKY")
    assert found.latitude / DEGREE == pytest.approx(38 + 25 / 60 + 59.236 / 3600, abs=1e-12)
    assert found.run == ("2001", "12", "28")
    assert found.line == (10, 11, 13)
    np.testing.assert_allclose(found.auxiliary[:, 0], [12.5, -3.0, 0.0])
    # by hand: 3.6 arcsec times cos 30, 14.4; across north 7.2 cos 60 = 3.6, -3.6; a whole turn is nothing
    wanted = [[3.6 * np.cos(30 * DEGREE), 14.4], [3.6, -3.6], [0.0, 0.0]]
    np.testing.assert_allclose(found.correction / ARCSECOND, wanted, rtol=0, atol=1e-6)


def test_a_file_without_end_and_with_crlf_is_read_alike(tmp_path):
    text = GOOD.partition("END")[0].replace("\n", "\r\n")
    (tmp_path / "s.dat").write_text(text, newline="")
    found = read_star_offsets(tmp_path / "s.dat")
    np.testing.assert_array_equal(found.correction, parsed(GOOD, "x").correction)
    assert len(found.digest) == 64


angle = st.tuples(st.floats(0, 360), st.floats(1, 89), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-1e3, 1e3))


@given(st.lists(angle, min_size=1, max_size=8), st.floats(-89.9, 89.9))
def test_written_offsets_are_read_back(rows, latitude):
    table = np.array(rows)
    first = parsed(GOOD, "x")
    made = dataclasses.replace(
        first,
        latitude=latitude * DEGREE,
        azimuth=table[:, 0] * DEGREE,
        elevation=table[:, 1] * DEGREE,
        azimuth_encoder=(table[:, 0] + table[:, 2]) * DEGREE,
        elevation_encoder=(table[:, 1] + table[:, 3]) * DEGREE,
        auxiliary=table[:, 4:],
    )
    again = parsed(star_offsets_text(made), "x")
    assert (again.caption, again.options, again.run) == (made.caption, made.options, made.run)
    assert abs(again.latitude - made.latitude) <= 0.051 * ARCSECOND
    for name in ("azimuth", "elevation", "azimuth_encoder", "elevation_encoder"):
        np.testing.assert_allclose(getattr(again, name), getattr(made, name), rtol=0, atol=0.51e-7 * DEGREE)
    np.testing.assert_allclose(again.auxiliary, made.auxiliary, rtol=1e-8)
    assert star_offsets_text(again) == star_offsets_text(parsed(star_offsets_text(again), "x"))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((": ALTAZ\n", ""), "no option ': ALTAZ'"),
        ((": ALTAZ", ": EQUAT"), "line 4, option EQUAT"),
        (("38 25 59.236 2001", "thirty-eight"), "line 7, .*latitude"),
        (("38 25 59.236", "38 75 59.236"), "latitude 38 75"),
        (("38 25 59.236", "90 00 01"), "beyond the pole"),
        (("145.301000", "145.3O1"), "line 10, '145.3O1' is not a number"),
        ((" -3.0", ""), r"line 11 has 4 numbers \(expected 5"),
        (("  10.0 45.0 370.0 45.0 0", "  10.0 45.0 370.0"), "line 13 has 3 numbers"),
        (("10.0 45.0 370.0", "10.0 145.0 370.0"), "line 13, elevation = 145.0"),
        (("10.0 45.0 370.0", "10.0 45.0 190.0"), "line 13, sky and encoders are .* apart"),
        (("SDSS-like pointing data 2011-12-11", "!"), "line|option|latitude|caption"),
    ],
)
def test_invalid_text_is_refused_in_one_line(change, said):
    text = GOOD.replace(*change)
    assert text != GOOD
    with pytest.raises(InputError, match=said) as refused:
        parsed(text, "stars.dat")
    assert str(refused.value).startswith("stars.dat: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [("! only\n", "comments only"), ("caption\n: ALTAZ\n", "no line with the latitude"),
     ("caption\n: ALTAZ\n38 25 59\nEND\n", "no observations")],
)  # fmt: skip
def test_missing_parts_are_named(text, said):
    with pytest.raises(InputError, match=said):
        parsed(text, "s.dat")
