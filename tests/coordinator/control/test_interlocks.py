"""Checks between parameters of a set."""

import pytest

from catseye.coordinator.control import interlocks
from catseye.errors import InputError
from catseye.ranger.head import SamplingSettings

USUAL = {
    "mode": "active",
    "dropped": "none",
    "round_s": "10",
    "rate_hz": "20",
    "reference_every_s": "60",
    "benchmark_every_s": "120",
    "cycles": "128",
    "samples_per_cycle": "64",
    "if_hz": "1000",
    "sun_cone_deg": "5",
}


def test_sampling_has_the_limits_of_a_ranger():
    assert interlocks.sampling_of_values(USUAL) == SamplingSettings()
    with pytest.raises(InputError, match="1200 cycles of 64 samples are 76800 words"):
        interlocks.sampling_of_values(USUAL | {"cycles": "1200"})
    with pytest.raises(InputError, match="128000 samples a second"):
        interlocks.sampling_of_values(USUAL | {"if_hz": "2000"})


def refuse_times(values):
    interlocks.refuse_short_round(values, settle=0.35)
    interlocks.refuse_low_rate(values)
    interlocks.refuse_frequent_standards(values)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"cycles": "1000", "round_s": "4"}, "round_s = 4 s holds no 4 shots of 1 s"),
        ({"rate_hz": "0.05"}, "rate_hz = 0.05 gives no shot in round_s = 10"),
        ({"reference_every_s": "9"}, "reference_every_s = 9 is shorter than round_s = 10"),
    ],
)
def test_times_fit_into_a_round(changed, words):
    refuse_times(USUAL)
    with pytest.raises(InputError, match=words):
        refuse_times(USUAL | changed)


def test_active_mode_needs_a_ranger():
    interlocks.refuse_all_dropped(USUAL | {"dropped": "ZY101"}, 2)
    interlocks.refuse_all_dropped(USUAL | {"dropped": "ZY101 ZY102", "mode": "hold"}, 2)
    with pytest.raises(InputError, match="all 2 rangers in dropped"):
        interlocks.refuse_all_dropped(USUAL | {"dropped": "ZY101 ZY102"}, 2)


def test_passive_mode_and_the_recorded_cone_are_respected():
    interlocks.refuse_while_passive(USUAL | {"mode": "passive"}, SamplingSettings())
    with pytest.raises(InputError, match="mode = passive"):
        interlocks.refuse_while_passive(USUAL | {"mode": "passive", "cycles": "64"}, SamplingSettings())
    interlocks.refuse_smaller_cone(USUAL, 5.0)
    with pytest.raises(InputError, match="sun_cone_deg = 5 is below the record's 6"):
        interlocks.refuse_smaller_cone(USUAL, 6.0)


def test_refusal_of_an_interlock_is_its_text():
    lock = interlocks.SetInterlock(("rate_hz", "round_s"), "a round has a shot", interlocks.refuse_low_rate)
    assert lock.refusal(USUAL) is None
    assert lock.refusal(USUAL | {"rate_hz": "0.05"}).startswith("rate_hz = 0.05 gives no shot")
