"""Units and the motion chip's integers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.ranger import motion_units as units
from catseye.records.site.mirror import MirrorGeometry


def test_data_sheet_example():
    """[TEXAS13] page 11: 500 lines, 600 rpm, 1 turn/s^2; it takes 341 us for the sample time."""
    sample = 341e-6
    assert units.velocity_integer(10 * 2000, sample) == 446_956 == 0x0006D1EC
    assert units.acceleration_integer(2000, sample) == 15


def test_exact_sample_time_changes_the_integer_of_600_rpm():
    assert units.velocity_integer(10 * 2000) == 447_392  # 2e4 * 2048/6e6 * 65536 = 447 392.4
    assert units.acceleration_integer(2000) == 15  # 15.27
    assert pytest.approx(341.3333e-6, abs=1e-10) == units.SAMPLE_TIME


@given(st.floats(1.0, 4e7), st.floats(256e-6, 1e-3))
def test_speeds_survive_the_round_trip_within_half_a_unit(speed, sample):
    if speed * sample * units.FRACTION > units.LARGEST_RATE:
        with pytest.raises(ValidityError, match="ABV: velocity"):
            units.velocity_integer(speed, sample)
        return
    back = units.velocity_counts(units.velocity_integer(speed, sample), sample)
    assert abs(back - speed) <= 0.5 / units.FRACTION / sample * (1 + 1e-9)


@given(st.floats(200.0, 1e9), st.floats(256e-6, 1e-3))
def test_accelerations_survive_the_round_trip_within_half_a_unit(rate, sample):
    back = units.acceleration_counts(units.acceleration_integer(rate, sample), sample)
    assert abs(back - rate) <= 0.5 / units.FRACTION / sample**2 * (1 + 1e-9)


@pytest.mark.parametrize("command", units.LIMITS)
def test_limits_are_accepted_and_the_next_value_refused(command):
    limits = units.LIMITS[command]
    assert units.checked(command, limits.low) == limits.low
    assert units.checked(command, limits.high) == limits.high
    for beyond in (limits.low - 1, limits.high + 1):
        with pytest.raises(ValidityError) as refused:
            units.checked(command, beyond)
        text = str(refused.value)
        assert text.startswith(f"{command}: {limits.name} {beyond} is outside {limits.low} to {limits.high}")
        assert "\n" not in text


@pytest.mark.parametrize("value", [1.5, "7", None, True])
def test_non_integers_are_refused(value):
    with pytest.raises(ValidityError, match="is not an integer"):
        units.checked("FKP", value)


def test_velocity_below_the_acceleration_is_refused_with_a_remedy():
    with pytest.raises(ValidityError, match=r"ABA: velocity 9 is below acceleration 10 .*ABV"):
        units.checked_rates("ABA", 9, 10)
    with pytest.raises(ValidityError, match=r"ABV: velocity 9 is below acceleration 10 .*ABA"):
        units.checked_rates("ABV", 9, 10)


@pytest.mark.parametrize("bad", [-1.0, float("nan"), float("inf"), 1e12])
def test_speeds_beyond_the_register_are_refused(bad):
    with pytest.raises(ValidityError, match="ABV: velocity"):
        units.velocity_integer(bad)


def test_speed_too_small_to_move_is_refused_and_zero_is_not():
    with pytest.raises(ValidityError, match="nothing would move"):
        units.velocity_integer(0.01)
    assert units.velocity_integer(0.0) == 0


def test_record_gives_the_speeds_of_the_axes():
    sheet = {"zp": "ZP1", "dx_mm": 0.0, "dy_mm": 250.0, "dz_mm": 0.0, "beta1_rad": 0.0, "beta2_rad": 0.0}
    limits = {"na0": 0, "ne0": 0, "az_low_limit": -20_000, "az_high_limit": 70_000}
    rates = {"abv_0": units.velocity_integer(12_000.0), "aba_0": units.acceleration_integer(40_000.0), "abv_1": 44_739}
    pace = units.pace_of(MirrorGeometry(**sheet, **limits, **rates, aba_1=153))
    assert pace.velocity == pytest.approx((12_000.0, 2000.0), rel=1e-3)
    assert pace.acceleration == pytest.approx((40_000.0, 20_000.0), rel=3e-3)
    with pytest.raises(ValidityError, match=r"ZP1: aba_1 = None \(expected above 0"):
        units.pace_of(MirrorGeometry(**sheet, **limits, **rates))
