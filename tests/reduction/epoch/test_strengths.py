"""Strengths of processes by what observations show of them: simulated with known truth, against the scatter."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from catseye.constants import PPM
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, adjust
from catseye.estimation.observations.kinds import Linear
from catseye.optics.retroreflector.kinds.registry import HOLLOW
from catseye.reduction.epoch.air.process import LEAST, MOST, USUAL, WIDE, AirKnots, AirStrength
from catseye.reduction.epoch.motion.telescope_motion import PARTS, WALK, TelescopeKnots
from catseye.reduction.epoch.strengths import (
    ERRORS,
    EXPERIENCE,
    LITTLE_PPM,
    MOST_PPM,
    Processes,
    ProcessStrength,
    _eddies,
    _estimated_strengths,
    _Evidence,
    with_processes,
)
from catseye.reduction.site.places import RangedPoint

LOW, HIGH = (1e-3,), (10.0,)


def shape(n, time=5.0):
    """Covariance of n knots that forget in five."""
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    return np.exp(-apart / time)


def drawn(rng, covariance):
    return np.linalg.cholesky(covariance) @ rng.standard_normal(len(covariance))


def observed(rng, truth, sigma, per=2):
    """Knots observed directly, each a few times with noise: a matrix that mixes neighbours."""
    n = len(truth)
    matrix = np.tile(np.eye(n) + 0.3 * np.eye(n, k=1), (per, 1))
    values = matrix @ truth + sigma * rng.standard_normal(len(matrix))
    return Linear("readings", values, np.full(len(matrix), sigma**2), np.arange(n), matrix)


def prior(covariance):
    n = len(covariance)
    return Linear("prior", np.zeros(n), covariance, np.arange(n), np.eye(n))


def strength_of(rng, true, *, sigma=0.3, before=0.5, usual=0.5, n=60, each=None):
    """A process of true strength, drawn, observed, adjusted with the strength `before`, and its strength climbed."""
    own = shape(n)
    groups = [observed(rng, true * drawn(rng, own), sigma), prior(before**2 * own)]
    solution = adjust(np.zeros(n), groups)
    shown = _Evidence.of(solution, np.arange(n), before**2 * own, 0.0 * own, [own])
    return _estimated_strengths([shown], np.array([before]), np.array([usual]), low=LOW, high=HIGH)[0]


@pytest.mark.parametrize("true", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("before", [0.1, 1.0])
def test_a_processes_strength_is_recovered_whatever_was_taken_before(true, before):
    rng = np.random.default_rng(int(10 * true))
    found = [strength_of(rng, true, sigma=0.1 * true, before=before, usual=true) for _ in range(30)]
    # sixty knots that forget in five and are seen well: sixty squares and six of experience, a tenth each way
    scatter = 1.0 / np.sqrt(2.0 * 60.0)
    assert np.mean(found) / true == pytest.approx(1.0, abs=4.0 * scatter / np.sqrt(30.0) + 0.02)
    assert 0.6 * scatter < np.std(found) / true < 1.3 * scatter


def test_the_estimate_does_not_depend_on_the_strength_it_began_with():
    seeds = [strength_of(np.random.default_rng(5), 1.0, before=b) for b in (0.05, 0.5, 5.0)]
    # steps end below a tenth of a variance's logarithm; the next is its square or so
    assert max(seeds) / min(seeds) < 1.03


def test_a_strength_of_experience_is_worth_six_observations():
    """By hand: n knots seen exactly, each its own: n (S/s^2 - 1) + 6 (e^2/s^2 - 1) = 0, S the mean square."""
    rng = np.random.default_rng(2)
    for n in (4, 400):
        truth = 3.0 * rng.standard_normal(n)
        own = np.eye(n)
        groups = [Linear("seen", truth, np.full(n, 1e-8), np.arange(n), np.eye(n)), prior(own)]
        shown = _Evidence.of(adjust(np.zeros(n), groups), np.arange(n), own, 0.0 * own, [own])
        (found,) = _estimated_strengths([shown], np.array([1.0]), np.array([1.0]), low=LOW, high=HIGH)
        expected = np.sqrt((truth @ truth + EXPERIENCE * 1.0) / (n + EXPERIENCE))
        # 3 %: steps end below a tenth of a variance's logarithm
        assert found == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("before", [0.05, 1.0])
def test_where_nothing_is_observed_the_strength_stays_the_usual_one(before):
    n = 20
    own = shape(n)
    far = Linear("elsewhere", np.zeros(1), np.ones(1), np.array([n]), np.ones((1, 1)))
    solution = adjust(np.zeros(n + 1), [prior(before**2 * own), far])
    shown = _Evidence.of(solution, np.arange(n), before**2 * own, 0.0 * own, [own])
    (found,) = _estimated_strengths([shown], np.array([before]), np.array([0.3]), low=LOW, high=HIGH)
    assert found == pytest.approx(0.3, rel=0.05)  # to a tenth of a variance's logarithm


def test_strengths_end_at_their_limits():
    rng = np.random.default_rng(1)
    still = [strength_of(rng, 1e-9, sigma=1e-6, before=0.01, usual=0.01) for _ in range(2)]
    assert max(still) < 0.01
    n, own = 60, shape(60)
    groups = [observed(rng, 300.0 * drawn(rng, own), 0.1), prior(own)]
    shown = _Evidence.of(adjust(np.zeros(n), groups), np.arange(n), own, 0.0 * own, [own])
    assert _estimated_strengths([shown], np.array([1.0]), np.array([1.0]), low=LOW, high=HIGH) == HIGH


def test_two_processes_of_one_strength_are_judged_together():
    rng = np.random.default_rng(4)
    together, apart = [], []
    for _ in range(25):
        shown = []
        for _ in range(2):
            own = shape(30)
            groups = [observed(rng, drawn(rng, own), 0.1), prior(own)]
            shown.append(_Evidence.of(adjust(np.zeros(30), groups), np.arange(30), own, 0.0 * own, [own]))
        one = np.ones(1)
        together.append(_estimated_strengths(shown, one, one, low=LOW, high=HIGH)[0])
        apart += [_estimated_strengths([each], one, one, low=LOW, high=HIGH)[0] for each in shown]
    assert np.std(together) < np.std(apart)
    assert np.mean(together) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * 60.0 * 25.0) + 0.02)


def test_scores_are_derivatives_of_the_restricted_likelihood():
    """What is climbed, against differences of the dense likelihood of the observations themselves."""
    rng = np.random.default_rng(6)
    n, strength = 15, np.array([0.7, 0.4])
    shapes = [shape(n), np.eye(n)]
    known = 0.05 * np.eye(n)
    group = observed(rng, drawn(rng, known + shapes[0] + 0.1 * shapes[1]), 0.3)
    line = Linear(
        "readings", group.observed, group.covariance, np.arange(n + 1), np.hstack([group.matrix, np.ones((2 * n, 1))])
    )

    def total(s):
        return known + sum(a**2 * part for a, part in zip(s, shapes, strict=True))

    def likelihood(logs):
        """ln L, restricted: the last column, a common offset, has no prior."""
        covariance = group.matrix @ total(np.exp(0.5 * logs)) @ group.matrix.T + 0.09 * np.eye(2 * n)
        one = np.ones(2 * n)
        inverse = np.linalg.inv(covariance)
        inverse = inverse - np.outer(inverse @ one, one @ inverse) / (one @ inverse @ one)
        free = np.linalg.slogdet(covariance)[1] + np.log(one @ np.linalg.inv(covariance) @ one)
        return -0.5 * (free + group.observed @ inverse @ group.observed)

    solution = adjust(np.zeros(n + 1), [line, prior(total(np.ones(2)))])  # with other strengths than are asked for
    shown = _Evidence.of(solution, np.arange(n), total(np.ones(2)), known, shapes)
    seen, expected, _ = shown.scores(strength)
    for k in range(2):
        step = np.zeros(2)
        step[k] = 1e-4
        logs = 2.0 * np.log(strength)
        slope = (likelihood(logs + step) - likelihood(logs - step)) / 2e-4
        # 1e-5: a central difference of a smooth function of order ten
        assert 0.5 * (seen[k] - expected[k]) == pytest.approx(slope, rel=1e-5, abs=1e-6)


# -- the processes of a campaign --------------------------------------------------------------------------------------


@dataclasses.dataclass
class Little:
    """A record that says its station's air to 20 mK."""

    def covariance(self, seconds):
        return 4e-4 * np.isclose(seconds[:, None], seconds)


PLACES = {
    name: RangedPoint(name, HOLLOW, np.array(place), body="dish")
    for name, place in {"DP001": [10.0, 0.0, 60.0], "DP002": [-10.0, 5.0, 70.0]}.items()
}


def processes(*, hours=2.0, sunshine=False):
    """Those of a campaign of two stations, and the number of its parameters, which are nothing else."""
    knots = AirKnots.of((0.0, 3600.0 * hours), 1500, [Little(), Little()], [], zeta=np.array([-1.0, 1.0]))
    telescope = TelescopeKnots.of(3600.0 * hours, PLACES)
    k, j = len(knots.level) + len(knots.slope), len(knots.across)
    errors = np.arange(4 if sunshine else 2)
    first = len(errors)
    air = SimpleNamespace(knots=knots, heights=np.array([0.0, 50.0]))
    between = first + np.arange(k)
    across = first + k + np.arange(2 * j).reshape(2, j)
    moving = first + k + 2 * j + np.arange(len(PARTS) * len(telescope.knots)).reshape(len(PARTS), -1)
    return Processes(air, (between, across), errors, telescope, moving), int(moving.max()) + 1


@pytest.mark.parametrize("sunshine", [False, True])
def test_priors_hold_every_parameter_once_with_its_own_uncertainty(sunshine):
    every, count = processes(sunshine=sunshine)
    priors = every.priors(ProcessStrength())
    columns = np.concatenate([np.ravel(p.columns) for p in priors])
    assert sorted(columns.tolist()) == list(range(count))
    solution = adjust(np.zeros(count), priors)
    u = np.sqrt(solution.q.diagonal())
    np.testing.assert_allclose(u[:2], 60.0)  # s, of a lag
    if sunshine:
        np.testing.assert_allclose(u[2:4], 0.5)  # °C, in calm sunshine
    # by hand: half of two records' 20 mK each, the wide strengths of a campaign of which nothing is known yet
    level = np.sqrt(2e-4 + WIDE.level_c**2 + WIDE.level_fast_c**2)
    np.testing.assert_allclose(u[every.columns[0][:5]], level, rtol=1e-4)
    np.testing.assert_allclose(u[every.columns[1]], WIDE.across_c_per_m, rtol=1e-6)
    np.testing.assert_allclose(u[every.moving[:, -1]], WALK, rtol=1e-6)  # an hour from the middle


def seen_processes(rng, truth, *, sigma):
    """A campaign's processes of true strengths, drawn and observed parameter by parameter."""
    every, count = processes()
    x = np.zeros(count)
    for group in every.priors(truth):
        covariance = np.diag(group.covariance) if group.covariance.ndim == 1 else group.covariance
        x[np.ravel(group.columns)] = drawn(rng, covariance)
    noise = np.full(count, np.inf)
    noise[every.columns[0]] = sigma
    noise[every.columns[1].ravel()] = sigma / 50.0  # °C/m: at 50 m
    noise[every.moving] = 0.1 * np.array(WALK)[:, None]
    on = np.flatnonzero(np.isfinite(noise))
    values = x[on] + noise[on] * rng.standard_normal(len(on))
    return every, Linear("seen", values, noise[on] ** 2, on, np.eye(len(on))), count


def estimated(every, group, count, before):
    priors = every.priors(before)
    blind = Linear("lengths", np.zeros(1), np.ones(1), np.array([0]), np.zeros((1, 1)))
    solution = adjust(np.zeros(count), [blind, group, *priors])
    return every.estimated(solution, before, [np.zeros(1)])


def test_a_campaigns_strengths_are_recovered_where_everything_is_seen():
    rng = np.random.default_rng(8)
    walks = (2.0, 3.0, 4.0, 2.0, 3.0, 3.0, 0.5, 0.5, 4.0, 4.0, 0.5)
    truth = ProcessStrength(AirStrength(0.25, 0.1, 0.08, 0.04, 0.008), telescope=walks)
    found, spread = [], []
    for _ in range(12):
        every, group, count = seen_processes(rng, truth, sigma=0.01)
        one = estimated(every, group, count, ProcessStrength())
        spread.append(spreads(every, one))
        found.append([one.air.across_c_per_m, *one.telescope])
    # Parts of minutes and of quarters of an hour hide each other; what both make from knot to knot does not. Fifty
    # knots and six of experience at a third of the strength: 15 % low, and a tenth of scatter over three.
    np.testing.assert_allclose(np.mean(spread, axis=0), spreads(every, truth), rtol=0.25)
    # twice 25 knots that forget in six, and four steps of each walk, beside six of experience at the usual strength;
    # two tilts are of one strength, and so are two bends, and east and north
    seen = np.array([24, 4, 4, 4, 4, 8, 8, 8, 8, 8, 8, 4], dtype=float)
    true, usual = np.array([0.008, *truth.telescope]), np.array([USUAL.across_c_per_m, *(1.0,) * len(PARTS)])
    expected = np.sqrt((seen * true**2 + EXPERIENCE * usual**2) / (seen + EXPERIENCE))
    # the mean square of twelve times four steps scatters by a fifth, its root by a tenth
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(found), axis=0)), expected, rtol=0.3)


def spreads(every, strength):
    """°C, by a prior: standard deviations of level and slope, and of their steps from one knot to the next."""
    prior, _ = every.air.knots.covariances(strength.air)
    k = len(every.air.knots.level)
    parts = [prior[:k, :k], prior[k:, k:]]
    return [np.sqrt(value) for p in parts for value in (p[0, 0], p[0, 0] + p[1, 1] - 2.0 * p[0, 1])]


def test_an_uninformative_campaign_keeps_the_usual_strengths():
    every, count = processes()
    none = Linear("nothing", np.zeros(1), np.ones(1), np.array([0]), np.zeros((1, 1)))
    found = estimated(every, none, count, ProcessStrength())
    # 5 %: steps end below a tenth of a variance's logarithm
    np.testing.assert_allclose(dataclasses.astuple(found.air), dataclasses.astuple(USUAL), rtol=0.05)
    np.testing.assert_allclose(found.telescope, 1.0, rtol=0.05)


def test_strengths_of_quiet_and_wild_air_stay_within_limits():
    rng = np.random.default_rng(9)
    quiet = ProcessStrength(AirStrength(1e-4, 1e-4, 1e-4, 1e-4, 1e-6), telescope=(1e-3,) * len(PARTS))
    one = estimated(*seen_processes(rng, quiet, sigma=1e-4), ProcessStrength())
    low = np.array(dataclasses.astuple(LEAST))
    assert np.all(np.array(dataclasses.astuple(one.air)) >= low)
    assert np.all(np.array(dataclasses.astuple(one.air)) < dataclasses.astuple(USUAL))
    wild = ProcessStrength(AirStrength(30.0, 10.0, 10.0, 5.0, 0.5), telescope=(300.0,) * len(PARTS))
    two = estimated(*seen_processes(rng, wild, sigma=0.01), ProcessStrength())
    assert np.all(np.array(dataclasses.astuple(two.air)) <= dataclasses.astuple(MOST))
    assert two.air.level_fast_c == MOST.level_fast_c


def test_other_strengths_change_the_processes_priors_and_leave_all_others_as_they_are():
    """Of an epoch that carries some lags on already: what is left of their prior has a row less, and stays so."""
    every, _ = processes()
    others = [Linear("others", np.zeros(1), np.ones(1), np.array([0]), np.ones((1, 1)))]
    priors = every.priors(ProcessStrength())
    names = [p.name for p in priors]
    errors = names.index(ERRORS)
    own = priors[errors]
    trimmed = dataclasses.replace(
        own, observed=own.observed[1:], covariance=own.covariance[1:], columns=own.columns[1:], matrix=own.matrix[1:]
    )
    mine = [*others, *priors[:errors], trimmed, *priors[errors + 1 :]]
    strength = ProcessStrength(USUAL, telescope=(2.0,) * len(PARTS))
    found = with_processes(mine, every, strength)
    assert [p.name for p in found] == ["others", *names]
    assert found[0] is others[0]
    assert len(found[1 + errors].observed) == 1
    for one, other in zip(found[1:], every.priors(strength), strict=True):
        if one.name != ERRORS:
            np.testing.assert_array_equal(one.columns, other.columns)
            np.testing.assert_allclose(one.covariance, other.covariance)


def test_strengths_are_near_where_none_differs_by_more_than_a_quarter():
    one = ProcessStrength(USUAL, eddies_ppm=0.2)
    assert one.near(one)
    for change in ("level_c", "across_c_per_m"):
        air = dataclasses.replace(USUAL, **{change: 1.2 * getattr(USUAL, change)})
        assert one.near(dataclasses.replace(one, air=air))
        air = dataclasses.replace(USUAL, **{change: 1.4 * getattr(USUAL, change)})
        assert not one.near(dataclasses.replace(one, air=air))
        assert not dataclasses.replace(one, air=air).near(one)
    assert not one.near(dataclasses.replace(one, telescope=(*(1.0,) * (len(PARTS) - 1), 2.0)))
    assert not one.near(dataclasses.replace(one, eddies_ppm=0.5))
    none = dataclasses.replace(one, eddies_ppm=0.0)
    assert none.near(dataclasses.replace(none, eddies_ppm=0.015))  # as good as none


# -- eddies -----------------------------------------------------------------------------------------------------------


def fits(rng, true_ppm, *, n=600, claimed_ppm=0.0, rejected=0):
    """Shots of 50 to 150 m with noise of 20 µm and eddies, whose sigma counts on eddies of `claimed_ppm`."""
    length = rng.uniform(50.0, 150.0, n)
    noise = 20e-6
    error = np.hypot(noise, true_ppm * PPM * length) * rng.standard_normal(n)
    sigma = np.hypot(noise, claimed_ppm * PPM * length)
    active = np.ones(n, dtype=bool)
    active[:rejected] = False
    error[:rejected] = 0.01
    fit = SimpleNamespace(
        sigma=sigma, standardised=error / sigma, active=active, detectable_error=NONCENTRALITY / 0.7 * sigma
    )
    return SimpleNamespace(fits=[fit]), [length]


@pytest.mark.parametrize("true", [0.3, 1.0])
@pytest.mark.parametrize("before", [0.0, 0.5])
def test_eddies_are_found_as_large_as_they_are(true, before):
    rng = np.random.default_rng(int(100 * true))
    found = []
    for _ in range(30):
        solution, lengths = fits(rng, true, claimed_ppm=before, rejected=5)
        found.append(_eddies(solution, before, lengths))
    # 600 shots: a variance of noise and eddies is known to 6 %, and at 0.3 ppm two thirds of it are eddies
    assert np.mean(found) == pytest.approx(true, rel=0.04)
    assert np.std(found) < 0.08 * true


@pytest.mark.parametrize("before", [0.0, 0.1])
def test_where_there_are_none_hardly_any_are_claimed(before):
    rng = np.random.default_rng(3)
    found = []
    for _ in range(60):
        solution, lengths = fits(rng, 0.0, claimed_ppm=before)
        found.append(_eddies(solution, before, lengths))
    # 600 shots know the variance of 20 µm to 6 %; over 100 m that is 0.05 ppm, and half of the nights show less than 0
    assert np.median(found) < 0.05
    assert np.sqrt(np.mean(np.square(found))) < 0.07
    assert max(found) < 0.15


def test_eddies_that_went_are_taken_back():
    rng = np.random.default_rng(4)
    solution, lengths = fits(rng, 0.0, claimed_ppm=0.5)
    assert _eddies(solution, 0.5, lengths) < 0.15


def test_unchecked_shots_give_no_information():
    rng = np.random.default_rng(6)
    solution, lengths = fits(rng, 0.3)
    checked = _eddies(solution, 0.0, lengths)
    (fit,) = solution.fits
    fit.standardised[:3], fit.detectable_error[:3] = 1e4, 1e5 * fit.sigma[:3]
    assert _eddies(solution, 0.0, lengths) == pytest.approx(checked, rel=0.02)


def test_eddies_are_limited_to_two_ppm():
    rng = np.random.default_rng(5)
    solution, lengths = fits(rng, 20.0)
    assert _eddies(solution, 0.0, lengths) == pytest.approx(MOST_PPM)
    none, lengths = fits(rng, 1.0, n=4, rejected=4)
    assert _eddies(none, 0.0, lengths) == 0.0
    assert MOST_PPM > LITTLE_PPM
