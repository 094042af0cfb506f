"""Light back into the laser: an excess of scatter, none where there is none, and a claim that scatter confirms."""

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.reduction.calibrations.ranging.feedback import KIND, FeedbackSheet, calibrate_feedback
from reduction.calibrations.length_scene import readings


def calibrated(rng, size, *, count=60, sets=2, drift=0.0):
    level = np.repeat(np.linspace(5.0, 2.0, sets), count // sets)
    fringe = size * np.sqrt(2.0) * np.cos(2 * np.pi * rng.uniform(size=count))
    phase = 3.1 + np.repeat(np.linspace(0.0, 2.0, sets), count // sets) + fringe
    phase = phase + 3e-4 / level * rng.standard_normal(count) + drift * np.arange(count)
    columns = {"phase_target_rad": phase, "amplitude_target_volt": level}
    words = {"set": [f"place-{k}" for k in range(sets) for _ in range(count // sets)]}
    return calibrate_feedback(readings(FeedbackSheet, KIND, numbers=columns, words=words, u_phasor_volt=3e-4))


def test_the_size_of_a_fringe_is_found_in_sets_on_either_side_of_a_turn():
    found = calibrated(np.random.default_rng(1), 1e-3, count=400)
    assert found.value("feedback_rad") == pytest.approx(1e-3, rel=0.1)
    assert found.record["u_feedback_rad"] == found.value("feedback_rad")
    assert found.decisions[0].statistic > found.decisions[0].limit


def test_estimates_scatter_no_more_than_claimed():
    """An arcsine's square scatters by half of a normal's: the claim, a chi-square's, is above it and below twice."""
    rng = np.random.default_rng(2)
    found = [calibrated(rng, 1e-3) for _ in range(400)]
    claimed = np.sqrt(np.mean([f.covariance[0, 0] for f in found]))
    scatter = np.std([f.value("feedback_rad") for f in found])
    assert 0.5 * claimed < scatter < claimed
    assert np.mean([f.value("feedback_rad") for f in found]) == pytest.approx(1e-3, rel=0.02)


def test_noise_alone_is_called_light_once_in_twenty_and_bounded():
    rng = np.random.default_rng(3)
    found = [calibrated(rng, 0.0) for _ in range(400)]
    alarms = np.mean([f.decisions[0].statistic > f.decisions[0].limit for f in found])
    assert alarms == pytest.approx(0.05, abs=0.033)  # 3 of its own
    assert all(0.0 <= f.value("feedback_rad") < 1.5e-4 for f in found)  # the noise of the weaker set
    # the bound: 1.2e-4 rad of noise by the root of 1.645 sqrt(2/58)
    assert np.median([f.record.get("u_feedback_rad", 0.0) for f in found]) == pytest.approx(6.6e-5, rel=0.15)


def test_few_readings_are_refused():
    with pytest.raises(EstimationError, match="8 readings beyond the means of their sets"):
        calibrated(np.random.default_rng(4), 1e-3, count=10)


def test_a_path_that_drifts_within_a_set_is_not_called_light_unnoticed():
    """1 µm of range a reading, 63 µrad: 30 readings scatter by half a milliradian, each close to its neighbours."""
    rng = np.random.default_rng(6)
    still = [calibrated(rng, 1e-3).decisions[1] for _ in range(300)]
    assert sum(not each.passed for each in still) <= 2  # 0.3 expected
    drifting = [calibrated(rng, 0.0, drift=6.3e-5).decisions[1] for _ in range(50)]
    assert not any(each.passed for each in drifting)


def sheet(phase, level, sets):
    columns = {"phase_target_rad": np.asarray(phase), "amplitude_target_volt": np.asarray(level)}
    return calibrate_feedback(readings(FeedbackSheet, KIND, numbers=columns, words={"set": sets}, u_phasor_volt=3e-4))


def test_sets_read_in_turns_are_compared_within_each_set():
    rng = np.random.default_rng(7)
    fringe = 1e-3 * np.sqrt(2.0) * np.cos(2 * np.pi * rng.uniform(size=60))
    found = sheet(fringe + np.tile([0.0, 2.0], 30), np.full(60, 5.0), ["near", "far"] * 30)
    by_set = sheet(np.append(fringe[::2], fringe[1::2] + 2.0), np.full(60, 5.0), ["near"] * 30 + ["far"] * 30)
    assert found.decisions[1].passed
    assert found.decisions[1].statistic == pytest.approx(by_set.decisions[1].statistic, rel=1e-9)


def test_weak_readings_that_hide_the_excess_of_strong_ones_are_refused():
    """30 strong readings scatter by three times their noise, 30 of a hundredth of the amplitude by half of theirs."""
    rng = np.random.default_rng(8)
    phase = 3.0 + np.append(rng.normal(0.0, 3 * 6e-5, 30), rng.normal(0.0, 0.5 * 6e-3, 30))
    with pytest.raises(EstimationError, match=r"weak ones' noise, up to 6 mrad, hides"):
        sheet(phase, np.repeat([5.0, 0.05], 30), ["near"] * 30 + ["far"] * 30)


def test_a_normal_excess_scatters_as_claimed():
    """Standard deviation of 300 over the claim: 1 within 4 of its own, 4 / sqrt(600)."""
    rng = np.random.default_rng(9)
    found = [sheet(rng.normal(3.0, 1e-3, 60), np.full(60, 5.0), ["near"] * 60) for _ in range(300)]
    claimed = np.sqrt(np.mean([f.covariance[0, 0] for f in found]))
    assert np.std([f.value("feedback_rad") for f in found]) / claimed == pytest.approx(1.0, abs=0.16)
