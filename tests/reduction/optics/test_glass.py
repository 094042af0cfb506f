"""Glass at a temperature: verdict by the limits of the expansion, errors of another glass."""

import pytest

from catseye.errors import ArgumentError, ValidityError
from catseye.optics.glass import GLASSES
from catseye.optics.retroreflector.warm_prism import EXPANSION_C
from catseye.reduction.optics.glass import glass_state


def test_beyond_the_expansion_s_limits_a_glass_is_doubtful():
    inside = glass_state("BK7-old", 0.78, EXPANSION_C[0], height_mm=38.1)
    outside = glass_state("BK7-old", 0.78, EXPANSION_C[0] - 0.1, height_mm=38.1)
    assert (inside.verdict.word, outside.verdict.word) == ("good", "doubtful")
    assert "expansion of BK7-old" in outside.verdict.why


def test_exchanged_glasses_err_by_opposite_indices():
    one, other = (glass_state(name, 0.78, 20.0, height_mm=38.1) for name in ("BK7-old", "fused-silica"))
    there, back = one.others["fused-silica"], other.others["BK7-old"]
    assert there.group_index == pytest.approx(-back.group_index, rel=1e-12)
    assert there.phase_index == pytest.approx(-back.phase_index, rel=1e-12)
    assert set(one.others) == set(GLASSES) - {"BK7-old"}


def test_metres_typed_as_millimetres_and_unknown_glasses_are_refused():
    with pytest.raises(ArgumentError, match="height_mm = 0\\.038"):
        glass_state("BK7-old", 0.78, 20.0, height_mm=0.038)
    with pytest.raises(ValidityError, match="unknown"):
        glass_state("window", 0.78, 20.0, height_mm=38.1)
