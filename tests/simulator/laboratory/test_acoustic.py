"""The twin of loudspeaker, air and microphone: its own formulas, checked against geometry and today's formula."""

import numpy as np
import pytest
from scipy.integrate import quad

from catseye.atmosphere.sound.speed import sound
from catseye.signal.delay.waveform import pulse
from catseye.simulator.laboratory.acoustic import Recorder, SoundPath, sound_speed


def flat(value):
    return lambda share: value + 0.0 * share


def test_its_speed_agrees_with_the_other_formula_within_what_both_claim():
    """[CRAMER93] claims 300 ppm; `real_gas` is another derivation from other measurements."""
    t, p, h = np.meshgrid([0.0, 10.0, 20.0, 30.0], [800.0, 930.0, 1013.0], [0.0, 50.0, 100.0])
    apart = sound_speed(t, p, h, co2_ppm=450.0) / sound(t, p, h, model="real_gas", co2_ppm=450.0).speed - 1.0
    assert np.abs(apart).max() < 300e-6


def test_uniform_air_takes_length_over_speed_with_and_against_the_wind():
    c = sound_speed(12.0, 930.0, 70.0, co2_ppm=450.0)
    path = SoundPath(100.0, flat(12.0), flat(5.0), flat(3.0), pressure_hpa=930.0, humidity_percent=70.0)
    ahead = np.sqrt(c**2 - 9.0)
    assert path.travel_times() == pytest.approx((100.0 / (ahead + 5.0), 100.0 / (ahead - 5.0)), rel=1e-14)
    assert path.travel_times()[0] < path.travel_times()[1]  # with the wind it is quicker


def test_the_integral_is_that_of_scipy():
    path = SoundPath(
        80.0, lambda s: 20.0 - 4.0 * s + np.sin(9.0 * s), lambda s: 6.0 * np.cos(3.0 * s), lambda s: 4.0 * s,
        dispersion_ppm=60.0,
    )  # fmt: skip

    def slowness(share):
        c = sound_speed(path.temperature_c(share), 933.0, 50.0, co2_ppm=450.0) * (1 + 60e-6)
        return 1.0 / (np.sqrt(c**2 - path.wind_across(share) ** 2) + path.wind_along(share))

    assert path.travel_times()[0] == pytest.approx(80.0 * quad(slowness, 0.0, 1.0, epsabs=1e-14)[0], rel=1e-12)
    assert path.mean_temperature_c() == pytest.approx(quad(path.temperature_c, 0.0, 1.0)[0], abs=1e-12)


def signal(time):
    return pulse(time, centre_hz=2e3, duration=2e-3)


def test_it_arrives_when_it_should_and_fades_with_the_distance():
    recorder = Recorder(48e3, noise_volt=0.0, delay=1e-4, echoes=((34.3, -0.5),))
    volts = recorder.volts(signal, [0.01], travel_time=0.1, distance=34.3, samples=12_000, rng=np.random.default_rng(0))
    time = np.arange(12_000) / 48e3
    crest = time[np.argmax(volts)]
    assert crest == pytest.approx(0.01 + 0.1 + 1e-4 + 1e-3, abs=0.5 / 48e3)
    assert volts.max() == pytest.approx(10.0 / 34.3, rel=5e-3)
    assert not volts[time < 0.11].any()
    late = time[np.argmin(volts[time > 0.15]) + np.count_nonzero(time <= 0.15)]
    assert late == pytest.approx(crest + 0.1, abs=1.0 / 48e3)
    assert volts[time > 0.15].min() == pytest.approx(-0.5 * 10.0 / 68.6, rel=5e-3)


def test_a_clock_that_is_ahead_reads_arrivals_late():
    plain, ahead = Recorder(48e3, noise_volt=0.0), Recorder(48e3, noise_volt=0.0, clock_ahead=10 / 48e3)
    common = {"travel_time": 0.05, "distance": 10.0, "samples": 4800, "rng": np.random.default_rng(0)}
    one, two = (r.volts(signal, [0.01], **common) for r in (plain, ahead))
    assert two[10:] == pytest.approx(one[:-10], abs=1e-9)


def test_the_converter_rounds_and_cuts():
    recorder = Recorder(48e3, bits=16)
    assert recorder.codes(np.array([0.0, 1e-4, 2.0, -2.0])).tolist() == [0, 3, 32767, -32768]


def test_noise_has_the_power_and_the_colour_asked():
    rng = np.random.default_rng(3)
    noise = Recorder(8e3, noise_volt=0.1, rumble_volt=0.5, rumble_hz=50.0).volts(
        signal, [], travel_time=0.0, distance=1.0, samples=400_000, rng=rng
    )
    assert noise.std() == pytest.approx(np.hypot(0.1, 0.5), rel=0.03)
    lag = round(8e3 / (2 * np.pi * 50.0))  # after this time a first-order walk has forgotten all but 1/e
    assert np.mean(noise[:-lag] * noise[lag:]) == pytest.approx(0.25 / np.e, rel=0.12)
