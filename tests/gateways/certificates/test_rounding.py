"""Numbers of certificates: two digits of U, rounded up, and the value to the same place."""

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.gateways.certificates.rounding import rounded_result, rounded_up


@pytest.mark.parametrize(
    ("value", "u", "k", "said"),
    [
        (1.23456, 0.0498, 2.0, ("1.23", "0.050", "0.10")),  # 0.0996 is rounded up to one digit fewer
        (1.25, 0.5, 2.0, ("1.2", "0.50", "1.0")),  # half to even
        (1.35, 0.5, 2.0, ("1.4", "0.50", "1.0")),
        (-0.004, 0.05, 2.0, ("0.00", "0.050", "0.10")),  # no minus zero
        (12345.6, 612.0, 2.0, ("12300", "620", "1300")),
        (56789.0, 60.0, 2.0, ("56790", "60", "120")),
        (180.685, 0.006, 2.0, ("180.685", "0.0060", "0.012")),  # exact: not rounded up for a last bit
        (1.0, 0.0505, 2.0, ("1.00", "0.051", "0.11")),
        (3e-6, 4.053e-6, 2.01153, ("0.0000030", "0.0000041", "0.0000082")),
        (1.5, 0.0, 2.0, ("1.5", "0", "0")),
        (1.5, float("nan"), 2.0, ("1.5", "unknown", "unknown")),
        (float("nan"), 0.1, 2.0, ("–", "unknown", "unknown")),
    ],
)
def test_results_by_hand(value, u, k, said):
    assert rounded_result(value, u, k) == said


@given(st.floats(1e-12, 1e9), st.floats(-1e9, 1e9), st.floats(2.0, 12.0))
def test_rounding_never_understates_and_moves_a_value_by_half_a_place_at_most(u, value, k):
    said = rounded_result(value, u, k)
    expanded = Decimal(said.expanded)
    assert float(expanded) >= k * u * (1.0 - 1e-11)
    assert float(expanded) <= k * u * 1.1 * (1.0 + 1e-11)  # the second digit of 1.0 is a tenth
    place = Decimal(1).scaleb(rounded_up(k * u).as_tuple().exponent)
    assert abs(Decimal(said.value) - Decimal(repr(value))) <= place / 2
    assert "E" not in "".join(said)
