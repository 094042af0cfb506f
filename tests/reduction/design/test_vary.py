"""Variations in words."""

import pytest

from catseye.errors import InputError
from catseye.reduction.design.vary import USUAL_WITHIN, variations


@pytest.mark.parametrize(
    ("text", "role", "pattern", "number", "within", "between"),
    [
        ("rangers", "ranger", "", None, USUAL_WITHIN, None),
        ("ranger ZY107 within 20 m", "ranger", "ZY107", None, 20.0, None),
        ("ranger ZY10* within 2.5m between 60 and 120 m", "ranger", "ZY10*", None, 2.5, (60.0, 120.0)),
        ("rangers from 12 to 16 between 80 and 160 m", "ranger", "", (12, 16), None, (80.0, 160.0)),
        ("targets from 5 to 9", "target", "", (5, 9), None, None),
        ("  target   TR*  within 1 m ", "target", "TR*", None, 1.0, None),
    ],
)
def test_words_say_what_varies(text, role, pattern, number, within, between):
    (variation,) = variations([text])
    assert (variation.role, variation.pattern) == (role, pattern)
    assert (variation.number, variation.within, variation.between) == (number, within, between)
    assert variation.moves == (within is not None or between is not None)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("mirrors within 3 m", "not understood"),
        ("ranger within 3 m", "names no ranger"),
        ("rangers ZY107 within 3 m", "expected ranger NAME"),
        ("rangers within 3", "not understood"),
        ("rangers within 0 m", "above 0"),
        ("rangers from 9 to 5", "rising"),
        ("rangers from 0 to 5", "1 or more"),
        ("rangers between 50 and 50 m", "rising"),
        ("rangers within 20000 m", "at most 10000"),
    ],
)
def test_other_words_are_refused_with_what_is_expected(text, why):
    with pytest.raises(InputError, match=why):
        variations([text])


def test_nothing_to_vary_is_refused():
    with pytest.raises(InputError, match="nothing to vary"):
        variations([])


def test_a_plural_is_about_rangers_on_the_ground_and_a_name_about_any():
    plural, single = variations(["rangers", "ranger ZY11*"])
    assert plural.selects("ZY101", "ranger", True)
    assert not plural.selects("ZY113", "ranger", False)
    assert single.selects("ZY113", "ranger", False)
    assert not single.selects("ZY101", "ranger", True)
    assert not single.selects("ZY113", "target", False)
