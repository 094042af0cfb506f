"""The tilt by azimuth is found as planted; what an inclinometer alone cannot know is named, and ranges give it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import EstimationError
from catseye.geometry.antenna.frames import ground_from_alidade
from catseye.records.laboratory.tilts import TiltReadings
from catseye.reduction.pose.track_profile import coefficient_names, joined_tilt, track_profile

ZERO = np.array([40.0, -15.0]) * ARCSECOND


def tilt(a):
    """About east and north, arc seconds: what is planted."""
    return np.stack([3.0 - 1.2 * np.cos(3 * a) + 0.8 * np.sin(a), -2.0 + 0.9 * np.cos(2 * a)], axis=-1) * ARCSECOND


def of_the_alidade(a):
    """The same as turns about the alidade's axes: as vectors, by the frame's own transform."""
    turns = np.column_stack([tilt(a), np.zeros(len(a))])
    return np.array([ground_from_alidade(x).inverse().directions(t) for x, t in zip(a, turns, strict=True)])[:, :2]


def readings(a, u=0.1):
    return TiltReadings(np.zeros(len(a)), a, of_the_alidade(a) + ZERO, np.full(len(a), u * ARCSECOND), "")


def spread(n, u=1.0):
    return np.repeat((np.eye(2) * (u * ARCSECOND) ** 2)[None], n, axis=0)


AT = np.arange(0, 360, 30) * DEGREE
ROUND = np.linspace(0, 2 * np.pi, 100)[:-1]


@pytest.mark.parametrize("tilts", [None, readings(ROUND)])
def test_planted_tilts_are_recovered(tilts):
    found = track_profile(AT, of_the_alidade(AT), spread(12), tilts=tilts, harmonics=3)
    a = np.linspace(0, 7, 50)
    np.testing.assert_allclose(found.series.at(a)[0], tilt(a), rtol=0, atol=1e-9 * ARCSECOND)
    told = dict(zip(coefficient_names(3), found.series.values / ARCSECOND, strict=True))
    assert told["mean east"] == pytest.approx(3.0)
    assert told["cos 3A east"] == pytest.approx(-1.2)
    assert told["sin 1A east"] == pytest.approx(0.8)
    assert told["cos 2A north"] == pytest.approx(0.9)
    np.testing.assert_allclose(found.series.axis[0] / ARCSECOND, [-3.0, 2.0])  # leans south, and to the west
    assert found.pvv == pytest.approx(0.0, abs=1e-6)
    if tilts is not None:
        np.testing.assert_allclose(found.zero[0], ZERO, rtol=1e-9)
        plain = track_profile(AT, of_the_alidade(AT), spread(12), harmonics=3)
        assert np.all(np.diag(found.series.covariance) <= np.diag(plain.series.covariance))


def test_the_mean_tilt_is_where_the_axis_leans():
    """Turned about east by 3 arcsec, right-handed, up goes south: AN is -3; about north by -2, to the west: AW is 2."""
    axis = Rotation.from_rotvec(np.array([3.0, -2.0, 0.0]) * ARCSECOND).apply([0.0, 0.0, 1.0])
    found = track_profile(AT, of_the_alidade(AT), spread(12), harmonics=3)
    np.testing.assert_allclose(found.series.axis[0], [axis[1], -axis[0]], rtol=0, atol=1e-9)


def test_an_inclinometer_alone_cannot_separate_its_zero_and_one_wave():
    with pytest.raises(EstimationError, match=r"cos 1A east.*zero x"):
        track_profile(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)), tilts=readings(ROUND), harmonics=1)
    found = track_profile(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)), tilts=readings(ROUND), harmonics=0)
    assert found.poses == 0  # the mean alone is held: the zero goes round, the axis does not


@pytest.mark.parametrize("harmonics", [1, 2, 3, 4])
def test_an_inclinometer_alone_gives_every_other_wave(harmonics):
    """The same by a second way: with poses of u 1 rad beside it only the wave of one turn and the zero are open."""
    a, none = ROUND + 0.1 * np.sin(5 * ROUND), (np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    alone = track_profile(*none, tilts=readings(a), harmonics=harmonics, partial=True)
    beside = track_profile(AT, of_the_alidade(AT), spread(12, 206265.0), tilts=readings(a), harmonics=harmonics)
    names = coefficient_names(harmonics)
    assert alone.series.undetermined == tuple(name for name in names if " 1A " in name)
    assert alone.zero is None
    known = np.isfinite(alone.series.values)
    np.testing.assert_allclose(alone.series.values[known], beside.series.values[known], rtol=0, atol=1e-6 * ARCSECOND)
    u, v = (np.sqrt(np.diag(p.series.covariance))[known] for p in (alone, beside))
    np.testing.assert_allclose(u, v, rtol=1e-4)
    assert alone.degrees_of_freedom == 2 * len(a) - (4 * harmonics + 2)
    if harmonics >= 3:
        np.testing.assert_allclose(alone.series.at(a)[0][:, 0], tilt(a)[:, 0] - 0.8 * np.sin(a) * ARCSECOND, atol=1e-15)


def test_too_few_azimuths_are_refused_by_name():
    with pytest.raises(EstimationError, match="not determined"):
        track_profile(AT[:2], of_the_alidade(AT[:2]), spread(2), harmonics=2)
    with pytest.raises(EstimationError, match="none present"):
        track_profile(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    with pytest.raises(EstimationError, match="expected 0 to 36"):
        track_profile(AT, of_the_alidade(AT), spread(12), harmonics=99)


def test_a_joined_reading_is_the_least_squares_of_both():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 9)) * np.array([1e-4] * 3 + [1e-5] * 3)[:, None]
    q, six, u = root @ root.T, rng.normal(size=6) * 1e-5, 2e-6
    reading = np.array([1e-5, -2e-5])
    found, claimed = joined_tilt(six, q, reading, u=u)
    pick = np.eye(6)[3:5]
    normal = np.linalg.inv(q) + pick.T @ pick / u**2
    np.testing.assert_allclose(claimed, np.linalg.inv(normal), rtol=1e-6)
    np.testing.assert_allclose(found, np.linalg.solve(normal, np.linalg.solve(q, six) + pick.T @ reading / u**2),
                               rtol=1e-6)  # fmt: skip
    with pytest.raises(EstimationError, match="expected above 0"):
        joined_tilt(six, q, reading, u=0.0)
