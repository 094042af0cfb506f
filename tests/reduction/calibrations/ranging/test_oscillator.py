"""The oscillator test on made phases: what was planted comes out, in ranges too."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.calibrations.ranging.oscillator import KIND, OscillatorSheet, measure_oscillator
from reduction.calibrations.length_scene import readings


def phases(seed=1, spur=2e-3):
    rng = np.random.default_rng(seed)
    time = np.arange(8192) * 1e-3
    return 3.0 + 0.01 * rng.normal(size=8192) + spur * np.sin(2 * np.pi * 57.0 * time)


def test_noise_spur_and_the_range_that_averages_128_cycles():
    found = measure_oscillator(readings(OscillatorSheet, KIND, numbers={"phase_rad": phases()}, interval_s=0.001))
    assert found.value("white_mrad2") == pytest.approx(100.0, abs=4 * found.u("white_mrad2"))
    expected = 0.01 / np.sqrt(128) * 99.93e3 / (2 * np.pi)  # µm
    assert found.value("white_range_um") == pytest.approx(expected, abs=4 * found.u("white_range_um"))
    assert not found.decisions[0].passed
    assert "57" in found.decisions[0].text
    quiet = measure_oscillator(
        readings(OscillatorSheet, KIND, numbers={"phase_rad": phases(spur=0.0)}, interval_s=0.001)
    )
    assert quiet.decisions[0].passed


def test_phases_that_wrap_are_unwrapped():
    plain = readings(OscillatorSheet, KIND, numbers={"phase_rad": phases() + 3.2}, interval_s=0.001)
    wrapped = readings(
        OscillatorSheet, KIND, numbers={"phase_rad": np.mod(phases() + 3.2, 2 * np.pi)}, interval_s=0.001
    )
    assert measure_oscillator(wrapped).value("white_mrad2") == pytest.approx(
        measure_oscillator(plain).value("white_mrad2"), rel=1e-6
    )


def test_series_with_holes_or_too_short_are_refused():
    left_out = ("",) * 99 + ("bump",)
    holed = readings(OscillatorSheet, KIND, numbers={"phase_rad": phases()[:100]}, left_out=left_out, interval_s=0.001)
    with pytest.raises(InputError, match="line 101, is left out"):
        measure_oscillator(holed)
    with pytest.raises(InputError, match="at least 64"):
        measure_oscillator(readings(OscillatorSheet, KIND, numbers={"phase_rad": phases()[:20]}, interval_s=0.001))


def test_a_drifting_phase_is_noted_and_alternating_readings_make_no_infinite_figure():
    drifting = phases(spur=0.0) + 0.5 * np.arange(8192) * 1e-3
    found = measure_oscillator(readings(OscillatorSheet, KIND, numbers={"phase_rad": drifting}, interval_s=0.001))
    assert found.decisions[0].passed
    assert any("drift of +0.5 rad/s" in note for note in found.notes)
    alternating = readings(OscillatorSheet, KIND, numbers={"phase_rad": np.arange(256) % 2 * 1e-3}, interval_s=0.001)
    for x, y in measure_oscillator(alternating).curve.values():
        assert np.all(np.isfinite([x, y]))


def test_u_of_the_noise_of_a_range_and_the_table_and_line_of_averages_by_hand():
    found = measure_oscillator(
        readings(OscillatorSheet, KIND, numbers={"phase_rad": phases(spur=0.0)}, interval_s=0.001)
    )
    relative = found.u("white_mrad2") / found.value("white_mrad2")
    assert found.u("white_range_um") == pytest.approx(0.5 * relative * found.value("white_range_um"), rel=1e-9)
    first = dict(zip(found.columns, found.rows[0], strict=True))
    assert first["range_um"] == pytest.approx(first["allan_deviation_rad"] * 99.93e3 / (2 * np.pi), rel=1e-9)
    time, height = found.curve["fit"]
    assert height[0] == pytest.approx(-2.0, abs=0.01)  # 10 mrad
    # [RILEY08] table 3 with the walk in steps: white^2/m + walk^2 (2 m^2 + 1)/(6 m)
    m = 10**time / 0.001
    flicker = found.value("flicker_mrad2")  # 2 h at one reading, 2 ln 2 h of many [RILEY08], within 2 % between
    by_hand = 1e-6 * (found.value("white_mrad2") / m + found.value("walk_mrad2") * (2 * m**2 + 1) / (6 * m))
    by_hand[0] += 2e-6 * flicker
    by_hand[1:] += 2e-6 * np.log(2) * flicker
    assert height == pytest.approx(0.5 * np.log10(by_hand), abs=1e-3)  # flicker is 1 % of the last: 2 % of that


def test_the_line_of_averages_holds_the_walk_that_the_readings_show():
    rng = np.random.default_rng(8)
    walking = 0.012 * rng.standard_normal(8192) + np.cumsum(2e-4 * rng.standard_normal(8192))
    found = measure_oscillator(readings(OscillatorSheet, KIND, numbers={"phase_rad": walking}, interval_s=0.001))
    shown, line = 10 ** found.curve["readings"][1], 10 ** found.curve["fit"][1]
    white = 0.012 / np.sqrt(10 ** found.curve["fit"][0] / 0.001)
    assert shown[-1] > 3.0 * white[-1]  # where white noise alone would be far below the readings
    for row, middle in zip(found.rows, line, strict=True):
        _, _, _, low, high, *_ = row
        assert 0.8 * low < middle < 1.25 * high  # the limits hold 19 of 20; averages of one series go together
