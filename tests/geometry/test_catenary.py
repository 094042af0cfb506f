"""The hanging wire against an integration of its equations, the surveyors' series, and limits without weight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.catenary import expanded, span, unstretched

WIRE = {"weight_per_metre": 0.17, "stiffness": 4.1e5}


def integrated(length, tension, w, ea, slope_at_a):
    """Where the far end comes to, step by step, of a wire that leaves A under a slope; independent of closed forms."""
    from scipy.integrate import solve_ivp

    h, v = tension * np.cos(slope_at_a), tension * np.sin(slope_at_a)

    def grow(s, _):
        t = np.hypot(h, v + w * s)
        return [(h / t) * (1 + t / ea), ((v + w * s) / t) * (1 + t / ea)]

    return solve_ivp(grow, (0.0, length), [0.0, 0.0], rtol=1e-12, atol=1e-14).y[:, -1]


@pytest.mark.parametrize("slope", [-0.4, -0.02, 0.0, 0.3])
@pytest.mark.parametrize(("length", "w"), [(24.0, 0.17), (100.0, 0.3)])
def test_the_far_end_is_where_integration_puts_it(slope, length, w):
    x, z = integrated(length, 120.0, w, 4.1e5, slope)
    found = span(length, tension=120.0, weight_per_metre=w, stiffness=4.1e5, height_difference=z)
    assert found == pytest.approx(x, abs=2e-9)


def test_a_level_wire_has_the_surveyors_sag_and_stretch():
    found = float(span(24.0, tension=100.0, **WIRE))
    stretched = 24.0 * (1 + 100.0 / 4.1e5)
    sag = -(0.17**2) * 24.0**3 / (24.0 * 100.0**2)
    assert found == pytest.approx(stretched + sag, abs=3e-6)  # next term: sag^2/L and sag times stretch


def test_a_wire_without_weight_is_straight():
    straight = 30.0 * (1 + 80.0 / 4.1e5)
    found = span(30.0, tension=80.0, weight_per_metre=0.0, stiffness=4.1e5, height_difference=3.0)
    assert found == pytest.approx(np.sqrt(straight**2 - 9.0), abs=1e-12)
    light = span(30.0, tension=80.0, weight_per_metre=1e-9, stiffness=4.1e5, height_difference=3.0)
    assert light == pytest.approx(float(found), abs=1e-9)


@given(st.floats(5, 60), st.floats(40, 200), st.booleans())
def test_a_certified_wire_hung_as_certified_gives_its_certified_length(length, tension, hanging):
    free = unstretched(length, tension=tension, **WIRE, hanging=hanging)
    if hanging:
        assert float(span(free, tension=tension, **WIRE)) == pytest.approx(length, abs=1e-11 * length)
    else:
        assert free * (1 + tension / WIRE["stiffness"]) == pytest.approx(length, rel=1e-15)


def test_temperature_and_impossible_wires():
    assert expanded(24.0, 30.0, 0.6e-6) == pytest.approx(24.000144)
    with pytest.raises(ValidityError, match="cannot join"):
        span(10.0, tension=50.0, height_difference=11.0, **WIRE)
    with pytest.raises(ValidityError, match="tension"):
        span(10.0, tension=0.0, **WIRE)
