"""When a known signal arrived: exact without noise, a status for everything that can be wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from catseye.atmosphere.sound.dispersion import dispersion
from catseye.errors import ValidityError
from catseye.signal.delay.arrival import DelayPlan, DelayStatus, fast_length, noise_spectrum
from catseye.signal.delay.waveform import chirp, maximum_length_chips, maximum_length_sequence, pulse, sampled

FS = 48e3
CHIRP = {"start_hz": 2e3, "stop_hz": 8e3, "duration": 10e-3}
SIGNALS = {
    "chirp": (chirp, CHIRP),
    "pulse": (pulse, {"centre_hz": 5e3, "duration": 3e-3}),
    "mls": (maximum_length_sequence, {"order": 7, "chip_hz": 6e3, "centre_hz": 8e3}),
}
TIME = np.arange(9600) / FS


def plan(kind="chirp", **options):
    options = {"window": 3e-3, "compiled": False, **options}
    return DelayPlan(sampled(kind, FS, **SIGNALS[kind][1]), sampling_hz=FS, **options)


def heard(arrivals, kind="chirp", noise=0.0, seed=0):
    """(b, n) of the signal as a function of time, evaluated at its arrival."""
    function, values = SIGNALS[kind]
    clean = np.stack([function(TIME - arrival, **values) for arrival in np.atleast_1d(arrivals)])
    return clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)


@pytest.mark.parametrize("kind", list(SIGNALS))
@pytest.mark.parametrize("weighting", ["plain", "phat"])
@pytest.mark.parametrize("compiled", [False, True])
def test_there_is_no_floor_between_the_samples(kind, weighting, compiled):
    """What is left is what the samples lose by folding, 1e-4 of a sample; PHAT counts the faint folded lines fully."""
    true = 0.05 + np.linspace(0.0, 1.0, 23) / FS
    found = plan(kind, weighting=weighting, compiled=compiled)(heard(true, kind), 0.0505)
    assert np.abs(found.delay - true).max() < (5e-9 if weighting == "phat" else 2e-9)


def test_a_parabola_through_three_samples_has_a_floor_of_hundreds_of_nanoseconds():
    """Why Newton's steps: [the plain alternative], on the same recordings."""
    true = 0.05 + np.linspace(0.0, 1.0, 41) / FS
    template = sampled("chirp", FS, **CHIRP)
    worst = 0.0
    for arrival, row in zip(true, heard(true), strict=True):
        c = np.correlate(row, template, mode="valid")
        at = int(np.argmax(c))
        shift = 0.5 * (c[at - 1] - c[at + 1]) / (c[at - 1] - 2 * c[at] + c[at + 1])
        worst = max(worst, abs((at + shift) / FS - arrival))
    assert 1e-7 < worst < 1e-6


@given(st.floats(0.0485, 0.0515), st.floats(0.01, 1e4), st.floats(-5.0, 5.0))
def test_delay_is_independent_of_gain_and_offset(arrival, gain, offset):
    row = gain * (heard(arrival, noise=1e-3)[0] + offset)
    found, bare = plan()(row, 0.05), plan()(heard(arrival, noise=1e-3)[0], 0.05)
    assert found.delay == pytest.approx(arrival, abs=1e-6)
    assert found.delay == pytest.approx(bare.delay, abs=1e-12)
    assert found.u_delay == pytest.approx(bare.u_delay, rel=1e-6)
    assert found.amplitude == pytest.approx(gain, rel=0.01)


@given(st.floats(0.047, 0.053), st.integers(0, 5000))
def test_a_later_recording_start_makes_the_delay_shorter_by_as_much(arrival, seed):
    row = heard(arrival, noise=0.05, seed=seed)[0]
    cut = 37
    whole, later = plan()(row, 0.05), plan()(row[cut:], 0.05 - cut / FS)
    assert whole.delay - later.delay == pytest.approx(cut / FS, abs=1e-11)


def test_it_is_the_least_squares_fit_of_a_shifted_signal():
    """Independent: scipy minimises the residual of the signal, itself a function of time, and an amplitude."""
    row = heard(0.0503217, noise=0.3, seed=3)[0]

    def misfit(arrival):
        s = chirp(TIME - arrival, **CHIRP)
        return np.sum(row**2) - np.sum(row * s) ** 2 / np.sum(s**2)

    best = minimize_scalar(misfit, bracket=(0.050318, 0.050325), tol=1e-12).x
    assert plan()(row, 0.05).delay == pytest.approx(best, abs=3e-8)  # a tenth of u: the cut ends fold differently


def test_the_bound_is_that_of_fisher_information():
    """1/u^2 = sum s'^2/sigma^2, by differences of the signal as a function of time."""
    slope = (chirp(TIME - 0.05 + 1e-8, **CHIRP) - chirp(TIME - 0.05 - 1e-8, **CHIRP)) / 2e-8
    s = chirp(TIME - 0.05, **CHIRP)
    snr = np.sum(s**2) / 0.1**2
    assert plan().bound(snr) == pytest.approx(0.1 / np.sqrt(np.sum(slope**2)), rel=1e-4)


@pytest.mark.parametrize("weighting", ["plain", "phat", "whitened"])
def test_the_compiled_form_agrees_with_the_plain_one(weighting):
    rng = np.random.default_rng(1)
    rows = heard(0.05 + rng.uniform(-4e-3, 4e-3, 60), noise=0.5)
    rows[:20] *= 0.1
    rows[:20] += 0.5 * rng.standard_normal((20, rows.shape[1]))
    rows[20:25] += 0.8 * heard(0.0495)
    rows[30], rows[31, 2400] = 0.0, np.nan
    rows[32:34] = np.clip(9.0 * rows[32:34], -4.0, 4.0)
    noise = rng.standard_normal((2, 20_000))
    options = {"weighting": weighting, "full_scale": 4.0, "noise": noise}
    one, two = (plan(**options, compiled=compiled)(rows, 0.05) for compiled in (False, True))
    assert np.array_equal(one.status, two.status)
    assert len(set(one.status.tolist())) >= 4
    for name in ("delay", "u_delay", "amplitude", "snr", "rival"):
        assert getattr(one, name) == pytest.approx(getattr(two, name), rel=1e-6, abs=1e-12, nan_ok=True)


def test_a_batch_with_its_own_expectations_is_the_same_as_one_by_one():
    true = np.array([[0.03, 0.05], [0.08, 0.12]])
    rows = heard(true.ravel(), noise=0.1).reshape(2, 2, -1)
    both = plan()(rows, true + 1e-3)
    assert both.delay.shape == (2, 2)
    for place in np.ndindex(2, 2):
        alone = plan()(rows[place], true[place] + 1e-3)
        assert both.delay[place] == pytest.approx(alone.delay, abs=1e-13)
        assert both.text(*place) == alone.text() == "good"


def test_integer_samples_are_taken_as_they_are():
    codes = np.rint(3000 * heard(0.0501)[0]).astype(np.int16)
    assert plan()(codes, 0.05).delay == pytest.approx(0.0501, abs=2e-8)  # rounding: 0.3 codes of 3000


def test_silence_clipping_and_non_finite_samples_have_their_status():
    rows = np.stack([heard(0.05, noise=0.01)[0]] * 4)
    rows[0] = 3.0
    rows[1, 2500] = np.inf
    rows[2] = np.clip(2.0 * rows[2], -1.0, 1.0)
    found = plan(full_scale=1.0)(rows, 0.05)
    assert [DelayStatus(s).name for s in found.status] == ["SILENT", "NOT_FINITE", "CLIPPED", "CLIPPED"]
    assert [DelayStatus(s).name for s in plan()(rows[2:], 0.05).status] == [
        "GOOD",
        "GOOD",
    ]  # nobody said where it clips
    assert np.isnan(found.delay[:2]).all()
    assert np.isnan(found.u_delay).all()
    assert "gain" in found.text(2)
    codes = np.clip(np.rint(60_000 * rows[3]), -32768, 32767).astype(np.int16)
    assert plan()(codes, 0.05).status == DelayStatus.CLIPPED


def test_noise_alone_is_in_the_threshold_region_without_uncertainty():
    rows = np.random.default_rng(2).standard_normal((200, 9600))
    found = plan()(rows, 0.05)
    assert (found.status >= DelayStatus.THRESHOLD).all()
    assert np.isnan(found.u_delay).all()
    assert "too weak" in found.text(int(np.argmax(found.status == DelayStatus.THRESHOLD)))


def test_an_arrival_at_the_window_edge_is_rejected():
    found = plan()(heard([0.05304, 0.04696, 0.0529], noise=1e-3), 0.05)
    assert (found.status[:2] == DelayStatus.EDGE).all()
    assert found.status[2] == DelayStatus.GOOD


def test_two_equal_arrivals_are_ambiguous_and_a_weaker_one_is_an_echo():
    direct = heard(0.05, noise=1e-3)[0]
    late = heard(0.0517)[0]
    found = plan()(np.stack([direct + share * late for share in (0.0, 0.05, 0.3, 0.95, -0.3)]), 0.0505)
    assert [DelayStatus(s).name for s in found.status] == ["GOOD", "GOOD", "ECHO", "AMBIGUOUS", "ECHO"]
    assert found.rival[2] == pytest.approx(0.3, abs=0.03)
    assert np.isfinite(found.u_delay[[0, 1, 2, 4]]).all()
    assert np.isnan(found.u_delay[3])
    assert found.delay[2] == pytest.approx(0.05, abs=2e-6)


def test_an_echo_beyond_the_main_peak_pulls_the_delay_by_the_slope_of_the_signals_own_correlation():
    """First order: -share A'(D)/A''(0) with A the autocorrelation, here from samples at 4 MHz."""
    fine = 4e6
    s = sampled("chirp", fine, **CHIRP)
    apart, share = 0.4e-3, 0.2
    lag = round(apart * fine)

    def own(k):
        return np.sum(s[: len(s) - k] * s[k:])

    slope = (own(lag + 4) - own(lag - 4)) * fine / 8
    bend = 2 * (own(4) - own(0)) * (fine / 4) ** 2
    # J = A(t) + share A(t - D): J' = 0 at t with t A''(0) + share A'(-D) = 0, A'(-D) = -A'(D)
    expected = share * slope / bend
    found = plan()(heard(0.05)[0] + share * heard(0.05 + apart)[0], 0.05)
    assert found.delay - 0.05 == pytest.approx(expected, rel=0.1)
    assert abs(expected) > 1e-7


def test_a_narrow_pulse_whose_cycles_look_alike_is_ambiguous_in_noise():
    found = plan("pulse", window=2e-3)(heard(np.full(50, 0.05), "pulse", noise=0.7), 0.05)
    assert (found.status >= DelayStatus.THRESHOLD).all()


def test_phat_keeps_the_peak_where_a_loudspeaker_colours_the_signal():
    """Amplitudes bent by a filter without phase move neither; the plain peak grows wide side peaks, PHAT's does not."""
    row = heard(0.05)[0]
    lines = np.fft.rfft(row)
    hertz = np.fft.rfftfreq(len(row), 1 / FS)
    bent = np.fft.irfft(lines * (1 + 9 * np.exp(-(((hertz - 3e3) / 200) ** 2))), len(row)) + 1e-4 * heard(
        0.0, noise=1.0
    )
    plain, phat = (plan(weighting=w).correlation(bent[0], 0.05) for w in ("plain", "phat"))
    side = np.abs(plain[0] - 0.05) > 0.3e-3
    assert np.abs(phat[1][side]).max() / phat[1].max() < 0.6 * np.abs(plain[1][side]).max() / plain[1].max()
    assert plan(weighting="phat")(bent[0], 0.05).delay == pytest.approx(0.05, abs=1e-6)


def test_the_band_is_the_requested_one():
    narrow = plan(band_hz=(3e3, 5e3))
    assert 3e3 < narrow.bandwidth / (2 * np.pi) < 5e3
    hum = 5.0 * np.sin(2 * np.pi * 6.5e3 * TIME)
    assert narrow(heard(0.05, noise=1e-3)[0] + hum, 0.05).delay == pytest.approx(0.05, abs=5e-7)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"template": np.zeros(100)}, "constant"),
        ({"template": np.ones((2, 50))}, "not a row"),
        ({"template": np.arange(5.0)}, "at least 8"),
        ({"sampling_hz": 0.0}, "not a positive number"),
        ({"window": 1e-6}, "one sample"),
        ({"window": np.nan}, "one sample"),
        ({"weighting": "bogus"}, "'bogus' is not one of plain"),
        ({"weighting": "whitened"}, "needs the noise"),
        ({"weighting": "whitened", "noise": np.ones(100)}, "too few"),
        ({"weighting": "whitened", "noise": np.zeros(9000)}, "silent"),
        ({"band_hz": (20e3, 21e3)}, "no signal in the band"),
        ({"expected": 0.0}, "extends past the recording"),
        ({"expected": np.nan}, "extends past the recording"),
        ({"expected": 0.199}, "extends past the recording"),
        ({"recordings": np.zeros(300)}, "shorter than template and window"),
        ({"recordings": np.zeros(9600, complex)}, "not a row of integers or floats"),
    ],
)
def test_invalid_templates_and_recordings_are_refused(wrong, said):
    template = sampled("chirp", FS, **CHIRP)
    values = {"recordings": heard(0.05)[0], "template": template, "sampling_hz": FS, "expected": 0.05, "window": 3e-3}
    values |= wrong
    recordings, expected = values.pop("recordings"), values.pop("expected")
    with pytest.raises(ValidityError, match=said):
        DelayPlan(**values)(recordings, expected)


@given(st.integers(2, 100_000))
def test_a_fast_length_is_even_long_enough_and_smooth(least):
    found = fast_length(least)
    assert least <= found < 1.2 * least + 2
    assert found % 2 == 0
    for prime in (2, 3, 5):
        while found % prime == 0:
            found //= prime
    assert found == 1


def test_a_noise_spectrum_is_that_of_the_filter_which_made_it():
    """First-order walk x_k = a x_{k-1} + e: power |1/(1 - a exp(-i w))|^2 a sample; 4 % at 4 sigma of 1000 blocks."""
    from scipy.signal import lfilter

    x = lfilter([1.0], [1.0, -0.7], np.random.default_rng(5).standard_normal(250_000))
    w = 2 * np.pi * np.arange(129) / 256
    expected = 256 / np.abs(1 - 0.7 * np.exp(-1j * w)) ** 2
    assert np.median(noise_spectrum(x, 256) / expected) == pytest.approx(1.0, abs=0.02)
    assert noise_spectrum(x, 256)[3:-3] == pytest.approx(expected[3:-3], rel=0.2)


@pytest.mark.parametrize("order", range(3, 13))
def test_a_maximum_length_sequence_correlates_only_with_itself(order):
    chips = maximum_length_chips(order)
    own = np.fft.ifft(np.abs(np.fft.fft(chips)) ** 2).real
    assert own[0] == pytest.approx(2**order - 1)
    assert own[1:] == pytest.approx(-1.0)


def test_a_chirp_has_its_frequencies_where_they_belong():
    t = np.linspace(0.0, 0.1, 200_001)
    wave = chirp(t, start_hz=1e3, stop_hz=3e3, duration=0.1, taper=0.0)
    rising = t[1:][(wave[:-1] < 0) & (wave[1:] >= 0)]
    assert 1 / np.diff(rising)[[1, -2]] == pytest.approx(
        [1e3 + 2e4 * rising[1:3].mean(), 1e3 + 2e4 * rising[-3:-1].mean()], rel=5e-3
    )


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        ("bogus", {}, "not one of chirp"),
        ("chirp", {**CHIRP, "stop_hz": 25e3}, "not below half of"),
        ("chirp", {**CHIRP, "duration": 1e4}, "samples; take a shorter"),
        ("chirp", {**CHIRP, "taper": 0.6}, "taper"),
        ("pulse", {"centre_hz": -1.0, "duration": 1e-3}, "centre_hz -1"),
        ("mls", {"order": 13, "chip_hz": 1e3}, "order 13"),
    ],
)
def test_signals_that_cannot_be_made_are_refused(kind, values, said):
    with pytest.raises(ValidityError, match=said):
        sampled(kind, FS, **values)


@pytest.mark.parametrize("kind", ["chirp", "pulse"])
def test_a_correlation_shows_the_phase_velocity_of_air_that_disperses(kind):
    """Air at 0 °C with little vapour: group and phase are 35 ppm and more apart."""
    fs, length, speed, n = 48e3, 100.0, 340.0, 2**16
    values = {"start_hz": 1500.0, "stop_hz": 5000.0, "duration": 0.02} if kind == "chirp" else {"centre_hz": 3e3}
    template = sampled(kind, fs, **{"duration": 4e-3, **values})
    hertz = np.fft.rfftfreq(n, 1.0 / fs)
    late = length / (speed * (1.0 + dispersion(0.0, 933.0, 1.0, frequency_hz=hertz).phase))
    spectrum = np.fft.rfft(np.pad(template, (0, n - len(template))))
    plan = DelayPlan(template, sampling_hz=fs, window=2e-3)
    found = plan(np.fft.irfft(spectrum * np.exp(-2j * np.pi * hertz * late), n), length / speed)
    seen = length / float(found.delay) / speed - 1.0
    there = dispersion(0.0, 933.0, 1.0, frequency_hz=plan.bandwidth / (2.0 * np.pi))
    # the mean over the band is that at its rms frequency to second order in its width
    assert seen == pytest.approx(there.of_a_pulse()[0], abs=2e-6)
    assert there.group - there.phase > 30e-6
