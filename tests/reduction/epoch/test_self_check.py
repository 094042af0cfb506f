"""Averages of residuals: planted errors are found with their size, clean nights show none, allowances cover."""

from types import SimpleNamespace

import numpy as np
import pytest

from catseye.constants import MILLIMETRE, PPM, SECONDS_PER_DAY
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Distances, Linear
from catseye.optics.retroreflector.kinds.registry import HOLLOW, PRISM
from catseye.reduction.epoch.allowance import NOTHING, for_families
from catseye.reduction.epoch.self_check import (
    CRITICAL,
    ELEVATION,
    FAMILIES,
    FEWEST,
    HEIGHT,
    INCIDENCE,
    LENGTH,
    RANGER,
    TIME,
    Average,
    FamilyCheck,
    self_checks,
    sortings,
    unit_of,
)
from catseye.reduction.site.places import RangedPoint

SIGMA, INDEX, ROUNDS, HOURS = 30e-6, 1.00026, 4, 3.0
RANGERS, TARGETS = 6, 40


class Scene:
    """Six rangers about forty targets, each shot four times in three hours, in turn; observations made to measure."""

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        angle = 2 * np.pi * np.arange(RANGERS) / RANGERS
        ring = np.stack([100 * np.cos(angle), 100 * np.sin(angle), rng.uniform(0.0, 20.0, RANGERS)], axis=1)
        cloud = rng.uniform([-50, -50, 5], [50, 50, 100], (TARGETS, 3))
        self.names = (*(f"ZY{i + 101}" for i in range(RANGERS)), *(f"T{i:02d}" for i in range(TARGETS)))
        self.true = np.concatenate([ring, cloud])
        self.places = {
            n: RangedPoint(n, PRISM, p, np.array([0.6, 0.0, -0.8])) if n < "T20" else RangedPoint(n, HOLLOW, p)
            for n, p in zip(self.names, self.true, strict=True)
        }
        order = [(r, t) for _ in range(ROUNDS) for t in range(TARGETS) for r in range(RANGERS)]
        self.ranger = np.array([r for r, _ in order])
        self.target = RANGERS + np.array([t for _, t in order])
        self.seconds = np.linspace(0.0, HOURS * 3600.0, len(order))
        shots = SimpleNamespace(
            target=tuple(self.names[t] for t in self.target), mjd_utc=60000.0 + self.seconds / SECONDS_PER_DAY
        )
        self.campaign = SimpleNamespace(shots=shots)
        self.own = {self.names[r]: np.flatnonzero(self.ranger == r) for r in range(RANGERS)}
        self.distance = np.linalg.norm(self.true[self.target] - self.true[self.ranger], axis=1)
        self.sortings = sortings(self.campaign, self.places, self.own)

    def family(self, family):
        return next(s for s in self.sortings if s.family is family)

    def bins(self, family):
        """Bin of every shot."""
        every = np.full(len(self.ranger), -1)
        for name, own in self.own.items():
            every[own] = self.family(family).bins(name, own)
        return every

    def errors(self, family, by_bin):
        """(m,) m, of the optical lengths: an error of each bin in the family's unit."""
        bins = self.bins(family)
        unit = PPM * self.distance if family.unit == "ppm" else MILLIMETRE * INDEX
        return np.where(bins < 0, 0.0, np.asarray(by_bin)[bins]) * unit

    def adjusted(self, rng, errors=0.0, *, allowed=None, rejected=()):
        """Groups and their adjustment; of a family that is allowed for, with a standard deviation, as parameters."""
        n, count = 3 * len(self.true), 0
        observed = INDEX * self.distance + errors + SIGMA * rng.standard_normal(len(self.ranger))
        nuisance, coefficient = np.zeros((len(observed), 0), dtype=int), np.zeros((len(observed), 0))
        if allowed is not None:
            family, sigma = allowed
            count = len(self.family(family).labels)
            nuisance = np.where(self.bins(family) < 0, -1, n + self.bins(family))[:, None]
            coefficient = unit_of(family, np.full(len(observed), INDEX), self.distance)[:, None]
        groups, active = [], []
        for name, own in self.own.items():
            one = np.ones(len(own))
            groups.append(
                Distances(
                    name,
                    observed[own],
                    SIGMA**2 * one,
                    3 * self.ranger[own],
                    3 * self.target[own],
                    INDEX * one,
                    0.0 * one,
                    nuisance[own],
                    coefficient[own],
                )
            )
            active.append(~np.isin(own, rejected))
        survey = self.true[:RANGERS].ravel() + 0.1e-3 * rng.standard_normal(3 * RANGERS)
        columns = np.arange(3 * RANGERS)
        groups.append(Linear("survey", survey, np.full(3 * RANGERS, 1e-8), columns, np.eye(3 * RANGERS)))
        active.append(np.ones(3 * RANGERS, dtype=bool))
        if allowed is not None:
            at = n + np.arange(count)
            groups.append(Linear("allowed", np.zeros(count), np.full(count, sigma**2), at, np.eye(count)))
            active.append(np.ones(count, dtype=bool))
        start = np.concatenate([self.true.ravel(), np.zeros(count)])
        return groups, adjust(start, groups, active=active)

    def checks(self, groups, solution, sorts=None):
        lines = [(name, own, np.full(len(own), INDEX), self.distance[own]) for name, own in self.own.items()]
        return {c.family: c for c in self_checks(groups, solution, sorts or self.sortings, lines)}


SCENE = Scene()


def test_every_family_sorts_the_shots_by_what_its_name_says():
    assert {s.family for s in SCENE.sortings} == set(FAMILIES)
    a, b = SCENE.true[SCENE.ranger], SCENE.true[SCENE.target]
    up = (b - a)[:, 2] / SCENE.distance
    value = {
        TIME: SCENE.seconds,
        HEIGHT: 0.5 * (a + b)[:, 2],
        RANGER: SCENE.ranger,
        ELEVATION: np.degrees(np.arcsin(up)),
        LENGTH: SCENE.distance,
    }
    for family, own in value.items():
        bins = SCENE.bins(family)
        count = len(SCENE.family(family).labels)
        assert set(bins) == set(range(count))
        for low in range(count - 1):  # in order, none overlaps the next
            assert own[bins == low].max() <= own[bins == low + 1].min()
        if family not in (TIME, RANGER):
            assert np.ptp(np.bincount(bins)) <= 0.25 * len(bins) / count  # as many in each, but for repeats on a line
    assert len(SCENE.family(TIME).labels) == 6  # half an hour each of three
    assert SCENE.family(RANGER).labels == SCENE.names[:RANGERS]


def test_only_shots_on_a_face_have_an_incidence():
    bins = SCENE.bins(INCIDENCE)
    on_face = np.array([SCENE.names[t] < "T20" for t in SCENE.target])
    assert np.all(bins[~on_face] == -1)
    assert np.all(bins[on_face] >= 0)
    a, b = SCENE.true[SCENE.ranger], SCENE.true[SCENE.target]
    angle = np.degrees(np.arccos(((a - b) / SCENE.distance[:, None]) @ [0.6, 0.0, -0.8]))
    for low in range(4):
        assert angle[bins == low].max() <= angle[bins == low + 1].min()


def test_labels_say_the_edges_in_the_units_that_people_use():
    assert SCENE.family(TIME).labels[:2] == ("0 to 30 min", "30 to 60 min")
    assert all(label.endswith(" m") for label in SCENE.family(HEIGHT).labels)
    assert all(label.endswith(" °") for label in SCENE.family(ELEVATION).labels)


def test_a_bin_that_is_asked_for_some_shots_is_theirs():
    own = SCENE.own["ZY103"][5:9]
    np.testing.assert_array_equal(SCENE.family(HEIGHT).bins("ZY103", own), SCENE.bins(HEIGHT)[own])


@pytest.mark.parametrize(
    ("family", "number", "size"), [(TIME, 2, 0.5), (HEIGHT, 4, 1.0), (RANGER, 3, 0.6), (ELEVATION, 0, 0.1)]
)
def test_a_planted_error_is_found_and_named_with_its_size(family, number, size):
    rng = np.random.default_rng(number)
    by_bin = np.zeros(len(SCENE.family(family).labels))
    by_bin[number] = size
    checks = SCENE.checks(*SCENE.adjusted(rng, SCENE.errors(family, by_bin)))
    check = checks[family]
    assert not check.passed
    assert check.worst.label == SCENE.family(family).labels[number]
    assert check.worst.estimate == pytest.approx(size, abs=4.0 * check.worst.u)
    assert check.worst.u < 0.25 * size
    assert check.worst.shots == np.sum(SCENE.bins(family) == number)
    # it says so, and how much is allowed for: at least what one wrong bin of so many makes in the mean of squares
    text = check.text()
    assert family.name in text
    assert check.worst.label in text
    assert f"{check.worst.shots} shots" in text
    assert check.spread >= 0.8 * size / np.sqrt(len(by_bin))
    assert check.spread < 1.5 * size
    assert max(checks.values(), key=lambda c: abs(c.worst.w)).family is family  # no other family shows it as well


def test_what_is_allowed_for_is_the_spread_of_all_bins_and_not_of_the_worst_alone():
    """Half a ppm either way in turn. By hand: the points take up what bins have in common, so each is judged against
    the mean of the other five, 0.1 ppm of the other sign: 0.6 ppm. A sixth of the worst's square would be 0.24.
    """
    rng = np.random.default_rng(19)
    check = SCENE.checks(*SCENE.adjusted(rng, SCENE.errors(TIME, 0.5 * (-1.0) ** np.arange(6))))[TIME]
    assert check.spread == pytest.approx(0.6, rel=0.2)  # a bin has two thirds of the lines, which ties bins to some


def test_what_a_bin_is_found_to_be_off_is_as_uncertain_as_is_said():
    rng = np.random.default_rng(20)
    by_bin = np.array([0.0, 0.4, 0.0, 0.0, 0.0, 0.0])
    errors = SCENE.errors(TIME, by_bin)
    sorts = [SCENE.family(TIME)]
    w = [
        (average.estimate - 0.4) / average.u
        for _ in range(20)
        for average in [SCENE.checks(*SCENE.adjusted(rng, errors), sorts)[TIME].averages[1]]
    ]
    assert abs(np.mean(w)) < 4.0 / np.sqrt(20.0)
    assert 0.5 < np.std(w) < 1.6  # of twenty draws: four sigmas of their scatter, 0.16 each


def test_a_clean_night_shows_nothing_and_its_averages_scatter_by_one():
    rng = np.random.default_rng(30)
    w = []
    for _ in range(10):
        checks = SCENE.checks(*SCENE.adjusted(rng))
        assert set(checks) == set(FAMILIES)
        for check in checks.values():
            assert check.passed
            assert check.spread == 0.0
            w += [a.w for a in check.averages]
    assert len(w) > 250
    # 310 averages, of which those of one family hang together: some hundred independent ones, to 7 %
    assert np.std(w) == pytest.approx(1.0, abs=0.28)
    assert np.max(np.abs(w)) < CRITICAL


def test_an_error_too_small_to_show_is_not_claimed():
    rng = np.random.default_rng(31)
    checks = SCENE.checks(*SCENE.adjusted(rng, SCENE.errors(TIME, [0.0, 0.02, 0.0, 0.0, 0.0, 0.0])))
    assert checks[TIME].passed
    assert checks[TIME].averages[1].u > 0.01


def test_rejected_shots_and_bins_of_few_shots_say_nothing():
    rng = np.random.default_rng(32)
    late = np.flatnonzero(SCENE.bins(TIME) == 4)
    errors = np.zeros(len(SCENE.ranger))
    errors[late[: len(late) - FEWEST + 1]] = 0.01  # so far off that they are left out
    solution = SCENE.adjusted(rng, errors, rejected=late[: len(late) - FEWEST + 1])
    check = SCENE.checks(*solution)[TIME]
    assert check.passed
    assert [a.label for a in check.averages] == [label for k, label in enumerate(SCENE.family(TIME).labels) if k != 4]


def test_what_a_family_shows_is_allowed_for_and_then_the_claim_covers_it():
    """Every height has an error of its own: without the allowance the targets' claims are too small, with it not."""
    rng = np.random.default_rng(33)
    count = len(SCENE.family(HEIGHT).labels)
    plain, covered, allowed = [], [], []
    for _ in range(8):
        errors = SCENE.errors(HEIGHT, 1.0 * rng.standard_normal(count))
        groups, solution = SCENE.adjusted(rng, errors)
        checks = SCENE.checks(groups, solution)
        spread = checks[HEIGHT].spread
        allowed.append(spread)
        plain.append(misfit(solution))
        groups, again = SCENE.adjusted(rng, errors, allowed=(HEIGHT, spread))
        covered.append(misfit(again))
        checked = SCENE.checks(groups, again)
        assert checked[HEIGHT].passed  # a bin's parameter has it
    # 1 ppm, of which five bins' mean square is known to a half; one at a time they show less than they have together
    assert 0.4 < np.sqrt(np.mean(np.square(allowed))) < 1.6
    assert np.mean(plain) > 3.0
    assert np.mean(covered) < 2.0


def misfit(solution):
    """Mean square of the targets' errors in height over their claim."""
    at = 3 * np.arange(RANGERS, len(SCENE.true)) + 2
    error = solution.x[at] - SCENE.true[RANGERS:, 2]
    return np.mean(error**2 / solution.q.diagonal()[at])


def check(family, w, *, spread=0.3):
    return FamilyCheck(family, (Average("a", 1.0, 1.0, 50), Average("b", w, 1.0, 40)), spread)


def test_one_family_at_a_time_is_allowed_for_the_worst_and_none_twice():
    assert for_families(NOTHING, [check(TIME, 3.9)]) is NOTHING
    first = for_families(NOTHING, [check(TIME, 5.0), check(HEIGHT, -9.0), check(RANGER, 2.0)])
    assert first.families == {HEIGHT: 0.3}
    assert len(first.texts) == 1
    assert "by height" in first.texts[0]
    assert "w -9.0" in first.texts[0]
    second = for_families(first, [check(TIME, 5.0), check(HEIGHT, -9.0)])
    assert set(second.families) == {HEIGHT, TIME}
    assert for_families(second, [check(TIME, 5.0), check(HEIGHT, -9.0)]) is second


def test_units_are_ppm_of_the_path_or_millimetres_of_the_range():
    index, distance = np.array([1.00026, 1.0]), np.array([100.0, 50.0])
    np.testing.assert_allclose(unit_of(HEIGHT, index, distance), [1e-4, 5e-5])
    np.testing.assert_allclose(unit_of(RANGER, index, distance), [1.00026e-3, 1e-3])


def test_a_campaign_of_few_shots_is_sorted_by_time_and_ranger_alone():
    own = {name: shots[:3] for name, shots in SCENE.own.items()}
    found = sortings(SCENE.campaign, SCENE.places, own)
    assert {s.family for s in found} == {TIME, RANGER}
    none = sortings(SCENE.campaign, SCENE.places, {})
    assert {s.family for s in none} <= {RANGER}
