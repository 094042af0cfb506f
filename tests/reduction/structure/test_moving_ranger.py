"""Feed-arm rangers and moving targets: against the single-posture station, and by Monte Carlo through the chain."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError, ValidityError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector, to_vector
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.structural_model import read_structural_model
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.site.stations import feed_arm_station
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.moving_ranger import (
    Driven,
    FrameCorrections,
    moving_ranger,
    tracked,
    vibrating,
)
from catseye.signal.vibration.filter import Mode, follow, start
from repository import ROOT

EXAMPLE = ROOT / "examples" / "structural-model" / "telescope.toml"
RANGER = FeedArmRanger(
    name="ZY113",
    zp="ZP113",
    nominal_scan_point_mm=(-8900.0, -3100.0, 60850.0),
    u_position_mm=0.5,
    mount_z=(0.0, 0.8, -0.6),
    mount_y=(0.0, -0.6, -0.8),
)
# slewing at the telescope's fastest
DRIVE = Driven(
    time=100.0,
    azimuth=145.3 * DEGREE,
    elevation=38.0 * DEGREE,
    azimuth_rate=35.2 / 60 * DEGREE,
    elevation_rate=-17.6 / 60 * DEGREE,
    temperature_c=3.0,
    u_azimuth=1.0 * ARCSECOND,
    u_elevation=2.0 * ARCSECOND,
)
TIMES = np.array([100.0, 100.128])


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(EXAMPLE))


@pytest.fixture(scope="module")
def mirror():
    from catseye.records.night.campaign import read_campaign

    record = next(iter(read_campaign(EXAMPLE.parents[1] / "night-01").mirrors.values()))
    return MirrorGeometry.model_validate({key: getattr(record, key) for key in MirrorGeometry.model_fields})


def swinging(antenna, time=100.0):
    """A filter that knows the modes' phases well."""
    modes = [
        Mode(v.frequency_hz, v.damping_ratio, np.diag([4e-6, 4e-6]), v.u_frequency_hz) for v in antenna.record.vibration
    ]
    state = start(time, modes, u_offset=1e-3)
    mean, covariance = state.mean.copy(), state.covariance.copy()
    mean[:8] = [2e-3, 0.0, 0.0, 1e-3, 0.5e-3, -1e-3, 1e-3, 0.0]
    covariance[:8, :8] *= 0.01
    return replace(state, mean=mean, covariance=covariance)


def test_it_is_the_station_of_one_posture_with_the_deformed_arm(antenna, mirror):
    moving = moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=TIMES, u_mount=1e-5)
    for i, posture in enumerate((DRIVE.posture(TIMES[0]), DRIVE.posture(TIMES[1]))):
        arm = antenna.ground_from("feed_arm", posture).single
        here = arm @ Transform("feed_arm", "reflector", np.eye(3), np.array([0.0, 8.0, -10.0]))
        still = feed_arm_station(RANGER, mirror, here)
        point = [20.0, -100.0, 30.0]
        # 1e-9 counts: what the pointing itself promises
        np.testing.assert_allclose(counts(moving.station[i], point), counts(still, point), rtol=0, atol=1e-7)
        np.testing.assert_allclose(moving.station.scan_point[i], still.scan_point, rtol=0, atol=1e-12)


def test_at_slew_rate_the_scan_point_moves_by_the_rates(antenna, mirror):
    moving = moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=TIMES, u_mount=1e-5)
    speed = np.diff(moving.station.scan_point, axis=0)[0] / 0.128
    # in the elevation frame the ranger stands (-8.9, -57.94, 65.85) m from the elevation axis, nearly
    e, fall = DRIVE.elevation, -DRIVE.elevation_rate
    ahead, up = -57.94 * np.sin(e) + 65.85 * np.cos(e), 57.94 * np.cos(e) + 65.85 * np.sin(e)
    # turning east moves what is ahead to the right and what is left forward; falling moves what is up forward
    expected = np.array([ahead * DRIVE.azimuth_rate, 8.9 * DRIVE.azimuth_rate + up * fall, -ahead * fall])
    a = DRIVE.azimuth
    right, forward = np.array([np.cos(a), -np.sin(a), 0.0]), np.array([np.sin(a), np.cos(a), 0.0])
    found = np.array([speed @ right, speed @ forward, speed[2]])
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-3)  # 1 %: deformation, the turn within the buffer


COUNT = 1500


def draws(antenna, rng, state):
    """Draws of everything uncertain: six of each frame (n, 6), encoders, vibration."""
    added = {name: motion.u * rng.standard_normal((COUNT, 6)) for name, motion in antenna.motions.items()}
    root = np.linalg.cholesky(state.covariance)
    swings = [
        vibrating(antenna.record, replace(state, mean=state.mean + root @ rng.standard_normal(len(root))), state.time)
        for _ in range(COUNT)
    ]
    added["feed_arm"] += [swing.six["feed_arm"] for swing in swings]
    moved = replace(
        DRIVE,
        azimuth=DRIVE.azimuth + DRIVE.u_azimuth * rng.standard_normal(COUNT),
        elevation=DRIVE.elevation + DRIVE.u_elevation * rng.standard_normal(COUNT),
    )
    return moved, added


def test_scan_point_and_turn_scatter_as_their_covariance_claims(antenna, mirror):
    rng = np.random.default_rng(1)
    state = swinging(antenna)
    swing = vibrating(antenna.record, state, np.array(100.0))
    moving = moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=np.array(100.0), u_mount=1e-5, known=(swing,))
    moved, added = draws(antenna, rng, state)
    drawn = FrameCorrections(added, np.zeros((30, 30)))
    times = np.full(COUNT, 100.0)
    station = moving_ranger(RANGER, mirror, antenna, drive=moved, times=times, u_mount=1e-5, known=(drawn,)).station
    still = moving.station
    shift = station.scan_point + 0.5e-3 * rng.standard_normal((COUNT, 3)) - still.scan_point
    seat = from_vector(1e-5 * rng.standard_normal((COUNT, 3)))
    # gamma' = gamma turned back: mount axes are the rows, and they turn with the mount
    turn = to_vector(seat @ np.swapaxes(station.gamma, -1, -2) @ still.gamma)
    check(np.concatenate([shift, turn], axis=-1), moving.covariance)
    target = np.array([20.0, -100.0, 30.0])
    seen = MirrorStation.from_matrix(
        still.scan_point + shift,
        still.gamma @ np.swapaxes(from_vector(turn), -1, -2),
        offset=still.offset,
        beta=still.beta,
        zeros=still.zeros,
    )
    check(counts(seen, target) - counts(still, target), moving.counts_covariance(target))


def check(errors, claimed):
    """Sample covariance against the claim, scaled to ones: 1500 draws show a variance to 3.7 %; four of these."""
    sigma = np.sqrt(np.diag(claimed))
    sample = np.cov(errors.T) / np.outer(sigma, sigma)
    np.testing.assert_allclose(sample, claimed / np.outer(sigma, sigma), rtol=0, atol=4 * np.sqrt(2 / COUNT))


def test_the_encoders_uncertainty_moves_and_turns_the_mount_together(antenna, mirror):
    """By differences of the whole model: what an encoder's u adds is its slope times u, shift and turn in one."""
    now, h, u = np.array(100.0), 1e-5, 1e-3
    still = moving_ranger(
        RANGER, mirror, antenna, drive=replace(DRIVE, u_azimuth=0.0, u_elevation=0.0), times=now, u_mount=1e-5
    )
    for axis in ("azimuth", "elevation"):
        ends = [
            moving_ranger(
                RANGER,
                mirror,
                antenna,
                drive=replace(DRIVE, **{axis: getattr(DRIVE, axis) + s * h}),
                times=now,
                u_mount=1e-5,
            ).station
            for s in (1, -1)
        ]
        slope = np.concatenate(
            [ends[0].scan_point - ends[1].scan_point, to_vector(ends[0].gamma.T @ ends[1].gamma)]
        ) / (2 * h)
        quiet = replace(DRIVE, u_azimuth=0.0, u_elevation=0.0)
        loud = moving_ranger(RANGER, mirror, antenna, drive=replace(quiet, **{f"u_{axis}": u}), times=now, u_mount=1e-5)
        added = loud.covariance - still.covariance
        size = u * np.repeat([np.linalg.norm(slope[:3]), np.linalg.norm(slope[3:])], 3)
        # 2 %: the deformations' own slopes, which are left out
        np.testing.assert_allclose(added / np.outer(size, size), u**2 * np.outer(slope / size, slope / size), atol=0.02)


def test_a_measured_correction_replaces_the_models_uncertainty(antenna, mirror):
    now = np.array(100.0)
    names = ("alidade", "elevation", "reflector", "feed_arm")
    six = {name: np.full(6, 1e-5) for name in names}
    sharp = FrameCorrections(six, np.eye(24) * 1e-14, replaces=True)
    before = moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=now, u_mount=1e-7)
    after = moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=now, u_mount=1e-7, known=(sharp,))
    assert np.all(np.diag(after.covariance) < np.diag(before.covariance))
    # left are encoders and seat: 2 seconds at some 75 m and 0.5 mm
    assert np.sqrt(np.trace(after.covariance[:3, :3])) < 1.5e-3
    assert np.linalg.norm(after.station.scan_point - before.station.scan_point) > 1e-5


def test_the_vibration_moves_the_arms_top_as_the_detector_shows_it(antenna):
    state = swinging(antenna)
    found = vibrating(antenna.record, state, np.array([100.0, 100.4]))
    (name,) = found.six
    assert name == "feed_arm"
    tip = np.array([0.0, 0.0, 50.0])
    posture = DRIVE.posture(100.0)
    first = found.six["feed_arm"][0]
    moved = antenna.ground_from("feed_arm", posture, added={"feed_arm": first})
    still = antenna.ground_from("feed_arm", posture)
    shown = still.inverse().directions(moved.points(tip) - still.points(tip))
    # the model's 4.125 seconds a millimetre at 50 m are 0.99989: x of the sway, y of the nod
    np.testing.assert_allclose(shown[:2], [2e-3, -1e-3], rtol=0, atol=5e-6)
    grown = np.diagonal(found.covariance, axis1=-2, axis2=-1)
    assert np.all(grown[1] >= grown[0])
    assert np.all(grown[1][[3, 4]] > grown[0][[3, 4]])


def test_strangers_are_refused(antenna, mirror):
    with pytest.raises(InputError, match="start the filter from the model's"):
        vibrating(antenna.record, start(0.0, [Mode(1.0, 0.01, np.eye(2), 0.1)], u_offset=1.0), 1.0)
    blind = RANGER.model_copy(update={"mount_z": None, "mount_y": None})
    with pytest.raises(InputError, match="no mount_z"):
        moving_ranger(blind, mirror, antenna, drive=DRIVE, times=TIMES, u_mount=1e-5)
    with pytest.raises(ValidityError, match="outside"):
        moving_ranger(RANGER, mirror, antenna, drive=DRIVE, times=1000.0, u_mount=1e-5)
    assert DRIVE.posture(100.0).temperature_c == 3.0
    assert isinstance(DRIVE.posture(TIMES), TelescopePosture)


def test_an_arm_tracked_by_ground_rangers_is_predicted_as_by_a_detector(antenna, mirror):
    """Ground coordinates of a target at the arm's top, slewing and swinging, to where the arm's ranger will be."""
    rng, u, rate = np.random.default_rng(5), 2e-4, 7.8
    t = 100.0 + np.arange(400) / rate - 400 / rate
    slow = replace(DRIVE, azimuth_rate=1e-4, elevation_rate=-5e-5)
    ahead = t[-1] + np.array([0.1, 0.3])
    shape = np.array([[0.0, 4.125, 0.0], [-4.125, 0.0, 0.0]]) * ARCSECOND / 1e-3  # of the file: turns by x, by y

    def swing(when):
        x, y = 3e-3 * np.cos(2 * np.pi * 0.78 * when + 0.4), 2e-3 * np.cos(2 * np.pi * 1.05 * when - 1.0)
        return np.concatenate([np.zeros((len(when), 3)), x[:, None] * shape[0] + y[:, None] * shape[1]], axis=-1)

    truth = antenna.points("arm", slow.posture(t), added={"feed_arm": swing(t)})
    at = antenna.groups["arm"].names.index("ZEG41040L")
    seen = truth[:, at] + u * rng.standard_normal((len(t), 3))
    samples, noise = tracked(antenna, "ZEG41040L", seen, covariance=np.eye(3) * u**2, posture=slow.posture(t))
    modes = [Mode(v.frequency_hz, 0.0005, np.diag([4e-6, 4e-6, 1e-7]), 0.01) for v in antenna.record.vibration]
    state = follow(start(t[0], modes, u_offset=1e-2), t, samples, noise=noise).state
    known = vibrating(antenna.record, state, ahead, seen_at=(antenna, "ZEG41040L"))
    found = moving_ranger(RANGER, mirror, antenna, drive=slow, times=ahead, u_mount=1e-7, known=(known,))
    told = FrameCorrections({"feed_arm": swing(ahead)}, np.zeros((2, 6, 6)))
    true = moving_ranger(RANGER, mirror, antenna, drive=slow, times=ahead, u_mount=1e-7, known=(told,))
    still = moving_ranger(RANGER, mirror, antenna, drive=slow, times=ahead, u_mount=1e-7)
    off = np.linalg.norm(found.station.scan_point - true.station.scan_point, axis=-1)
    assert np.all(off < 3e-4)
    assert np.linalg.norm(still.station.scan_point - true.station.scan_point, axis=-1).max() > 1.5e-3
    error = known.six["feed_arm"] - swing(ahead)
    u_turn = np.sqrt(np.diagonal(known.covariance, axis1=-2, axis2=-1))[:, 3:5]
    assert np.all(np.abs(error[:, 3:5]) < 4.0 * u_turn)
    assert np.all(u_turn < 0.2 * 4.125 * 3 * ARCSECOND)
    with pytest.raises(InputError, match="stands on 'reflector', the vibration is of 'feed_arm'"):
        vibrating(antenna.record, state, ahead, seen_at=(antenna, "TR01"))
    with pytest.raises(InputError, match="on 3 axes"):
        vibrating(antenna.record, state, ahead)
