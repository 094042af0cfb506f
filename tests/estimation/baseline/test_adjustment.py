"""Pillars and instrument: closed forms, a dense model written anew, printed tables, and Monte Carlo."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import EstimationError
from catseye.estimation.baseline.adjustment import BaselineNoise, adjust_baseline, places_in_line
from catseye.estimation.baseline.iso17123 import full_test, is_nothing, same_precision, within_claim
from catseye.estimation.baseline.model import BaselineSights, Claim, Extra, KnownPlaces
from draws import draws, examples, same_sigmas

SEVEN = np.array([0.0, 21.0, 87.0, 160.0, 233.0, 402.0, 598.0])
PAIRS = np.array(list(combinations(range(7), 2)))
START, END = PAIRS.T
ALONG = SEVEN[END] - SEVEN[START]


def sights(x, y, pairs, *, repeats=1, zero=0.0, noise=0.0, systematic=None, effects=(), aimed=False, rng=None):
    """Shots in sets of `repeats`, of pairs in order; directions clockwise from each set-up's own zero."""
    start, end = (np.repeat(side, repeats) for side in np.array(pairs).T)
    m = len(start)
    one = np.repeat(np.arange(len(pairs)), repeats)
    setup = np.cumsum(np.diff(start, prepend=-1) != 0) - 1
    distance = np.hypot(x[end] - x[start], y[end] - y[start]) + zero
    if noise:
        distance = distance + noise * rng.standard_normal(m)
    turned = -np.arctan2(y[end] - y[start], x[end] - x[start]) - 0.3 * setup
    direction = np.mod(turned, 2 * np.pi) if aimed else np.full(m, np.nan)
    columns = np.zeros((m, 0)) if systematic is None else systematic(distance)
    return BaselineSights(start, end, one, setup, distance, np.ones(m), columns, effects, direction, np.full(m, 3e-6))


# ---- the full test procedure


@pytest.mark.parametrize("zero", [0.0, 0.00123, -0.034])
def test_perfect_distances_give_the_planted_zero_and_no_scatter(zero):
    found = full_test(START, END, ALONG + zero, order=range(7))
    assert found.zero == pytest.approx(zero, abs=1e-12)
    assert found.s < 1e-12
    assert found.degrees_of_freedom == 14
    assert np.allclose(found.x, SEVEN, atol=1e-11)


def test_a_planted_pattern_of_residuals_is_returned_exactly():
    """A loop ij + jk - ik sees the zero only; the difference of two loops sees nothing: all of it is residual."""
    pattern = np.zeros(21)
    for (i, j, k), sign in (((0, 1, 2), 1.0), ((3, 4, 5), -1.0)):
        for pair, way in (((i, j), 1.0), ((j, k), 1.0), ((i, k), -1.0)):
            pattern[[tuple(p) for p in PAIRS].index(pair)] += sign * way
    found = full_test(START, END, ALONG + 0.002 + 0.5e-3 * pattern, order=range(7))
    assert found.residual == pytest.approx(0.5e-3 * pattern, abs=1e-12)
    assert found.s == pytest.approx(0.5e-3 * np.sqrt(6.0 / 14.0), rel=1e-9)
    assert found.zero == pytest.approx(0.002, abs=1e-12)
    assert found.u_zero == pytest.approx(found.s * np.sqrt(0.2), rel=1e-9)


@given(st.integers(3, 12), st.integers(0, 10**6))
def test_the_closed_form_of_all_pairs_holds_for_any_number_of_points(p, seed):
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.uniform(5.0, 100.0, p))
    i, j = np.array(list(combinations(range(p), 2))).T
    d = x[j] - x[i] + rng.normal(0.0, 1e-3, len(i))
    b = 2.0 * np.arange(1, p + 1) - p - 1.0
    big = np.array([d[j == k].sum() - d[i == k].sum() for k in range(p)])
    closed = 6.0 * (d.sum() - b @ big / p) / ((p - 1) * (p - 2))
    if len(i) == p:  # three points: three distances, three unknowns
        with pytest.raises(EstimationError, match="redundancy"):
            full_test(i, j, d, order=range(p))
        return
    found = full_test(i, j, d, order=range(p))
    assert found.zero == pytest.approx(closed, abs=1e-10)
    assert found.u_zero == pytest.approx(found.s * np.sqrt(6.0 / ((p - 1) * (p - 2))), rel=1e-8)


def test_direction_and_numbering_do_not_change_a_distance():
    rng = np.random.default_rng(1)
    d = ALONG + 0.001 + 1e-3 * rng.standard_normal(21)
    plain = full_test(START, END, d, order=range(7))
    mixed = np.array([3, 0, 6, 2, 5, 1, 4])  # number of the k-th point along the line
    turned = full_test(mixed[END], mixed[START], d, order=mixed)
    assert (turned.zero, turned.s) == pytest.approx((plain.zero, plain.s), abs=1e-12)
    assert turned.x[mixed] == pytest.approx(plain.x, abs=1e-10)


def test_limits_are_those_of_printed_tables():
    """chi2(0.95, 14) = 23.68, F(0.975; 14, 14) = 2.98, t(0.975; 14) = 2.145: any book of tables."""
    assert within_claim(1.0, 14).limit * 14 == pytest.approx(23.685, abs=5e-4)
    assert same_precision(1.0, 14, 1.0, before=14).limit == pytest.approx(2.979, abs=5e-4)
    assert is_nothing(0.0, 1.0, 14).limit == pytest.approx(2.1448, abs=5e-5)


def test_every_question_can_be_answered_with_no():
    limit = np.sqrt(23.6848 / 14)
    assert within_claim((0.999 * limit) ** 2, 14).passed
    assert not within_claim((1.001 * limit) ** 2, 14).passed
    assert not same_precision(2.0, 14, 1.0, before=14).passed
    assert not same_precision(1.0, 14, 2.0, before=14).passed
    assert not is_nothing(-2.2, 1.0, 14).passed
    rng = np.random.default_rng(2)
    bad = full_test(
        START, END, ALONG + 0.005 + 2.5e-3 * rng.standard_normal(21), order=range(7), sigma=np.full(21, 1e-3)
    )
    assert not within_claim(bad.s**2, 14).passed
    assert not is_nothing(0.005, 2.5e-3 * np.sqrt(0.2), 14).passed


@draws(3000)
def test_good_instruments_fail_each_test_at_its_level(runs):
    """Instruments as claimed, a + b D: 3 standard deviations of the count of 3000 are 1.2 %."""
    rng = np.random.default_rng(3)
    sigma = 0.6e-3 + 1e-6 * ALONG
    failed, before = np.zeros(3), None
    for _ in range(runs):
        d = ALONG + sigma * rng.standard_normal(21)
        found = full_test(START, END, d, order=range(7), sigma=sigma)
        failed[0] += not within_claim(found.s**2, 14).passed
        failed[1] += not is_nothing(found.zero, found.u_zero, 14).passed
        if before is not None:
            failed[2] += not same_precision(found.s, 14, before, before=14).passed
        before = found.s
    assert failed / runs == pytest.approx([0.05] * 3, abs=same_sigmas(0.012, 3000, runs))


# ---- the adjustment


OFF = np.array([0.0, 0.11, -0.2, 0.05, 0.3, -0.1, 0.0])
BOTH = [(i, j) for i in range(7) for j in range(7) if i != j]


def test_pillars_off_the_line_are_found_by_directions():
    found = adjust_baseline(
        sights(SEVEN, OFF, BOTH, zero=0.0123, aimed=True),
        SEVEN + 0.01 * (SEVEN > 0),
        np.zeros(7),
        before=BaselineNoise(noise=TINY),
    )
    assert found.x == pytest.approx(SEVEN, abs=1e-9)
    assert found.y == pytest.approx(OFF, abs=1e-8)
    assert found.of("zero")[0] == pytest.approx(0.0123, abs=1e-9)


TINY = Claim(1e-10, 1e-10, 1e-16)


def test_a_pillar_left_of_the_line_is_read_smaller_on_a_clockwise_circle():
    x, y = np.array([0.0, 100.0, 200.0]), np.array([0.0, 1.0, 0.0])
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
    s = sights(x, np.zeros(3), pairs, aimed=True)
    by_hand = s.direction.copy()
    by_hand[0] -= np.arctan2(1.0, 100.0)  # from 0, pillar 1 stands left of pillar 2
    by_hand[2] += np.arctan2(1.0, 100.0)  # from 1, the line turns right to pillar 2, and left to pillar 0
    by_hand[3] -= np.arctan2(1.0, 100.0)
    by_hand[5] += np.arctan2(1.0, 100.0)
    length = np.hypot(x[s.end] - x[s.start], y[s.end] - y[s.start])
    s = replace(s, distance=length, direction=by_hand)
    assert adjust_baseline(s, x, np.zeros(3), before=BaselineNoise(noise=TINY)).y[1] == pytest.approx(1.0, abs=1e-7)


def dense(s, x, y, noise, columns):
    """All shots at once, written without sets: values, covariance, and the projector P, at the linear model's point."""
    dx, dy = x[s.end] - x[s.start], y[s.end] - y[s.start]
    size = np.hypot(dx, dy)
    a = np.zeros((len(s), len(x)))
    for k in range(len(s)):
        a[k, s.end[k]] += dx[k] / size[k]
        a[k, s.start[k]] -= dx[k] / size[k]
    a = np.concatenate([a[:, 1:], np.ones((len(s), 1)), columns], axis=1)
    same = s.set[:, None] == s.set
    mean = np.array([s.distance[s.set == k].mean() for k in s.set])
    v = noise.shot * np.eye(len(s)) + same * (noise.set + noise.air * np.outer(mean, mean))
    v += s.systematic @ s.systematic.T
    w = np.linalg.inv(v)
    covariance = np.linalg.inv(a.T @ w @ a)
    p = w - w @ a @ covariance @ a.T @ w
    return covariance @ a.T @ w @ (s.distance - size), covariance, p, s.distance - size


def test_sets_means_give_what_all_shots_together_give():
    """Values, covariance and both kinds of standardised residual, against a dense model with repeats from 1 to 5."""
    rng = np.random.default_rng(4)
    noise = Claim(1.2e-8, 4e-8, 1e-12)
    s = sights(SEVEN, np.zeros(7), BOTH, repeats=5, zero=1e-3, noise=2e-4, rng=rng,
               systematic=lambda d: np.stack([1e-6 * d, 2e-5 * np.sin(d)], axis=1), effects=("a", "b"))  # fmt: skip
    s = s.only(rng.random(len(s)) < 0.6)
    wave = np.cos(s.distance)[:, None]
    wave = s.mean(wave)[s.set]
    steady = replace(s, systematic=s.mean(s.systematic)[s.set])
    found = adjust_baseline(steady, SEVEN, np.zeros(7), before=BaselineNoise(noise=noise), extra=Extra(("wave",), wave))
    values, covariance, p, y = dense(steady, SEVEN, np.zeros(7), noise, wave)
    got = found.values - np.concatenate([SEVEN[1:], [0.0, 0.0]])
    assert got == pytest.approx(values, abs=1e-12)
    assert found.covariance == pytest.approx(covariance, rel=1e-7, abs=1e-18)  # the noise given, not estimated
    alone = np.isnan(found.w_shot)
    assert set(s.shots[s.set[alone]]) == {1}
    w = (p @ y) / np.sqrt(np.diag(p))
    assert found.w_shot[~alone] == pytest.approx(w[~alone], rel=1e-6, abs=1e-8)
    group = (s.set == np.arange(len(s.shots))[:, None]).astype(float)
    assert found.w_set == pytest.approx((group @ p @ y) / np.sqrt(np.diag(group @ p @ group.T)), rel=1e-6, abs=1e-8)
    freedom = len(s) - 8
    assert found.variance_factor == pytest.approx(y @ p @ y / freedom, rel=1e-9)
    assert found.freedom_sets + found.freedom_shots == freedom


def test_known_pillars_determine_scale_and_zero():
    s = sights(SEVEN, OFF, BOTH)
    s = replace(s, distance=s.distance * (1 + 3e-6) - 0.002)
    known = KnownPlaces(SEVEN, OFF, np.arange(1, 7), 1e-10 * (np.eye(6) + 0.5))
    found = adjust_baseline(s, SEVEN, OFF, known=known, scale=True, before=BaselineNoise(noise=TINY))
    assert found.of("scale")[0] == pytest.approx(3e-6, rel=1e-6)
    assert found.of("zero")[0] == pytest.approx(-0.002, abs=1e-9)


def test_cyclic_terms_come_back_with_their_signs():
    s = sights(SEVEN + 0.13 * np.arange(7) ** 2, np.zeros(7), BOTH)
    x = SEVEN + 0.13 * np.arange(7) ** 2
    wave = np.stack([np.cos(2 * np.pi * s.distance / 1.5), np.sin(2 * np.pi * s.distance / 1.5)], axis=1)
    bent = replace(s, distance=s.distance + wave @ [3e-4, -2e-4])
    found = adjust_baseline(bent, x, np.zeros(7), before=BaselineNoise(noise=TINY), extra=Extra(("c", "s"), wave))
    assert (found.of("c")[0], found.of("s")[0]) == pytest.approx((3e-4, -2e-4), abs=1e-9)


def test_undetermined_parameters_are_refused_by_name():
    ends = sights(np.array([0.0, 50.0]), np.zeros(2), [(0, 1), (1, 0)])
    with pytest.raises(EstimationError, match=r"do not determine .*zero"):
        adjust_baseline(ends, [0.0, 50.0], [0.0, 0.0], before=BaselineNoise(noise=TINY))
    few = sights(SEVEN[:4], np.zeros(4), list(combinations(range(4), 2)))
    with pytest.raises(EstimationError, match="2 redundant sets cannot determine the noise"):
        adjust_baseline(few, SEVEN[:4], np.zeros(4))


def test_pillar_with_one_distance_is_refused():
    with pytest.raises(EstimationError, match="pillar number 3 has 1 distances"):
        places_in_line([0, 0, 1, 1], [1, 2, 2, 3], [20.0, 120.0, 100.0, 30.0], count=4)


def test_full_length_and_parts_determine_pillars_and_zero():
    """No pillar between the ends has two distances to pillars placed before it."""
    pairs = [(0, 3), (0, 1), (1, 2), (2, 3), (3, 0), (1, 0), (2, 1), (3, 2)]
    x = np.array([0.0, 100.0, 250.0, 400.0])
    s = sights(x, np.zeros(4), pairs, zero=0.0021)
    assert places_in_line(s.start, s.end, s.distance, count=4) == pytest.approx(x, abs=0.01)
    assert adjust_baseline(s, x, np.zeros(4), before=BaselineNoise(noise=TINY)).of("zero")[0] == pytest.approx(
        0.0021, abs=1e-9
    )


def test_pillar_on_ambiguous_side_is_refused():
    with pytest.raises(EstimationError, match="on which side pillar number"):
        places_in_line([0, 0, 1, 1, 2], [1, 2, 2, 3, 3], [200.0, 100.0, 100.0, 50.0, 50.0 * 5**0.5], count=4)


def test_unchecked_set_has_no_standardised_residual():
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1), (0, 3)]
    s = sights(np.array([0.0, 100.0, 250.0, 400.0]), np.zeros(4), pairs, noise=1e-3, rng=np.random.default_rng(1))
    found = adjust_baseline(s, [0.0, 100.0, 250.0, 400.0], np.zeros(4), before=BaselineNoise(noise=TINY))
    assert np.isnan(found.w_set[-1])
    assert np.isfinite(found.w_set[:-1]).all()


def test_known_uncertainties_have_no_degrees_of_freedom():
    """All of it scatter: those of the sets; a tenth of the variance: a hundred times as many."""
    rng, plain = np.random.default_rng(9), sights(SEVEN, np.zeros(7), BOTH)
    s = replace(plain, distance=plain.distance + 3e-4 * rng.standard_normal(42))
    alone = adjust_baseline(s, SEVEN, np.zeros(7))
    assert alone.freedom_of("zero") == pytest.approx(35.0)
    part = alone.of("zero")[1]
    s = replace(s, systematic=np.full((42, 1), 3.0 * part), effects=("zero",))
    assert adjust_baseline(s, SEVEN, np.zeros(7)).freedom_of("zero") == pytest.approx(3500.0, rel=0.05)
    assert adjust_baseline(s, SEVEN, np.zeros(7), before=BaselineNoise(noise=TINY)).freedom_of("zero") == np.inf


@examples(100)
@given(st.permutations(range(7)))
def test_places_follow_from_distances_in_any_numbering(order):
    order = np.array(order)
    found = places_in_line(START, END, np.abs(SEVEN[order][END] - SEVEN[order][START]), count=7)
    assert np.abs(found[END] - found[START]) == pytest.approx(np.abs(SEVEN[order][END] - SEVEN[order][START]))
    low, high = int(np.argmin(found)), int(np.argmax(found))
    assert low < high


# ---- a claimed uncertainty is tested against scatter


def campaign(rng, noise, systematic):
    """One campaign of 42 sets of 4 with everything that the covariance claims."""
    s = sights(SEVEN, np.zeros(7), BOTH, repeats=4)
    d = s.mean(s.distance)
    sets = np.sqrt(noise.set) * rng.standard_normal(42) + np.sqrt(noise.air) * d * rng.standard_normal(42)
    columns = np.stack([8e-7 * s.distance, np.where(s.start == 2, 3e-4, 0.0)], axis=1)
    seen = s.distance + sets[s.set] + np.sqrt(noise.shot) * rng.standard_normal(len(s))
    if systematic:
        seen = seen + columns @ rng.standard_normal(2)
    return replace(s, distance=seen + 1e-3, systematic=columns, effects=("air", "two"))


def scatter(runs, seed):
    rng, noise = np.random.default_rng(seed), Claim(1e-8, 6e-8, 1.5e-12)
    values, claimed, components, far = [], [], [], []
    for _ in range(runs):
        found = adjust_baseline(campaign(rng, noise, True), SEVEN, np.zeros(7))
        values.append(found.values)
        claimed.append(found.covariance)
        components.append([found.noise.shot, found.noise.set, found.noise.air])
        miss = found.values - np.concatenate([SEVEN[1:], [1e-3]])
        far.append(miss @ np.linalg.solve(found.covariance, miss))
    values, claimed = np.array(values), np.mean(claimed, axis=0)
    return values, claimed, np.mean(components, axis=0), np.mean(far), noise


def check_scatter(runs, seed, tolerance):
    values, claimed, components, far, noise = scatter(runs, seed)
    assert values.std(axis=0) == pytest.approx(np.sqrt(np.diag(claimed)), rel=tolerance)
    u = np.sqrt(np.diag(claimed))
    assert np.corrcoef(values.T) == pytest.approx(claimed / np.outer(u, u), abs=tolerance + 0.03)
    assert values.mean(axis=0) == pytest.approx(np.concatenate([SEVEN[1:], [1e-3]]), abs=3.5 * u.max() / runs**0.5)
    assert components[0] == pytest.approx(noise.shot, rel=0.05)
    sizes = components[1] + components[2] * np.mean(np.abs(SEVEN[:, None] - SEVEN) ** 2)
    assert sizes == pytest.approx(noise.set + noise.air * np.mean(np.abs(SEVEN[:, None] - SEVEN) ** 2), rel=0.15)
    assert far == pytest.approx(7.0, rel=0.25)  # above 7 by the noise's own uncertainty, 35 degrees of freedom


@draws(150)
def test_claimed_covariance_is_the_scatter_of_campaigns(runs):
    """A standard deviation of 150 is known to 5.8 %: three of these, and the largest of seven."""
    check_scatter(runs, 5, same_sigmas(0.18, 150, runs))


@pytest.mark.slow
def test_claimed_covariance_is_the_scatter_of_2000_campaigns():
    check_scatter(2000, 6, 0.05)


def test_omitted_systematic_effects_are_detected():
    """The same campaigns judged without their common effects: the longest distance scatters by twice its claim."""
    rng, noise, last, claimed = np.random.default_rng(7), Claim(1e-8, 6e-8, 1.5e-12), [], []
    for _ in range(60):
        s = campaign(rng, noise, True)
        s = replace(s, systematic=np.zeros((len(s), 0)), effects=())
        found = adjust_baseline(s, SEVEN, np.zeros(7), before=BaselineNoise(noise=noise))
        last.append(found.of("x 6")[0])
        claimed.append(found.of("x 6")[1])
    assert np.std(last) > 1.3 * np.mean(claimed)


def test_components_maximise_the_restricted_likelihood_of_all_shots():
    """Against a likelihood of the single shots written anew, maximised without derivatives; unequal sets."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(8)
    s = campaign(rng, Claim(4e-8, 6e-8, 1.5e-12), True)
    s = s.only(rng.random(len(s)) < 0.5)
    steady = replace(s, systematic=s.mean(s.systematic)[s.set])
    found = adjust_baseline(steady, SEVEN, np.zeros(7)).noise

    def criterion(theta):
        """log |V| + log |A' V^-1 A| + y' P y; P has the rank m - u and -log of its product of eigenvalues is both."""
        _, _, p, y = dense(steady, SEVEN, np.zeros(7), Claim(*np.exp(theta)), np.zeros((len(s), 0)))
        size = np.linalg.eigvalsh(p)[7:]
        return y @ p @ y - np.sum(np.log(size))

    start = np.log([found.shot * 1.3, found.set * 0.7, found.air * 1.4])
    best = minimize(criterion, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-6})
    assert np.exp(best.x) == pytest.approx([found.shot, found.set, found.air], rel=0.01)
