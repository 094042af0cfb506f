"""One buffer: three methods, what they claim, and what is wrong with it."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import ArgumentError
from catseye.records.night.buffer import buffer_of, read_buffer
from catseye.reduction.detection.buffer_phase import buffer_phase
from repository import ROOT

TURN = 2.0 * np.pi * np.arange(2048) / 64


def wave(*, phase=2.0, size=4.0, noise=0.1, seed=0, distortion=0.0):
    rng = np.random.default_rng(seed)
    return size * np.cos(TURN - phase) + distortion * size * np.sin(3 * TURN) + rng.normal(0.0, noise, len(TURN))


def test_three_methods_find_the_phase_within_what_they_claim():
    """Sixty buffers of a known phase: rms of error over u within what 60 draws allow, and none beyond 4.5 u."""
    errors = {}
    for seed in range(60):
        truth = 0.1 * seed
        for method in buffer_phase(buffer_of(wave(phase=truth, seed=seed))).methods:
            error = np.angle(np.exp(1j * (method.phase - truth)))
            errors.setdefault(method.name, []).append(error / method.u_phase)
            if method.name != "zero crossings":
                errors.setdefault(f"{method.name}, amplitude", []).append((method.amplitude - 4.0) / method.u_amplitude)
    assert set(errors) > {"synchronous detection", "zero crossings", "spectrum"}
    for name, values in errors.items():
        assert np.max(np.abs(values)) < 4.5, name
        low = 0.4 if name == "zero crossings" else 0.75  # chatter makes several edges, whose mean is better
        assert low < np.std(values) < 1.3, name  # 1 +- 0.09 of 60, three times


def test_differences_are_within_their_uncertainty():
    left = {"zero crossings": [], "spectrum": []}
    for seed in range(60):
        for method in buffer_phase(buffer_of(wave(seed=seed, noise=0.02))).methods[1:]:
            left[method.name].append((method.difference - method.expected_difference) / method.u_difference)
    assert all(0.5 < np.std(values) < 1.4 and np.max(np.abs(values)) < 4.5 for values in left.values())


def test_distortion_moves_zero_crossings_as_expected_and_nothing_else():
    found = buffer_phase(buffer_of(wave(noise=0.005, distortion=0.015)))
    first, crossings, spectrum = found.methods
    assert first.phase == pytest.approx(2.0, abs=4 * first.u_phase)
    assert abs(crossings.difference) > 0.01  # without the harmonics' share the methods would contradict each other
    assert crossings.agrees
    assert spectrum.agrees
    assert found.verdict.word == "good"
    assert found.largest_harmonic.order == 3
    assert found.largest_harmonic.relative == pytest.approx(0.015, abs=4 * found.largest_harmonic.u_relative)
    assert found.largest_harmonic.effect == 0.0
    assert found.largest_harmonic.crossing == pytest.approx(crossings.expected_difference, abs=2e-3)


def test_distortion_above_the_limit_is_doubtful_and_says_which_order():
    found = buffer_phase(buffer_of(wave(distortion=0.05, noise=0.001)))
    assert found.verdict.word == "doubtful"
    assert "harmonic 3 is 5.00" in found.verdict.why


def test_a_method_that_disagrees_is_said():
    method = buffer_phase(buffer_of(wave())).methods[1]
    assert method.agrees
    assert not replace(method, difference=method.difference + 6.0 * method.u_difference).agrees


def test_a_tone_off_its_lock_is_doubtful():
    off = 4.0 * np.cos(TURN * 1.001 - 2.0) + np.random.default_rng(3).normal(0.0, 0.02, len(TURN))
    found = buffer_phase(buffer_of(off))
    assert found.frequency_hz == pytest.approx(1001.0, abs=4 * found.u_frequency_hz)
    assert "instead of 1000: the target moved" in found.verdict.why


def test_silence_and_a_stuck_converter_fail():
    noise = np.random.default_rng(1).normal(0.0, 0.1, 2048)
    silent = buffer_phase(buffer_of(noise)).verdict.why
    assert silent.startswith("no signal")
    assert "strongest tone" not in silent
    assert buffer_phase(buffer_of(np.zeros(2048))).verdict.word == "failed"
    assert buffer_phase(buffer_of(np.full(2048, np.nan))).verdict.word == "failed"


def test_clipping_by_the_converter_is_counted():
    codes = np.clip(np.rint(wave(size=11.0) / 10.0 * 32768), -32768, 32767).astype(np.int16)
    found = buffer_phase(buffer_of(codes))
    assert found.verdict.word == "doubtful"
    assert f"{np.count_nonzero(np.abs(codes + 0.5) > 32767)} samples at the converter's ends" in found.verdict.why
    assert found.detection.clipped == buffer_phase(buffer_of(codes * (10.0 / 32768))).detection.clipped


def test_few_samples_a_cycle_have_no_harmonics_and_still_a_phase():
    x = 2.0 * np.pi * np.arange(400) / 4
    found = buffer_phase(
        buffer_of(np.cos(x - 0.5) + np.random.default_rng(2).normal(0.0, 0.01, 400)), sample_rate_hz=4000.0
    )
    assert found.harmonics == ()
    assert found.largest_harmonic is None
    assert found.methods[0].phase == pytest.approx(0.5, abs=0.005)


def test_one_cycle_has_a_phase():
    found = buffer_phase(buffer_of(wave()), cycles=1)
    assert [method.name for method in found.methods] == ["synchronous detection", "zero crossings"]
    assert found.sampling.cycles == 1


def test_a_shot_of_a_campaign_brings_its_sampling():
    night = ROOT / "examples" / "night-01"
    found = buffer_phase(read_buffer(night, shot=120))
    assert (found.sampling.samples_per_cycle, found.sampling.cycles, found.sampling.intermediate_hz) == (64, 128, 1e3)
    alone = buffer_phase(read_buffer(night / "frames.npy", row=119))
    assert alone.methods[0].phase == found.methods[0].phase
    with pytest.raises(ArgumentError, match="the campaign says it itself"):
        buffer_phase(read_buffer(night, shot=120), intermediate_hz=1000.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"sample_rate_hz": 64_100.0}, "64.1 samples a cycle"),
        ({"sample_rate_hz": 2000.0}, "2 samples a cycle"),
        ({"intermediate_hz": -1.0}, "is not above 0"),
        ({"cycles": 33}, "not within 1 to 32"),
        ({"sample_rate_hz": 3e6}, "less than one cycle"),
        ({"sample_rate_hz": 60_000.0}, "give cycles = 34"),
        ({"bits": 4}, "bits = 4"),
        ({"full_scale_volt": 0.0}, "full_scale_volt"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, said):
    with pytest.raises(ArgumentError, match=said):
        buffer_phase(buffer_of(wave()), **arguments)


def test_codes_beyond_the_converter_are_refused():
    with pytest.raises(ArgumentError, match="code 40000 is beyond a converter of bits = 16"):
        buffer_phase(buffer_of(np.full(128, 40_000)))


def test_a_signal_at_another_frequency_is_named():
    """16 samples a cycle read as 64: the tone is at 4 kHz, and the verdict leads to both settings."""
    found = buffer_phase(buffer_of(1.27 * np.cos(4.0 * TURN - 1.0)))
    assert found.verdict.word == "failed"
    assert (
        "the strongest tone, 1.27 V, is at 4000 Hz: check sample rate and intermediate frequency" in found.verdict.why
    )
