"""Counts of a mirror: the printed equations, the turns, the stops, and which pointing is taken."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.mirror import encoder

azimuths = st.integers(-2_400_000, 2_400_000).map(lambda n: n / 8)  # counts; so that whole turns are exact


def test_a_count_of_azimuth_is_12_96_and_of_elevation_25_92_arc_seconds_of_the_beam():
    arcsecond = np.pi / 648000
    assert encoder.azimuth_angle(1.0, 0.0) / arcsecond == pytest.approx(12.96, rel=1e-12)
    assert encoder.elevation_angle(1.0, 0.0) / arcsecond == pytest.approx(25.92, rel=1e-12)


def test_the_six_equations_as_printed():
    theta, phi, na0, ne0 = 1.1, 2.2, -4195.0, -4935.0
    na, ne = encoder.azimuth_counts(theta, na0), encoder.elevation_counts(phi, ne0)
    assert na == pytest.approx(1e5 * theta / (2 * np.pi) + na0, abs=1e-9)
    assert ne == pytest.approx(1e5 * phi / (4 * np.pi) + ne0, abs=1e-9)
    assert encoder.autocollimation_counts(phi, ne0) == pytest.approx(1e5 * phi / (2 * np.pi) + ne0, abs=1e-9)
    assert encoder.back_retro_counts(phi, ne0) == pytest.approx(1e5 * phi / (2 * np.pi) + ne0 + 5e4, abs=1e-9)
    assert encoder.prime_counts(na, ne, ne0) == (pytest.approx(na + 50_000), pytest.approx(2 * ne0 - ne))


@given(azimuths, azimuths, st.integers(8, 1_600_000).map(lambda n: n / 8))
def test_whole_turns_bring_a_count_between_the_stops_whenever_any_can(na, low, span):
    moved, high = float(encoder.turned_within(na, low, low + span)), low + span
    turns = (moved - na) / 1e5
    assert turns == pytest.approx(round(turns), abs=1e-9)
    reachable = [k for k in range(-8, 9) if low <= na + 1e5 * k <= high]
    if reachable:
        assert low <= moved <= high
        assert abs(turns) <= min(abs(k) for k in reachable) + 1e-9
    else:
        assert moved == na


def test_both_stops_are_allowed_and_nothing_beyond_them():
    assert encoder.within([-21309, -21309.001, 75691, 75691.001], -21309, 75691).tolist() == [True, False, True, False]
    assert not encoder.within(np.nan, -1, 1)


@given(azimuths, st.floats(-25e3, 25e3), azimuths, st.integers(0, 200_000), st.booleans(), azimuths)
def test_the_chosen_counts_are_within_the_stops(na, ne, low, span, standing, current):
    prime = np.stack(encoder.prime_counts(na, ne, 100.0))
    where = np.array([current, 0.0]) if standing else None
    chosen = encoder.choice([na, ne], prime, low=low, high=low + span, current=where)
    if chosen.allowed:
        assert low <= chosen.counts[0] <= low + span
        turns = (chosen.counts[0] - (prime if chosen.prime else [na])[0]) / 1e5
        assert turns == pytest.approx(round(float(turns)), abs=1e-6)
        assert chosen.counts[1] == (prime[1] if chosen.prime else ne)
    else:
        assert np.isnan(chosen.counts).all()
        for pointing in (na, prime[0]):
            assert not any(low <= pointing + 1e5 * k <= low + span for k in range(-9, 10))


def test_the_direct_pointing_wins_where_it_may_and_the_sooner_one_where_the_mirror_stands():
    direct, prime = [10_000.0, 9000.0], [60_000.0, -9000.0]
    limits = {"low": -24_000, "high": 73_000}
    assert not encoder.choice(direct, prime, **limits).prime
    assert encoder.choice(direct, prime, **limits, current=[59_000.0, -8000.0]).prime
    # 24 000 or 26 000 counts of azimuth; then 30 000 or 20 000, and 500 of the elevation, which is quicker
    assert not encoder.choice(direct, prime, **limits, current=[34_000.0, 9000.0]).prime
    assert encoder.choice([10_000, 9000], [60_000, 9500], **limits, current=[40_000.0, 9000.0], speeds=(1e4, 1e5)).prime


def test_a_nearer_turn_is_taken_where_the_stops_are_more_than_a_turn_apart():
    chosen = encoder.choice([10_000.0, 0.0], [60_000.0, 0.0], low=-1e5, high=2e5, current=[115_000.0, 0.0])
    assert chosen.counts.tolist() == [110_000.0, 0.0]


@example(na=60_000.0, low=-150_000.0, span=400_000, share=0.9975)  # a turn nearer would be beyond the stop
@given(azimuths, azimuths, st.integers(0, 600_000), st.floats(0.0, 1.0))
def test_of_several_turns_between_the_stops_the_nearest_to_where_the_mirror_stands_is_taken(na, low, span, share):
    current = low + share * span
    pointing = [na, 0.0]
    chosen = encoder.choice(pointing, pointing, low=low, high=low + span, current=[current, 0.0])
    reachable = [na + 1e5 * k for k in range(-12, 13) if low <= na + 1e5 * k <= low + span]
    if reachable:
        assert abs(chosen.counts[0] - current) == pytest.approx(min(abs(n - current) for n in reachable), abs=1e-6)


def test_speeds_without_meaning_are_refused():
    with pytest.raises(ValidityError, match=r"speeds \[0.0, 1.0\] are not two numbers above 0"):
        encoder.choice([0.0, 0.0], [5e4, 0.0], low=-1, high=1, current=[0.0, 0.0], speeds=(0.0, 1.0))
