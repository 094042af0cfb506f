"""Vibration of the twin's feed arm, planted by the simulator, found in ranges; what cancels in differences."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.structure.vibration import RangeSeries, difference, vibration
from catseye.simulator.night.faults import Streams
from catseye.simulator.twin.air import LivingAir
from catseye.simulator.twin.conditions import LIVING_NIGHT, LivingPlanted
from catseye.simulator.twin.motion import AxisMotion
from catseye.simulator.twin.telescope import ARM_FOOT, ARM_LENGTH, telescope

WINDOW, RATE, U = 0.128, 7.8, 20e-6
RANGERS = {
    "ZY101": [118.0, 5.0, 1.0],
    "ZY104": [10.0, 119.0, 1.2],
    "ZY107": [-112.0, 30.0, 0.9],
    "ZY110": [60, -100, 2],
}
TARGET = np.array([0.5, 6.0, 61.0])  # m, reflector frame, near the arm's end


@pytest.fixture(scope="module")
def twin(night_01):
    streams, planted = Streams(20), LivingPlanted(ignore=["wind"])
    start = night_01.site.campaign.start_mjd_utc
    air = LivingAir.of(night_01, LIVING_NIGHT, start, streams=streams, planted=planted)
    return telescope(night_01, AxisMotion.parse("fixed 145 45"), start, air=air, streams=streams, planted=planted)


def place(twin, seconds):
    """Of the target in the ground frame, by the simulator's bodies."""
    arm = twin.standing(seconds).bodies["arm"]
    return arm.turn @ TARGET + arm.shift


def measured(twin, ranger, *, phase, rng, seconds=600.0, offset=0.0, u=U):
    """Means over buffers of the true distance, with noise and a slow drift that belongs to the ranger."""
    middle = np.arange(int(seconds * RATE)) / RATE + phase
    parts = (np.arange(9) - 4) / 9 * WINDOW
    way = place(twin, (middle[:, None] + parts).ravel()).reshape(len(middle), 9, 3)
    distance = np.linalg.norm(way - RANGERS[ranger], axis=-1).mean(axis=1)
    drift = 3e-4 * np.sin(middle / 200.0)
    seen = distance + offset + drift + u * rng.standard_normal(len(middle))
    return RangeSeries(ranger, "ARM", middle, seen, np.full(len(middle), u), WINDOW)


def response(twin, ranger):
    """Change (3,) of a range for a unit of the arm's tip shift along the dish's axes, written from the geometry."""
    arm = TARGET - ARM_FOOT
    by_tip = np.zeros((3, 3))
    by_tip[:, 0] = np.cross([0.0, 1.0 / ARM_LENGTH, 0.0], arm)
    by_tip[:, 1] = np.cross([-1.0 / ARM_LENGTH, 0.0, 0.0], arm)
    by_tip[:, 2] = [0.0, 0.0, 1.0]
    now = twin.standing(np.zeros(1)).bodies["dish"].turn[0]
    e = place(twin, np.zeros(1))[0] - RANGERS[ranger]
    return e / np.linalg.norm(e) @ now @ by_tip


def planted_modes(twin):
    """Frequency band and rms (3,) of the tip of each planted mode, from the twin's waves."""
    for low, high in ((0.7, 0.9), (1.1, 1.3), (2.2, 2.6)):
        at = (twin.sway.omega > 2 * np.pi * low) & (twin.sway.omega < 2 * np.pi * high)
        cosine, sine = twin.sway.cosine[at, 3:], twin.sway.sine[at, 3:]
        yield twin.sway.omega[at] / (2 * np.pi), cosine, sine


def test_the_twins_modes_are_found_with_their_sizes_and_shapes(twin):
    rng = np.random.default_rng(1)
    series = [measured(twin, r, phase=p, rng=rng) for r, p in zip(RANGERS, (0.0, 0.02, 0.05, 0.075), strict=True)]
    found = vibration(series, stretch=60.0)
    step = found.spectrum.frequency_hz[0]
    gains = np.array([response(twin, r) for r in RANGERS])
    seen = 0
    for waves, cosine, sine in planted_modes(twin):
        band = (found.spectrum.frequency_hz > waves.min() - 0.06) & (found.spectrum.frequency_hz < waves.max() + 0.06)
        rms = np.sqrt(0.5 * np.sum((cosine @ gains.T) ** 2 + (sine @ gains.T) ** 2, axis=0)) * np.sinc(
            waves.mean() * WINDOW
        )
        noise = 2.0 * U**2 / RATE * band.sum() * step
        measured_rms = np.sqrt(np.maximum(found.spectrum.density[band].sum(axis=0) * step - noise, 0.0))
        # waves of a band beat: their phases at these 600 s make some 20 % of the power
        np.testing.assert_allclose(measured_rms, rms, rtol=0.35, atol=3e-6)
        near = [p for p in found.peaks if waves.min() - 0.05 < p.likely_hz < waves.max() + 0.05]
        if rms.max() > 15e-6:
            seen += 1
            assert near, (waves, rms)
            top = near[0]
            assert top.decided
            assert top.may_be_hz[0] == pytest.approx(top.peak.frequency_hz, abs=1e-6)
            direction = gains @ np.linalg.svd(np.concatenate([cosine, sine]))[2][0]
            strong = int(np.argmax(np.abs(direction)))
            expected = np.abs(direction / direction[strong])
            got = np.abs(top.shape.shape / top.shape.shape[strong])
            np.testing.assert_allclose(got, expected, atol=0.15)
    assert seen >= 2
    planted = [waves.mean() for waves, _, _ in planted_modes(twin)]
    assert found.modes
    for mode in found.modes:
        nearest = min(planted, key=lambda f: abs(f - mode.frequency_hz))
        # the planted band is 3 % broad
        assert abs(mode.frequency_hz - nearest) < 0.015 * nearest + 3.0 * mode.u_frequency_hz
    assert any("3.9 Hz" in note for note in found.notes)


def test_one_ranger_alone_leaves_the_alias_undecided():
    rng = np.random.default_rng(2)
    t = np.arange(3000) / RATE
    y = 100.0 + 1e-4 * np.sin(2 * np.pi * 5.0 * t) + U * rng.standard_normal(3000)
    found = vibration([RangeSeries("ZY101", "ARM", t, y, np.full(3000, U), WINDOW)], most_modes=0)
    top = found.peaks[0]
    assert not top.decided
    assert top.likely_hz == top.peak.frequency_hz == pytest.approx(2.8, abs=0.01)
    assert any(abs(f - 5.0) < 0.01 for f in top.may_be_hz)
    assert any("2.8 Hz are aliases is open" in note for note in found.notes)
    assert found.verdict.word == "doubtful"
    assert "may be aliases" in found.verdict.why
    alone = replace(found, peaks=(replace(top, decided=True),))
    assert alone.verdict == ("doubtful", "peaks stand out from the background, but no mode converged")
    assert replace(found, peaks=()).verdict.word == "good"


def test_two_targets_of_one_ranger_share_its_errors():
    """What the electronics do cancels; what moves a target stays, to the claimed uncertainty."""
    rng = np.random.default_rng(3)
    t = np.arange(2000) / RATE
    common = np.cumsum(rng.normal(size=2000)) * 5e-5
    wave = 4e-5 * np.cos(2 * np.pi * 0.8 * t)
    near, far = (RangeSeries("ZY101", n, t, 100.0 + common + m + U * rng.normal(size=2000), np.full(2000, U))
                 for n, m in (("ARM", wave), ("PIER", 0.0)))  # fmt: skip
    found = difference(near, far)
    assert len(found.seconds) == 2000  # the same instants: nothing is interpolated
    left = found.ranges - wave
    assert np.std(left) == pytest.approx(found.u.mean(), rel=0.05)
    assert found.u.mean() == pytest.approx(np.sqrt(2.0) * U, rel=1e-9)
    with pytest.raises(InputError, match="measured at the same time"):
        difference(near, RangeSeries("ZY102", "X", t + 1e4, far.ranges, far.u))


def test_interpolation_passes_the_stated_power():
    rng = np.random.default_rng(4)
    t, part, f = np.arange(4000) / RATE, 0.3, 1.1
    still = RangeSeries("A", "X", t[:-1] + part / RATE, np.zeros(3999), np.full(3999, U))
    moving = RangeSeries("B", "X", t, np.cos(2 * np.pi * f * t) * 1e-3 + 0 * rng.normal(size=4000), np.full(4000, U))
    found = difference(still, moving)
    power = np.var(found.ranges) / np.var(moving.ranges)
    assert power == pytest.approx(1.0 - 2 * part * (1 - part) * (1 - np.cos(2 * np.pi * f / RATE)), rel=2e-3)
    assert found.u[10] == pytest.approx(U * np.sqrt(1.0 + part**2 + (1 - part) ** 2), rel=1e-6)


def test_series_too_short_or_apart_are_refused():
    def one(n, begin=0.0):
        t = begin + np.arange(n) / RATE
        return RangeSeries("ZY101", "A", t, np.sin(t), np.full(n, U))

    with pytest.raises(InputError, match="64 at least"):
        vibration([one(20)])
    with pytest.raises(InputError, match="overlap by 0 s"):
        vibration([one(200), one(200, 1e4)])
    with pytest.raises(InputError, match="at least one"):
        vibration([])
