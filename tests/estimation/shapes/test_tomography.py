"""Means along lines: their covariances against brute force, estimates against scatter, on fields of other kinds too."""

import numpy as np
import pytest

from catseye.errors import EstimationError, ValidityError
from catseye.estimation.shapes.tomography import FieldPrior, LineMeans, Lines, Scale, line_covariance, tomogram
from draws import draws

ROOM = (Scale(1.0, (30.0, 20.0, 5.0)), Scale(0.3, (6.0, 6.0, 3.0)))


def lines(rng, count, size=(80.0, 60.0, 15.0)):
    return Lines(rng.random((count, 3)) * size, rng.random((count, 3)) * size)


def observed(at, values, sigma, along=None, design=None, sigmas=None):
    m = len(values)
    return LineMeans(
        at,
        np.asarray(values, float),
        np.diag(np.broadcast_to(np.asarray(sigma, float) ** 2, (m,))),
        np.zeros(m) if along is None else along,
        np.zeros((m, 0)) if design is None else design,
        np.zeros(0) if sigmas is None else sigmas,
    )


def test_covariance_of_two_line_means_is_the_double_integral():
    from scipy.integrate import dblquad

    rng = np.random.default_rng(1)
    a, b = lines(rng, 3), lines(rng, 2)
    b = Lines(np.vstack([b.start, a.start[:1]]), np.vstack([b.end, a.end[:1]]))  # one line with itself, too
    got = line_covariance(a, b, ROOM)

    def brute(i, j):
        def k(s, u):
            d = (a.start[i] + s * (a.end[i] - a.start[i])) - (b.start[j] + u * (b.end[j] - b.start[j]))
            return sum(x.sigma**2 * np.exp(-0.5 * np.sum((d / np.array(x.lengths)) ** 2)) for x in ROOM)

        return dblquad(k, 0, 1, 0, 1, epsabs=1e-10, epsrel=1e-10)[0]

    for i, j in ((0, 0), (1, 1), (2, 0), (0, 2)):
        assert got[i, j] == pytest.approx(brute(i, j), abs=2e-9)


def test_a_line_with_itself_has_the_variance_in_closed_form():
    from scipy.special import erf

    for d in (1e-5, 0.3, 4.0, 60.0):
        at = Lines(np.zeros((1, 3)), np.array([[d, 0.0, 0.0]]))
        # the mean of exp(-(s - u)² d²/2) over the unit square
        exact = np.sqrt(2 * np.pi) / d * erf(d / np.sqrt(2)) + 2 / d**2 * np.expm1(-(d**2) / 2)
        got = line_covariance(at, at, (Scale(1.0, (1.0, 1.0, 1.0)),))[0, 0]
        # at 1e-5 the closed form itself cancels: there the field does not change along the line
        assert got == pytest.approx(exact if d > 1e-3 else 1.0, abs=2e-9)


def test_points_and_infinite_lengths_are_limits():
    point = Lines(np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 2.0, 3.0]]))
    other = Lines(np.array([[4.0, 6.0, 3.0]]), np.array([[4.0, 6.0, 3.0]]))
    unit = (Scale(2.0, (5.0, 5.0, 5.0)),)
    assert line_covariance(point, point, unit)[0, 0] == pytest.approx(4.0, rel=1e-12)
    assert line_covariance(point, other, unit)[0, 0] == pytest.approx(4.0 * np.exp(-0.5), rel=1e-12)
    layered = (Scale(1.0, (np.inf, np.inf, 2.0)),)
    level = Lines(np.array([[0.0, 0.0, 1.0]]), np.array([[90.0, 10.0, 1.0]]))
    assert line_covariance(level, level, layered)[0, 0] == pytest.approx(1.0, rel=1e-12)


def test_the_estimate_is_that_of_a_fine_grid():
    rng = np.random.default_rng(2)
    at, wanted = lines(rng, 12), lines(rng, 2)
    prior = FieldPrior(15.0, 3.0, (Scale(1.0, (30.0, 20.0, 9.0)),))
    values, sigma = 15.0 + rng.standard_normal(12), 0.1
    found = tomogram(observed(at, values, sigma), prior).scalar_along(wanted)
    # the same by points: each line as 60 points of a field, their means, ordinary conditioning of Gaussians
    s = ((np.arange(60) + 0.5) / 60)[:, None]
    points = np.concatenate(
        [
            p + s * (q - p)
            for p, q in zip(
                *(np.vstack(x) for x in zip(*[(at.start, at.end), (wanted.start, wanted.end)], strict=True)),
                strict=True,
            )
        ]
    )
    scaled = points / np.array([30.0, 20.0, 9.0])
    k = np.exp(-0.5 * np.sum((scaled[:, None] - scaled) ** 2, axis=2)) + 9.0
    mean = np.kron(np.eye(14), np.full((1, 60), 1 / 60))
    k = mean @ k @ mean.T
    gain = k[12:, :12] @ np.linalg.inv(k[:12, :12] + sigma**2 * np.eye(12))
    # mid-points of 60 pieces are good to (1/60)²/24 of the curvature: 1e-4
    assert found.value == pytest.approx(15.0 + gain @ (values - 15.0), abs=2e-3)
    assert found.covariance == pytest.approx(k[12:, 12:] - gain @ k[:12, 12:], abs=2e-3)


def planted(rng, at, wanted, prior, vector, sigma, design, sigmas):
    """Observations and true means drawn together from the priors."""
    both = Lines(np.vstack([at.start, wanted.start]), np.vstack([at.end, wanted.end]))
    n, m = len(both.start), len(at.start)

    def draw(p):
        k = line_covariance(both, both, p.scales) + 1e-12 * np.eye(n)
        return p.mean + p.u_mean * rng.standard_normal() + np.linalg.cholesky(k) @ rng.standard_normal(n)

    truth = draw(prior)
    wind = np.stack([draw(vector) for _ in range(3)], axis=1)
    along = np.sum(wind[:m] * at.directions, axis=1)
    beta = sigmas * rng.standard_normal(len(sigmas))
    seen = truth[:m] + 1.6 * along + design @ beta + sigma * rng.standard_normal(m)
    return seen, truth[m:], wind[m:], beta


def scatter(runs, seed):
    rng = np.random.default_rng(seed)
    prior, vector = (
        FieldPrior(12.0, 5.0, (Scale(1.0, (25.0, 25.0, 8.0)),)),
        FieldPrior(0.0, 4.0, (Scale(0.5, (30.0, 30.0, 30.0)),)),
    )
    at = lines(rng, 20)
    at = Lines(np.vstack([at.start, at.end]), np.vstack([at.end, at.start]))  # both directions
    wanted = lines(rng, 2)
    design, sigmas = rng.standard_normal((40, 3)), np.array([0.1, 0.3, 0.05])
    z, chi, standard, winds, betas = [], [], [], [], []
    for _ in range(runs):
        seen, truth, wind, beta = planted(rng, at, wanted, prior, vector, 0.05, design, sigmas)
        found = tomogram(observed(at, seen, 0.05, np.full(40, 1.6), design, sigmas), prior, vector)
        told = found.scalar_along(wanted)
        root = np.linalg.cholesky(told.covariance)
        z.append(np.linalg.solve(root, told.value - truth))
        gust = found.vector_along(wanted, np.tile([0.6, 0.8, 0.0], (2, 1)))
        winds.append((gust.value - wind @ [0.6, 0.8, 0.0]) / gust.u)
        spread = np.linalg.cholesky(found.parameter_covariance())
        betas.append(np.linalg.solve(spread, told.parameters - beta))
        chi.append(found.chi_square)
        standard.append(found.standardised)
    return (np.array(v) for v in (z, chi, standard, winds, betas))


def check_scatter(runs, seed):
    z, chi, standard, winds, betas = scatter(runs, seed)
    for values in (z, winds, betas):
        # the mean square of n standard normal values scatters by sqrt(2/n); lines' values of a run hang together
        assert np.mean(values**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / runs / 2.0))
    assert np.mean(chi) == pytest.approx(40.0, abs=4.0 * np.sqrt(80.0 / runs))
    assert np.mean(standard**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (40 * runs)))


@draws(60)
def test_claims_hold_when_fields_are_drawn_from_their_priors(runs):
    check_scatter(runs, 3)


@pytest.mark.slow
def test_claims_hold_over_many_fields():
    check_scatter(2000, 4)


def warm_patch(p):
    """A field of no Gaussian process: a sharp-edged sunlit patch, a plume, a logarithmic layer above the ground."""
    x, y, z = np.moveaxis(p, -1, 0)
    sunny = 1.5 * ((x > 30.0) & (x < 55.0) & (y > 20.0)) * np.exp(-z / 6.0)
    plume = 2.0 * np.exp(-((x - 60.0) ** 2 + (y - 15.0) ** 2) / 200.0)
    return 14.0 + sunny + plume - 0.5 * np.log((z + 0.5) / 5.0)


def test_a_field_of_another_kind_is_found_within_its_claim():
    rng = np.random.default_rng(5)
    s = ((np.arange(2000) + 0.5) / 2000)[:, None]

    def mean(at):
        return np.array([np.mean(warm_patch(p + s * (q - p))) for p, q in zip(at.start, at.end, strict=True)])

    prior = FieldPrior(12.0, 5.0, (Scale(1.0, (25.0, 25.0, 8.0)), Scale(0.5, (8.0, 8.0, 4.0))))
    ratios, gained = [], []
    for _ in range(12):
        at, wanted = lines(rng, 60), lines(rng, 3)
        found = tomogram(observed(at, mean(at) + 0.03 * rng.standard_normal(60), 0.03), prior).scalar_along(wanted)
        ratios.append((found.value - mean(wanted)) / found.u)
        gained.append(found.value - mean(wanted))
    ratios, gained = np.concatenate(ratios), np.concatenate(gained)
    # sharp edges are not what the prior draws: claims hold in the mean square, and no miss is wild
    assert np.mean(ratios**2) < 1.5
    assert np.max(np.abs(ratios)) < 4.0
    assert np.sqrt(np.mean(gained**2)) < 0.25  # of a field that varies by 1.0 rms and stood 2 from its prior


def test_a_gross_error_is_named_and_the_rest_is_not():
    rng = np.random.default_rng(6)
    at = lines(rng, 40)
    prior = FieldPrior(12.0, 5.0, (Scale(1.0, (25.0, 25.0, 8.0)),))
    k = line_covariance(at, at, prior.scales) + 1e-12 * np.eye(40)
    values = 13.0 + np.linalg.cholesky(k) @ rng.standard_normal(40) + 0.05 * rng.standard_normal(40)
    values[17] += 3.0
    found = tomogram(observed(at, values, 0.05), prior)
    assert found.suspects.tolist() == [17]
    assert values[17] - found.predicted[17] == pytest.approx(3.0, abs=1.0)
    others = np.delete(np.arange(40), 17)
    without = tomogram(observed(Lines(at.start[others], at.end[others]), values[others], 0.05), prior)
    alone = without.scalar_along(Lines(at.start[17:18], at.end[17:18]))
    assert found.predicted[17] == pytest.approx(float(alone.value[0]), abs=1e-8)
    assert found.standardised[17] == pytest.approx((values[17] - alone.value[0]) / np.hypot(alone.u[0], 0.05), rel=1e-6)


def test_distant_lines_give_no_information_and_coincident_ones_all():
    at = Lines(np.array([[0.0, 0.0, 0.0]]), np.array([[50.0, 0.0, 0.0]]))
    prior = FieldPrior(10.0, 0.0, (Scale(1.0, (10.0, 10.0, 10.0)),))
    found = tomogram(observed(at, [11.0], 1e-6), prior)
    told = found.scalar_along(
        Lines(np.vstack([at.start, [[0.0, 500.0, 0.0]]]), np.vstack([at.end, [[50.0, 500.0, 0.0]]]))
    )
    assert told.value == pytest.approx([11.0, 10.0], abs=1e-6)
    assert told.resolution == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("call", "kind", "complaint"),
    [
        (lambda at: tomogram(observed(at, [1.0, np.nan], 0.1), FieldPrior(0, 1)), ValidityError, "not a number"),
        (
            lambda at: tomogram(observed(at, [1.0], 0.1), FieldPrior(0, 1)),
            ValidityError,
            "start of 1 line means has the shape",
        ),
        (
            lambda at: tomogram(observed(at, [1.0, 1.0], 0.1, np.ones(2)), FieldPrior(0, 1)),
            ValidityError,
            "vector field",
        ),
        (lambda at: tomogram(observed(at, [1.0, 1.0], 0.0), FieldPrior(0, 1)), EstimationError, "singular covariance"),
        (lambda at: Scale(-1.0, (1.0, 1.0, 1.0)), ValidityError, "standard deviation -1"),
        (lambda at: Scale(1.0, (1.0, 0.0, 1.0)), ValidityError, "are not all above 0"),
        (
            lambda at: tomogram(observed(at, [1.0, 1.0], 0.1), FieldPrior(0, 1)).vector_along(at, np.eye(3)[:2]),
            EstimationError,
            "no vector field",
        ),
    ],
)
def test_refusals(call, kind, complaint):
    at = lines(np.random.default_rng(7), 2)
    with pytest.raises(kind) as caught:
        call(at)
    assert complaint in str(caught.value)
