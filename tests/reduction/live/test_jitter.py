"""Jitter of bodies, learnt from ranges of known scatter."""

from types import SimpleNamespace

import numpy as np
import pytest

from catseye.reduction.live.jitter import PRIOR_DEGREES, Jitter

BODIES = {"A": "arm", "B": "arm", "D": "dish"}


def ranges(rng, pairs, *, shake, jitter, noise=2e-5, redundancy=0.6, state=0.0):
    """An epoch's ranges: residuals are what their redundancy leaves of noise and of how far the bodies truly shake.

    state   share of the variance by which the state is believed to be off that it truly is off
    """
    true, believed = [], []
    for a, b in pairs:
        moving = {BODIES.get(a, ""), BODIES.get(b, "")} - {""} if BODIES.get(a, "") != BODIES.get(b, "") else set()
        true.append(np.sqrt(noise**2 + sum((1e-3 * shake[m]) ** 2 for m in moving)))
        believed.append(np.sqrt(noise**2 + sum((1e-3 * jitter.mm[m]) ** 2 for m in moving)))
    true, m = np.array(true), len(pairs)
    off = redundancy**2 + state * (redundancy - redundancy**2)  # E v^2 is r^2 sigma^2 of the shot, r - r^2 of the state
    return SimpleNamespace(
        ranger=[a for a, _ in pairs],
        target=[b for _, b in pairs],
        used=np.ones(m, dtype=bool),
        residual=np.sqrt(off) * true * rng.normal(size=m),
        redundancy=np.full(m, redundancy),
        u_range=np.array(believed),
    )


PAIRS = [("A", "G")] * 40 + [("G", "D")] * 40 + [("A", "B")] * 10 + [("G", "H")] * 10


@pytest.mark.parametrize("true", [{"arm": 0.05, "dish": 0.1}, {"arm": 0.4, "dish": 0.02}])
def test_jitter_of_each_body_is_recovered(true):
    rng, jitter = np.random.default_rng(1), Jitter({"arm": 0.2, "dish": 0.05})
    for _ in range(60):
        jitter.learn(ranges(rng, PAIRS, shake=true, jitter=jitter), BODIES)
    # 144 redundant shots of each in the memory of ten epochs: 6 % of a standard deviation; the noise adds to the small
    assert jitter.mm["arm"] == pytest.approx(true["arm"], rel=0.2)
    assert jitter.mm["dish"] == pytest.approx(true["dish"], rel=0.3)


def test_state_error_as_claimed_biases_jitter_within_the_stated_bound():
    rng, jitter = np.random.default_rng(6), Jitter({"arm": 0.2, "dish": 0.0})
    for _ in range(60):
        jitter.learn(ranges(rng, PAIRS, shake={"arm": 0.3, "dish": 0.0}, jitter=jitter, state=1.0), BODIES)
    assert 0.3 < jitter.mm["arm"] < 1.15 * 0.3 / np.sqrt(0.6)


def test_weak_returns_say_nothing_about_small_jitter():
    rng, jitter = np.random.default_rng(7), Jitter({"arm": 0.2})
    found = []
    for _ in range(40):
        good = ranges(rng, [("A", "G")] * 30, shake={"arm": 0.1}, jitter=jitter)
        weak = ranges(rng, [("A", "G")] * 30, shake={"arm": 0.1}, jitter=jitter, noise=1e-3)
        both = {k: [*getattr(good, k), *getattr(weak, k)] for k in ("ranger", "target")}
        rest = {k: np.concatenate([getattr(good, k), getattr(weak, k)]) for k in ("used", "residual", "redundancy")}
        u = np.concatenate([good.u_range, np.hypot(weak.u_range, 0.0)])
        jitter.learn(SimpleNamespace(**both, **rest, u_range=u), BODIES)
        found.append(jitter.mm["arm"])
    assert np.all(np.abs(np.array(found[10:]) / 0.1 - 1.0) < 0.35)


def test_jitter_has_a_floor_after_a_quiet_epoch():
    rng, jitter = np.random.default_rng(8), Jitter({"arm": 0.2})
    for _ in range(100):
        jitter.learn(ranges(rng, [("A", "G")] * 200, shake={"arm": 0.0}, jitter=jitter, noise=0.0), BODIES)
    assert jitter.mm["arm"] == pytest.approx(0.05, rel=1e-12)


def test_without_shots_jitter_returns_to_the_usual_value():
    rng, jitter = np.random.default_rng(2), Jitter({"arm": 0.2})
    for _ in range(30):
        jitter.learn(ranges(rng, [("A", "G")] * 40, shake={"arm": 1.0}, jitter=jitter), BODIES)
    assert jitter.mm["arm"] > 0.8
    nothing = ranges(rng, [], shake={}, jitter=jitter)
    for _ in range(100):
        jitter.learn(nothing, BODIES)
    assert jitter.mm["arm"] == pytest.approx(0.2, rel=0.05)


def test_ranges_within_a_body_on_the_ground_or_rejected_are_ignored():
    rng, jitter = np.random.default_rng(3), Jitter({"arm": 0.2})
    wild = ranges(rng, [("A", "B")] * 30 + [("G", "H")] * 30, shake={"arm": 5.0}, jitter=jitter)
    wild.residual = wild.residual + 1.0
    jitter.learn(wild, BODIES)
    out = ranges(rng, [("A", "G")] * 30, shake={"arm": 5.0}, jitter=jitter)
    out.used = np.zeros(30, dtype=bool)
    jitter.learn(out, BODIES)
    assert jitter.mm["arm"] == pytest.approx(0.2, rel=1e-12)


def test_range_between_two_bodies_updates_the_one_with_more_jitter():
    rng, jitter = np.random.default_rng(4), Jitter({"arm": 0.2, "dish": 0.03})
    for _ in range(40):
        jitter.learn(ranges(rng, [("A", "D")] * 40, shake={"arm": 0.5, "dish": 0.03}, jitter=jitter), BODIES)
    assert jitter.mm["arm"] == pytest.approx(0.5, rel=0.2)
    assert jitter.mm["dish"] == pytest.approx(0.03, rel=1e-6)


def test_jitter_stays_above_zero_and_needs_a_body():
    jitter = Jitter({"arm": 0.2})
    quiet = SimpleNamespace(
        ranger=["A"] * 500, target=["G"] * 500, used=np.ones(500, dtype=bool), residual=np.zeros(500),
        redundancy=np.ones(500), u_range=np.full(500, 1e-3),
    )  # fmt: skip
    jitter.learn(quiet, BODIES)
    assert jitter.mm["arm"] == pytest.approx(0.05)
    none = Jitter({})
    none.learn(quiet, BODIES)
    assert none.mm == {}


def test_learnt_jitter_decays_by_a_tenth_an_epoch():
    jitter, sums, weight = Jitter({"arm": 0.2}), PRIOR_DEGREES * 0.04, PRIOR_DEGREES
    for shaken in (0.5, 0.1, 0.3):  # mm, of fifty shots that are all redundancy and nothing else
        one = SimpleNamespace(
            ranger=["A"] * 50, target=["G"] * 50, used=np.ones(50, dtype=bool), residual=np.full(50, 1e-3 * shaken),
            redundancy=np.ones(50), u_range=np.full(50, 1e-3 * jitter.mm["arm"]),
        )  # fmt: skip
        jitter.learn(one, BODIES)
        sums, weight = 0.9 * sums + 50 * shaken**2, 0.9 * weight + 50
        assert jitter.mm["arm"] == pytest.approx(np.sqrt(sums / weight), rel=1e-9)
