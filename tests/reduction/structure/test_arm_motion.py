"""Motion of the arm by a followed vibration: detector and tracked target agree, a ranger moves as its frame does."""

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from catseye.errors import InputError
from catseye.geometry.frames.rotation import from_vector
from catseye.records.night.vibration_series import VibrationSeries
from catseye.records.site.folder import read_site
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.arm_motion import arm_motion, samples_of_target, still_posture
from catseye.reduction.structure.following import VibrationSamples, follow_vibration, modes_of_model
from repository import ROOT

RECORD = read_structural_model(ROOT / "examples/structural-model/telescope.toml")
SITE = read_site(ROOT / "examples/sites/gbt")
POSTURE, CELSIUS, RATE = (np.radians(145.3), np.radians(30.0)), 12.0, 20.0
SWAY, NOD = 1.5e-3, 1.0e-3  # m on the detector


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(RECORD)


def swing(times):
    """Detector's x and y (n, 2), m, of a free vibration at the model's frequencies."""
    return np.stack([SWAY * np.cos(2 * np.pi * 0.78 * times), NOD * np.cos(2 * np.pi * 1.05 * times + 1.0)], axis=-1)


def six(times):
    """Motion of the feed arm (n, 6) that makes it: 4.125 seconds a millimetre, sway about y, nod about -x."""
    x, y = swing(times).T
    zero = np.zeros_like(x)
    turn = 4.125 * ARCSECOND / 1e-3
    return np.stack([zero, zero, zero, -turn * y, turn * x, zero], axis=-1)


def followed(samples, leads=(0.1, 0.4)):
    return follow_vibration(samples, modes=modes_of_model(RECORD, samples), ahead=0.05, leads=leads)


@pytest.fixture(scope="module")
def detector():
    rng, times = np.random.default_rng(1), np.arange(800) / RATE
    noise = 5e-6
    values = swing(times) + noise * rng.standard_normal((800, 2))
    return VibrationSamples(("x", "y"), times, values, np.tile(noise**2 * np.eye(2), (800, 1, 1)))


def test_the_detector_shows_how_the_arm_turns(antenna, detector):
    found = followed(detector)
    motion = arm_motion(found, antenna)
    truth = six(detector.end + found.leads)
    assert (motion.frame, motion.place) == ("feed_arm", None)
    np.testing.assert_array_equal(motion.pivot, antenna.pivot("feed_arm"))
    u = np.sqrt(np.diagonal(motion.covariance, axis1=-2, axis2=-1))
    np.testing.assert_array_less(np.abs(motion.six - truth)[:, 3:5], 4.0 * u[:, 3:5])
    across = (
        4.125 * ARCSECOND / 1e-3 * found.predicted
    )  # each mode moves by one axis of the detector, the other is noise
    np.testing.assert_allclose(motion.six[:, 4], across[:, 0], atol=0.02 * np.abs(across).max())
    np.testing.assert_array_less(u[:, 3:5], 0.3 * 4.125 * ARCSECOND)  # fine enough: a third of a millimetre's turn


def test_a_tracked_target_shows_the_same(antenna):
    group = next(name for name, points in antenna.groups.items() if points.frame == "feed_arm")
    target, rng = antenna.groups[group].names[0], np.random.default_rng(2)
    times, u = np.arange(800) / RATE, 10e-6
    posture = still_posture(POSTURE, CELSIUS, 800)
    at = antenna.points(group, posture, added={"feed_arm": six(times)})[:, 0]
    series = VibrationSeries("tracked", "ground", ("x_m", "y_m", "z_m"), times, at + u * rng.standard_normal((800, 3)))
    samples = samples_of_target(series, antenna, target, posture=POSTURE, temperature_c=CELSIUS, u=u, window=0.0)
    found = followed(samples)
    motion = arm_motion(found, antenna, target=target)
    truth = six(samples.end + found.leads)
    u = np.sqrt(np.diagonal(motion.covariance, axis1=-2, axis2=-1))
    np.testing.assert_array_less(np.abs(motion.six - truth)[:, 3:5], 4.0 * u[:, 3:5])
    with pytest.raises(InputError, match="nowhere"):
        arm_motion(found, antenna, target="nowhere")


def test_a_ranger_on_the_arm_moves_as_the_arm_turns(antenna, detector):
    arm = next(each for each in SITE.feedarm.ranger if each.name == "ZY115")
    found = followed(detector)
    motion = arm_motion(found, antenna, ranger=(arm, SITE.mirror_of("ZY115")), posture=POSTURE, temperature_c=CELSIUS)
    # by hand: the scan point in the arm's nominal axes, whose foot is at (0, -8, 10) m, turned about its pivot
    place = np.array(arm.nominal_scan_point_mm) * 1e-3 - [0.0, -8.0, 10.0]
    turned = np.stack([from_vector(turn) @ (place - motion.pivot) for turn in motion.six[:, 3:]])
    by_hand = turned + motion.pivot + motion.six[:, :3] - place
    to_ground = antenna.ground_from("feed_arm", still_posture(POSTURE, CELSIUS, 1)).rotation[0]
    np.testing.assert_allclose(motion.moved, by_hand @ to_ground.T, atol=2e-6)  # turns of 5" of a model's 150"
    assert motion.moved.std() > 1e-4
    assert motion.place.shape == (2, 3)
    assert np.all(np.linalg.eigvalsh(motion.spread) > -1e-20)


def test_a_model_that_vibrates_nowhere_is_refused(antenna, detector):
    still = antenna_of(RECORD.model_copy(update={"vibration": ()}))
    with pytest.raises(InputError, match="vibrates in 0 frames"):
        arm_motion(followed(detector), still)
