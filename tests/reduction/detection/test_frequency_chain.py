"""Frequencies of a ranger: printed numbers of the notes, and each effect by plain samples."""

import numpy as np
import pytest

from catseye.errors import ArgumentError
from catseye.reduction.detection.frequency_chain import frequency_chain, limits
from catseye.signal.detection.phase import detect

USUAL = {
    "reference_hz": 100e6,
    "multiple": 15,
    "oscillator": "above",
    "intermediate_hz": 1000.0,
    "samples_per_cycle": 64,
    "cycles": 128,
    "wavelength_um": 0.780,
    "temperature_c": 20.0,
    "pressure_hpa": 933.0,
    "humidity_percent": 50.0,
    "air_model": "rueger1990",
    "disturbance": 0.001,
}


def test_the_printed_numbers_of_the_notes():
    chain = frequency_chain(**USUAL)
    assert chain.plan.modulation_hz == 1.5e9
    assert chain.local_oscillator_hz == 1_500_001_000.0  # 5.3: LO=1500.001 MHz, phase falls
    assert chain.plan.phase_sign == -1
    assert chain.disturbance.range_error == pytest.approx(15.9e-6, abs=0.05e-6)  # 5.8 prints 15.9 um at 1000:1
    assert 2.0 * chain.half_wavelength == pytest.approx(0.199811037, abs=1e-9)  # 1.27-1.30
    carrier, lower, upper = (v / 1e9 for v in (chain.bands.carrier_hz, chain.bands.lower_hz, chain.bands.upper_hz))
    # 1.2 prints 384 615.3, that is 3e8/780e-9; with c it is
    assert carrier == pytest.approx(299792.458 / 0.780, abs=1e-6)
    assert (upper - carrier, carrier - lower) == pytest.approx((1.5, 1.5), abs=1e-6)


def test_two_sidebands_have_the_group_index():
    """[PARKER04] 1.2: the envelope of two sidebands travels with n_g; their rounding is 3e-14."""
    for model in ("rueger1990", "ciddor_hill1999"):
        chain = frequency_chain(**(USUAL | {"air_model": model}))
        assert 1.0 + chain.bands.refractivity == pytest.approx(chain.group_index, abs=1e-12)


def test_a_disturbance_turns_the_phase_of_samples_as_told():
    """Samples of signal and disturbance through the detection, in quadrature and at all phases."""
    chain = frequency_chain(**(USUAL | {"disturbance": 0.05}))
    x = 2.0 * np.pi * np.arange(640) / 64
    per_radian = chain.half_wavelength / (2.0 * np.pi)
    quadrature = detect(np.cos(x) + 0.05 * np.cos(x - np.pi / 2), 64).phase
    assert chain.disturbance.phase_error == pytest.approx(float(quadrature), rel=1e-12)
    all_round = np.linspace(0.0, 2.0 * np.pi, 3601)[:-1, None]
    turned = np.angle(detect(np.cos(x) + 0.05 * np.cos(x - all_round), 64).phasor)
    assert chain.disturbance.worst == pytest.approx(np.max(turned) * per_radian, rel=1e-6)
    assert chain.disturbance.rms == pytest.approx(np.sqrt(np.mean(turned**2)) * per_radian, rel=1e-6)


def test_a_second_path_is_at_most_the_worst_and_a_quarter_wavelength_away_in_quadrature():
    quarter = frequency_chain(**USUAL).half_wavelength / 2.0
    chain = frequency_chain(**USUAL, excess_path=quarter)
    assert chain.multipath == pytest.approx(chain.disturbance.range_error, rel=1e-9)
    assert frequency_chain(**USUAL).multipath is None
    assert frequency_chain(**USUAL, excess_path=2.0 * quarter).multipath == pytest.approx(0.0, abs=1e-12)


def test_a_moving_target_is_where_it_was_in_the_middle_of_the_buffer():
    chain = frequency_chain(**USUAL, range_rate=0.010)
    assert float(chain.motion.range_since_trigger) == pytest.approx(0.01 * 8191 / 2 / 64e3, rel=1e-12)
    j = np.arange(8192)
    distance = 0.010 * j / 64e3
    phase = -2.0 * np.pi * distance / chain.half_wavelength + 1.0
    found = detect(np.cos(2.0 * np.pi * j / 64 - phase), 64)
    moved = -(np.angle(found.phasor) - 1.0) / (2.0 * np.pi) * chain.half_wavelength
    image = float(chain.motion.phase_bias_bound) / (2.0 * np.pi) * chain.half_wavelength
    assert image < 1e-6
    assert float(moved) == pytest.approx(float(chain.motion.range_since_trigger), abs=image)
    assert float(found.amplitude) == pytest.approx(float(chain.motion.amplitude_factor), abs=1e-4)  # its image


def test_an_oscillator_below_is_doubtful():
    chain = frequency_chain(**(USUAL | {"oscillator": "below"}))
    assert chain.local_oscillator_hz == 1_499_999_000.0
    assert chain.verdict.word == "doubtful"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cycles": 2000}, "the buffer holds 65536"),
        ({"intermediate_hz": 5000.0}, "the converter takes 100000"),
        ({"intermediate_hz": 20_000.0}, "at most 10000 Hz"),
        ({"samples_per_cycle": 2}, "samples a cycle 2"),
        ({"reference_hz": -1.0}, "reference frequency"),
        ({"disturbance": 1.0}, "disturbance = 1.0"),
    ],
)
def test_what_no_converter_can_do_is_refused(change, said):
    with pytest.raises(ArgumentError, match=said):
        frequency_chain(**(USUAL | change))


def test_the_limits_are_those_of_the_board():
    assert limits() == {"buffer_samples": 65_536, "sample_rate_hz": 100_000.0, "intermediate_hz": 10_000.0}
