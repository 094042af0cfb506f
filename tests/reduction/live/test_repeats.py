"""Repeats of a line joined: against phases made from distances, without the code's own formula for the turn."""

import math
from dataclasses import replace

import numpy as np
import pytest

from catseye.records.night.live import LiveShot
from catseye.reduction.epoch.ranges import ShotPhase
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.live.repeats import joined_repeats
from catseye.reduction.live.shots import PhasedShot

HALF = 299_792_458.0 / 1.5e9 / 2.0  # m of a phase's turn, in vacuum
INDEX = 1.00028
DAY = 86_400.0
NOISE = 2e-3  # V


def with_noise(row, noise):
    return replace(row, phase=replace(row.phase, phasor=row.phase.phasor + noise))


def taken(number, seconds, distance, *, target="ZEG1", amplitude=1.0, reason=None, u=NOISE):
    """A shot whose phase is that of a path to and back: the further, the later."""
    phasor = amplitude * np.exp(-2j * math.pi * (INDEX * distance / HALF % 1.0))
    shot = LiveShot("ZY101", target, 52_889 * 10**8 + number, 128, 64, 1000, 1e-3, None, number=number)
    phase = ShotPhase(phasor, u, 2 * u, 0.01, (0.001 * number, 0.0), amplitude, reason)
    return PhasedShot(shot, 52_889.0 + seconds / DAY, phase)


def joined(rows, lengths):
    return joined_repeats(rows, lengths, 1.5e9, index=INDEX)


def phase_of(row, distance):
    return abs(np.angle(row.phase.phasor * np.exp(2j * math.pi * INDEX * distance / HALF)))


def test_stream_on_a_moving_target_becomes_one_shot_at_its_middle():
    def length(t):
        return 123.456 + 2.2e-3 * t + 1e-4 * t**2

    rng, times = np.random.default_rng(1), 0.13 * np.arange(12)
    rows = [taken(k + 1, t, length(t), u=float(rng.uniform(1e-3, 4e-3))) for k, t in enumerate(times)]
    one, *others = joined(rows, lambda ranger, target, mjd: 7.0 + length((mjd - 52_889.0) * DAY))  # 7 m off, all alike
    assert not others
    assert one.numbers == tuple(range(1, 13))
    assert one.shot.number == 7
    assert one.mjd == rows[6].mjd
    assert phase_of(one, length(times[6])) < 1e-5  # MJD as a double has steps of 0.6 us, 1e-9 m here
    weights = np.array([r.phase.u_phasor**-2 for r in rows])
    assert one.phase.u_phasor == pytest.approx(weights.sum() ** -0.5)
    assert one.phase.u_across == pytest.approx(2 * weights.sum() ** -0.5)
    assert one.phase.harmonics[0] == pytest.approx(0.0065)


def test_claimed_noise_agrees_with_the_scatter_of_the_mean():
    rng, found = np.random.default_rng(2), []
    for _ in range(400):
        rows = [taken(k, 0.13 * k, 50.0) for k in range(16)]
        noisy = [with_noise(r, complex(*rng.normal(0.0, NOISE, 2))) for r in rows]
        (one,) = joined(noisy, lambda ranger, target, mjd: np.full(len(mjd), 50.0))
        found.append((one.phase.phasor - rows[0].phase.phasor) / one.phase.u_phasor)
    assert np.mean(np.abs(found) ** 2) / 2 == pytest.approx(1.0, abs=4 / math.sqrt(800))


def test_outlying_repeat_stays_separate():
    rows = [taken(k, 0.13 * k, 50.0 if k != 5 else 50.0 + 4e-3) for k in range(12)]
    first, second = sorted(joined(rows, lambda *a: np.full(12, 50.0)), key=lambda r: len(r.numbers))
    assert first.numbers == (5,)
    assert second.numbers == (0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11)
    assert phase_of(second, 50.0) < 1e-9
    within = [taken(k, 0.13 * k, 50.0 if k != 5 else 50.0 + 0.5e-3) for k in range(12)]
    (one,) = joined(within, lambda *a: np.full(12, 50.0))  # half a millimetre: shaking, not another target
    assert len(one.numbers) == 12


def test_repeats_are_joined_within_time_and_distance_limits():
    resting = [taken(k, 0.5 * k + 1e-3, 50.0) for k in range(41)]  # 20 s
    assert [len(r.numbers) for r in joined(resting, lambda *a: np.full(41, 50.0))] == [21, 20]
    moving = [taken(k, 0.5 * k, 50.0 + 1e-4 * k) for k in range(9)]  # 0.2 mm/s for 4 s
    assert [len(r.numbers) for r in joined(moving, lambda a, b, mjd: 50.0 + 1e-4 * np.arange(9))] == [5, 4]
    fast = [taken(k, 0.1 * k, 50.0 + 4e-3 * k) for k in range(6)]  # 40 mm/s
    assert [len(r.numbers) for r in joined(fast, lambda a, b, mjd: 50.0 + 4e-3 * np.arange(6))] == [2, 2, 2]


def test_rejected_and_reference_shots_are_not_joined():
    rows = [
        taken(1, 0.0, 50.0),
        taken(2, 0.1, 50.0, reason=Reason(ShotStatus.BLOCKED, "by a test")),
        taken(3, 0.2, 50.0, target="ZEG2"),
        taken(4, 0.3, 5.0, target="ZRG"),
        taken(5, 0.4, 5.0, target="ZRG"),
        taken(6, 0.5, 50.0),
    ]
    found = joined(rows, lambda *a: np.full(2, 50.0))
    assert [r.numbers for r in found] == [(2,), (3,), (4,), (5,), (1, 6)]
    assert found[-1].shot.number == 6
    unknown = joined([rows[0], rows[5]], lambda *a: np.full(2, np.nan))
    assert [r.numbers for r in unknown] == [(1,), (6,)]
