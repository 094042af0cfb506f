"""Instants in two parts, against Python's own fractions and erfa's two-part dates."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.sky.time_tag import EXACT_DECIMALS, PER_DAY, TimeTag, mjd_of, tag_step, utc_text

days = st.integers(0, 100_000)
nanoseconds = st.integers(0, PER_DAY - 1)


def exact(tag):
    return int(tag.day) + Fraction(int(tag.nanoseconds), PER_DAY)


@given(days, nanoseconds, st.integers(-(10**18), 10**18))
def test_sums_and_differences_are_exact(day, ns, step):
    tag = TimeTag(day, ns)
    if not 0 <= exact(tag) + Fraction(step, PER_DAY) <= 106_000:
        return
    later = tag.plus(step)
    assert int(later - tag) == step
    assert exact(later) - exact(tag) == Fraction(step, PER_DAY)
    assert 0 <= int(later.nanoseconds) < PER_DAY


@given(days, nanoseconds)
def test_fourteen_decimals_are_read_back_without_loss(day, ns):
    tag = TimeTag(day, ns)
    assert int(TimeTag.parse(tag.text(EXACT_DECIMALS)) - tag) == 0


@given(days, st.integers(0, 86_400_000_000 - 1))
def test_eleven_decimals_separate_every_microsecond(day, us):
    tag = TimeTag(day, 1000 * us)
    back = TimeTag.parse(tag.text())
    assert round(int(back.nanoseconds) / 1000) == us or back.day > tag.day
    assert abs(int(back - tag)) <= 432


@given(days, nanoseconds, st.integers(0, 30))
def test_a_text_is_the_nearest_of_its_length(day, ns, decimals):
    tag = TimeTag(day, ns)
    assert abs(Fraction(tag.text(decimals)) - exact(tag)) * 2 <= Fraction(1, 10**decimals)


@given(st.integers(0, 99_999), st.text("0123456789", max_size=40))
def test_any_text_is_read_to_the_nearest_nanosecond(day, digits):
    text = f"{day}.{digits}"
    assert abs(exact(TimeTag.parse(text)) - Fraction(f"{day}.{digits or '0'}")) * 2 * PER_DAY <= 1


@given(st.floats(0.0, 100_000.0))
def test_a_float_goes_in_as_what_it_is(mjd):
    assert abs(exact(TimeTag.from_mjd(mjd)) - Fraction(mjd)) * PER_DAY <= Fraction(1, 2) + Fraction(1, 10**9)


def test_eight_decimals_have_the_error_in_the_manual():
    assert tag_step(8) == pytest.approx(0.864e-3, rel=1e-12)
    assert np.spacing(52889.0) * 86400 == pytest.approx(0.63e-6, rel=0.01)  # a double
    tag = TimeTag(52889, 10_800 * 10**9 + 431_000)
    assert abs(int(TimeTag.parse(tag.text(8)) - tag)) == 431_000
    assert tag.seconds_since(TimeTag(52888, 0)) == pytest.approx(97_200.000431, abs=1e-10)


def test_erfa_agrees_on_a_calendar_date():
    import erfa

    _, mjd = erfa.cal2jd(2003, 9, 7)
    fraction = erfa.tf2d("+", 15, 12, 9.000001)
    tag = TimeTag(int(mjd), (15 * 3600 + 12 * 60 + 9) * 10**9 + 1000)
    assert tag.day == 52889
    assert float(tag.mjd) == pytest.approx(52889 + float(fraction), abs=1e-11)


def test_batches_carry_and_give_single_instants():
    tags = TimeTag(np.array([1, 2]), np.array([-1, PER_DAY]))
    assert tags.day.tolist() == [0, 3]
    assert tags[1].text() == "3.00000000000"
    assert TimeTag(10, 0).after([-0.25, 0.128]).nanoseconds.tolist() == [PER_DAY - 250_000_000, 128_000_000]
    assert tags.__sub__(3) is NotImplemented


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TimeTag(52889.5, 0), "not whole numbers"),
        (lambda: TimeTag(2_452_889, 0), "outside 0 to 106000"),
        (lambda: TimeTag.parse("2003-09-07"), "is not a Modified Julian Day"),
        (lambda: TimeTag.parse("1e5"), "is not a Modified Julian Day"),
        (lambda: TimeTag.parse("x" * 99), r"x\.\.\.' is not"),
        (lambda: TimeTag.from_mjd(np.nan), "mjd nan is outside"),
        (lambda: TimeTag(1, 0).after(np.inf), "inf s is not a span"),
        (lambda: TimeTag(1, 0).after([1.0, np.inf]), "inf s is not a span"),
        (lambda: TimeTag(52889, 2**64 - 1), "is too large"),
        (lambda: TimeTag(2**64 - 1, 0), "is too large"),
        (lambda: TimeTag(1, 0).text(31), "decimals = 31"),
        (lambda: TimeTag(np.array([1, 2]), 0).text(), "no single text"),
        (lambda: tag_step(-1), "decimals = -1"),
    ],
)
def test_invalid_instants_are_refused(call, message):
    with pytest.raises(ValidityError, match=message):
        call()


def test_times_as_people_write_them_are_utc_unless_they_say_a_zone():
    assert mjd_of("2003-09-10T14:00:00Z") == mjd_of("2003-09-10T14:00:00") == mjd_of("2003-09-10T10:00:00-04:00")
    assert mjd_of("2003-09-10T14:00:00Z") == pytest.approx(52_892 + 14 / 24, abs=1e-10)
    assert utc_text(mjd_of("2003-09-10T14:00:00Z")) == "2003-09-10T14:00:00Z"
    with pytest.raises(ValidityError, match="'noon' is neither an MJD nor a time"):
        mjd_of("noon")
