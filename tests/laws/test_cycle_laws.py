"""Laws of whole cycles: of one shot, of several frequencies, of several rangers."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from catseye.estimation.ambiguity.search import AmbiguityStatus, locate
from catseye.signal.cycles.joint_length import JointStatus, joint_length
from catseye.signal.cycles.whole import decision, fraction, memo_whole_cycles, slip_probability, unwrapped_length

half_wavelengths = st.floats(0.01, 1.0)
lengths = st.floats(1.0, 300.0)
shares = st.floats(-0.499, 0.499)


@given(lengths, half_wavelengths, shares, st.floats(0.0, 0.09))
def test_a_coarse_error_and_five_u_of_phase_within_a_quarter_wave_find_the_right_cycle(length, half, share, u_phase):
    room = 0.5 * half - 5 * u_phase * half / (2 * np.pi)
    phase = fraction(-2 * np.pi * length / half + 4.99 * u_phase * np.sign(share), 0.0)  # the worst sign
    d = decision(length + 2 * share * room, phase, half, u_coarse=0.0, u_phase=u_phase)
    off = unwrapped_length(d.cycles, phase, half) - length
    assert abs(off) <= 5 * u_phase * half / (2 * np.pi) + 1e-9


@given(lengths, half_wavelengths, shares, st.floats(0.0, 0.3), st.floats(0.0, 0.3))
def test_a_worse_coarse_length_is_never_surer(length, half, share, u, more):
    phase = fraction(-2 * np.pi * length / half, 0.0)
    one, other = (decision(length + share * half, phase, half, u_coarse=v * half, u_phase=0.001) for v in (u, u + more))
    assert one.cycles == other.cycles
    assert other.slip_probability >= one.slip_probability - 1e-9
    assert one.thin <= other.thin


@given(half_wavelengths, shares, st.floats(0.001, 20.0), st.floats(0.1, 10.0))
def test_the_probability_of_a_slip_is_independent_of_unit_and_direction(half, share, u, scale):
    one = slip_probability(share * half, u * half, half)
    assert 0.0 <= one <= 1.0
    np.testing.assert_allclose(slip_probability(-share * half, u * half, half), one, rtol=1e-6, atol=1e-12)
    scaled = slip_probability(scale * share * half, scale * u * half, scale * half)
    np.testing.assert_allclose(scaled, one, rtol=1e-6, atol=1e-12)


@given(st.floats(2.0, 100.0), st.floats(0.0, 6.28), st.floats(0.0, 0.04))
def test_the_memos_rule_slips_exactly_where_a_multiple_lies_between_coarse_and_true_length(length, zrg, short):
    half = 0.0999
    phase = float(fraction(zrg - 2 * np.pi * length / half, 0.0)) - zrg
    places = np.array([length, length - short]) / half
    assume(np.all(np.abs(places - np.rint(places)) > 1e-9))
    slip = np.rint((unwrapped_length(memo_whole_cycles(length - short, phase, half), phase, half) - length) / half)
    assert slip == np.floor(places[1]) - np.floor(places[0])


@settings(max_examples=30)
@given(st.floats(5.0, 140.0), st.floats(1.0, 1.0005), st.permutations([0, 1, 2, 3]))
def test_the_order_of_the_frequencies_does_not_matter(length, n, order):
    f = np.array([1500e6, 1501e6, 1507e6, 1530e6])[list(order)]
    phase = np.mod(-4 * np.pi * f * n * length / 299_792_458.0, 2 * np.pi)
    found = joint_length(phase, f, u_phase=1e-3, within=(4.0, 141.0), group_index=n)
    assert found.status == JointStatus.FOUND
    assert abs(found.length - length) < 1e-8


def scene(seed, ranges=6):
    rng = np.random.default_rng(seed)
    away = rng.normal(size=(ranges, 3))
    stations = away / np.linalg.norm(away, axis=1)[:, None] * rng.uniform(50.0, 120.0, (ranges, 1))
    point = rng.uniform(-0.2, 0.2, 3)
    return stations, point, np.linalg.norm(stations - point, axis=1)


@settings(max_examples=25)
@given(st.integers(0, 1000), st.floats(-200.0, 200.0), st.permutations(range(6)), st.integers(-5, 5))
def test_a_search_moves_with_its_stations_in_any_order_and_knows_no_whole_periods(seed, shift, order, whole):
    stations, point, distance = scene(seed)
    half, c = 0.0999, np.full(6, 1e-8)
    one = locate(np.zeros(3), 0.01 * np.eye(3), stations, lengths=np.mod(distance, half), period=half, covariance=c)
    order = list(order)
    other = locate(
        np.full(3, shift),
        0.01 * np.eye(3),
        stations[order] + shift,
        lengths=np.mod(distance, half)[order] + whole * half,
        period=half,
        covariance=c,
    )
    assert one.status is other.status
    assume(one.status is AmbiguityStatus.FOUND)
    np.testing.assert_allclose(other.x - shift, one.x, rtol=0, atol=1e-8)
    np.testing.assert_allclose(one.x, point, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(other.cycles + whole, one.cycles[order])
