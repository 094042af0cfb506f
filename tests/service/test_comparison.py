"""Epochs beside the truth: planted errors and claims are recovered."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.records.night.live import LiveShot
from catseye.service.comparison import TwinComparison
from simulator.living_scene import only, site, twin

NAMES = ("TR01-B", "ZAG731D", "ZEG41040L", "ZY101", "ZY113")
NUMBERS = range(1, 41)


def shots(world, seconds):
    for number, second in zip(NUMBERS, seconds, strict=True):
        yield AnsweredShot(LiveShot("ZY101", "TR01-B", world.ticks(second), 128, 64, 1000, 1e-4, None, number=number))


def solution(world, x, covariance, *, at=5.0, number=1, names=NAMES, count=3, pose=None):
    told = world.live_posture(world.ticks(at))
    answer = {
        "number": number,
        "ticks": world.ticks(at),
        "names": list(names),
        "x": np.asarray(x).tolist(),
        "shots": [count] * len(names),
        "used": list(NUMBERS),
        "azimuth": told.azimuth,
        "elevation": told.elevation,
        "pose": pose,
    }
    return EpochSolution(world.ticks(at), answer, covariance)


def compared(world, x, covariance, **how):
    judge = TwinComparison(site(), world, reference_after=1)
    for shot in shots(world, np.linspace(0.5, 9.5, len(NUMBERS))):
        judge.shot(shot)
    return judge.epoch(solution(world, x, covariance, **how))


def still(motion):
    """Nothing bends, shakes or settles: a point's place in its own frame is the same at all times."""
    return twin(motion, planted=only())


@pytest.mark.parametrize("motion", ["fixed 145.3 30", "slew 145.3 30 150 35"])
def test_truth_of_a_rigid_telescope_is_the_position_at_the_instant(motion):
    """While it slews by degrees in ten seconds: half a micrometre is what ticks and told angles are rounded to."""
    world = still(motion)
    x = np.array(list(world.truth(NAMES, world.seconds_of_ticks(world.ticks(5.0))).values()))
    found = compared(world, x, 1e-10 * np.eye(15))
    assert found.points == 5
    assert found.worst_mm < 0.001
    assert found.mean_u_mm == pytest.approx(0.01)


def test_planted_difference_is_recovered():
    world = still("slew 145.3 30 150 35")
    x = np.array(list(world.truth(NAMES, 5.0).values()))
    x[2] += (0.003, -0.004, 0.0)
    found = compared(world, x, 1e-6 * np.eye(15))
    assert (found.worst, found.worst_mm) == ("ZEG41040L", pytest.approx(5.0, abs=0.02))  # 5 deg/min for 0.4 ms
    assert found.rms_mm == pytest.approx(5.0 / np.sqrt(15.0), abs=0.02)
    assert found.chi2 == pytest.approx(25.0 / 15.0, rel=0.02)


def test_true_claims_fit_and_false_claims_do_not():
    """Drawn from correlated covariances 200 times: 99 % within the band, so 190 to 200; half the u never, at 15."""
    world, rng = still("fixed 145.3 30"), np.random.default_rng(8)
    root = rng.normal(size=(15, 15)) * 1e-4
    covariance = root @ root.T + 1e-9 * np.eye(15)
    x = np.array(list(world.truth(NAMES, 5.0).values()))
    draws = [x + rng.multivariate_normal(np.zeros(15), covariance).reshape(5, 3) for _ in range(200)]
    assert 190 <= sum(compared(world, each, covariance).fits for each in draws) <= 200
    assert sum(compared(world, each, covariance / 4.0).fits for each in draws) < 100


def test_points_with_few_shots_or_not_tracked_are_left_out():
    world = still("fixed 145.3 30")
    names = (*NAMES, "DP01C", "ZY101-F")
    x = np.array(list(world.truth(names, 5.0).values()))
    assert compared(world, x, np.eye(21), names=names).points == 5
    assert compared(world, x[:5], np.eye(15), count=2) is None


def test_epoch_without_solution_is_not_compared():
    judge = TwinComparison(site(), still("fixed 145.3 30"), reference_after=1)
    assert judge.epoch(EpochSolution(0, {})) is None


def test_true_beam_offset_counts_from_the_reference_epoch():
    """Nothing in the reference epoch; then elevation rises by degrees, and gravity moves the arm by some 0.1 mm."""
    world = twin("slew 145.3 30 145.3 34", planted=only("gravity"))
    prisms = (n for n in site().target_names if n.startswith("TR") and n.endswith(("-L", "-R")))
    names = tuple(sorted([*prisms, *(n for n in site().rangers if n not in site().monuments)]))
    judge = TwinComparison(site(), world, reference_after=1)
    pose = {"missing": "", "offset": [0.0, 0.0, 0.0], "covariance": np.eye(3).tolist()}
    found = []
    for number, begin in ((1, 0.0), (2, 12.0)):
        for shot in shots(world, begin + np.linspace(0.5, 9.5, len(NUMBERS))):
            judge.shot(shot)
        x = np.array(list(world.truth(names, begin + 5.0).values()))
        found.append(
            judge.epoch(
                solution(world, x, np.eye(3 * len(names)), at=begin + 5.0, number=number, names=names, pose=pose)
            )
        )
    assert found[0].true_offset == pytest.approx(np.zeros(3), abs=1e-15)
    assert 5e-5 < abs(found[1].true_offset[2]) < 2e-3
    assert 1e-6 < np.linalg.norm(found[1].true_offset[:2]) < 1e-3


def test_truth_of_a_vibrating_point_is_its_mean_over_the_shots():
    """The arm's tip shakes by some 0.05 mm; the mean at the shots' times is met to a micrometre, an instant is not."""
    world = twin("fixed 145.3 30", planted=only("vibration"))
    middles = np.linspace(0.5, 9.5, len(NUMBERS)) + 0.064
    truth = np.stack([world.point(name, middles) for name in NAMES], axis=1)
    found = compared(world, truth.mean(axis=0), 1e-10 * np.eye(15))
    assert found.worst_mm < 0.02  # of 40 shots 32 are looked at
    at_once = max(compared(world, truth[k], 1e-10 * np.eye(15)).worst_mm for k in range(0, 40, 8))
    assert at_once > 3.0 * found.worst_mm


def test_shot_time_is_the_middle_of_its_buffer():
    """All shots of one buffer while the arm's tip shakes: the truth of its middle is met, that of its begin is not."""
    world = twin("fixed 145.3 30", planted=only("vibration"))
    judge = {}
    for instant in (5.0, 5.064):  # where a buffer of 0.128 s begins, and its middle
        judge[instant] = TwinComparison(site(), world, reference_after=1)
        for shot in shots(world, np.full(len(NUMBERS), 5.0)):
            judge[instant].shot(shot)
    met = {
        instant: each.epoch(solution(world, np.array(list(world.truth(NAMES, instant).values())), np.eye(15))).worst_mm
        for instant, each in judge.items()
    }
    assert met[5.064] < 0.001  # ticks of 0.9 ms, at some 1 mm/s
    assert met[5.0] > 10.0 * met[5.064]


def test_shots_during_a_solution_belong_to_the_next_epoch():
    """The telescope slews: were the second epoch held against the times of none, or of the first, it would be off."""
    world = still("slew 145.3 30 150 35")
    judge = TwinComparison(site(), world, reference_after=1)
    late = list(shots(world, np.linspace(12.0, 21.0, len(NUMBERS))))
    for shot in shots(world, np.linspace(0.5, 9.5, len(NUMBERS))):
        judge.shot(shot)
    for shot in late:  # before the solution of the first is made known
        judge.shot(AnsweredShot(replace(shot.shot, number=shot.shot.number + 100)))
    x = np.array(list(world.truth(NAMES, 5.0).values()))
    assert judge.epoch(solution(world, x, np.eye(15))) is not None
    x = np.array(list(world.truth(NAMES, world.seconds_of_ticks(world.ticks(16.0))).values()))
    second = solution(world, x, np.eye(15), at=16.0, number=2)
    second.answer["used"] = [number + 100 for number in NUMBERS]
    assert judge.epoch(second).worst_mm < 0.1
