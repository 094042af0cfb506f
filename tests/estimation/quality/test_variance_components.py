"""Variance components against the restricted likelihood itself (dense, maximised by scipy) and against scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.quality.variance_components import (
    GroupFactors,
    RowModel,
    variance_components,
)
from draws import draws, same_sigmas

quick = settings(deadline=None, max_examples=15)


class Dense:
    """Linear groups A_g x, each with a covariance; adjusted densely, with everything that a fit needs."""

    def __init__(self, a, covariances):
        self.a, self.covariances = a, covariances
        self.whole = np.concatenate(a)

    def scaled(self, scale):
        blocks = [c * np.outer(s, s) for c, s in zip(self.covariances, scale, strict=True)]
        c = np.zeros((len(self.whole),) * 2)
        at = 0
        for block in blocks:
            c[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        return c

    def projector(self, c):
        p = np.linalg.inv(c)
        pa = p @ self.whole
        return p - pa @ np.linalg.solve(self.whole.T @ pa, pa.T)

    def solver(self, observed):
        cuts = np.cumsum([len(a) for a in self.a])[:-1]

        def solve(scale):
            c = self.scaled(scale)
            p_v = self.projector(c)
            v, own = c @ p_v @ observed, np.maximum(np.diag(p_v), 1e-30)
            pieces = [np.split(z, cuts) for z in (v, np.sqrt(np.diag(c)), np.diag(p_v @ c), p_v @ observed, own)]
            return [
                GroupFit(
                    f"group {i}",
                    np.ones(len(v), bool),
                    v,
                    s,
                    r,
                    pv / np.sqrt(w),
                    pv / w,
                    NONCENTRALITY / np.sqrt(w),
                    float(v @ np.linalg.solve(block, v)),
                )
                for i, (v, s, r, pv, w, block) in enumerate(
                    zip(
                        *pieces,
                        [cc * np.outer(k, k) for cc, k in zip(self.covariances, scale, strict=True)],
                        strict=True,
                    )
                )
            ]

        return solve

    def minus_restricted_likelihood(self, c, observed):
        """-2 log L of the residuals, without constants."""
        normal = self.whole.T @ np.linalg.solve(c, self.whole)
        return np.linalg.slogdet(c)[1] + np.linalg.slogdet(normal)[1] + observed @ self.projector(c) @ observed


def constant_and_scale(names, distances, sigmas, *, start):
    """Model sigma^2 = a^2 + (b D)^2 of each ranger."""
    return RowModel(
        names=tuple(f"{what}^2 of {name}" for name in names for what in ("constant", "scale")),
        sigmas=tuple(sigmas),
        cofactors=tuple(np.stack([np.ones(len(d)), d**2], axis=1) for d in distances),
        columns=tuple(np.array([2 * i, 2 * i + 1]) for i in range(len(names))),
        start=np.tile(np.square(start), len(names)),
    )


def rangers(seed, m=40, count=2, a=5e-5, b=1e-6):
    """Rangers that see the same unknowns, with distances from 20 to 200 m; sigma^2 = a^2 + (b D)^2."""
    rng = np.random.default_rng(seed)
    distances = [rng.uniform(20, 200, m) for _ in range(count)]
    design = [rng.normal(size=(m, 12)) for _ in range(count)]
    claimed = [np.full(m, 1e-4) for _ in range(count)]
    true = [np.hypot(a * (1 + g), b * (1 + 2 * g) * d) for g, d in enumerate(distances)]
    dense = Dense(design, [np.diag(s**2) for s in claimed])
    model = constant_and_scale([f"ZY{g}" for g in range(count)], distances, claimed, start=(1e-4, 1e-6))
    return dense, model, distances, np.concatenate(true)


def cofactor_matrices(distances):
    sizes = [len(d) for d in distances]
    out = []
    for g, d in enumerate(distances):
        for q in (np.ones_like(d), d**2):
            row = np.zeros(sum(sizes))
            row[sum(sizes[:g]) : sum(sizes[: g + 1])] = q
            out.append(np.diag(row))
    return out


def test_constant_and_scale_maximise_the_restricted_likelihood():
    dense, model, distances, true = rangers(1)
    observed = true * np.random.default_rng(2).normal(size=80)
    answer = variance_components(dense.solver(observed), model, tolerance=1e-7).require_converged()
    qs, unit = cofactor_matrices(distances), np.tile([1e-8, 1e-12], 2)

    def cost(x):
        return dense.minus_restricted_likelihood(sum(t * q for t, q in zip(x * unit, qs, strict=True)), observed)

    best = minimize(cost, np.ones(4), bounds=[(1e-9, None)] * 4, method="L-BFGS-B", options={"ftol": 1e-15})
    assert cost(answer.values / unit) <= best.fun + 1e-6
    np.testing.assert_allclose(answer.values / unit, best.x, atol=2e-3 * np.max(answer.u / unit))
    roots, u = answer.roots()
    np.testing.assert_allclose(np.square(roots), answer.values)
    near = np.square(roots + 1e-4 * u) - answer.values
    np.testing.assert_allclose(near[~answer.at_zero], 1e-4 * answer.u[~answer.at_zero], rtol=1e-3)
    assert np.isinf(u[answer.at_zero]).all()
    assert np.count_nonzero(~answer.at_zero) == 3


def test_the_information_is_the_one_of_the_dense_formula():
    dense, model, distances, true = rangers(3, m=80)
    answer = variance_components(dense.solver(true * np.random.default_rng(6).normal(size=160)), model)
    assert (answer.values > 0.0).all()
    qs = cofactor_matrices(distances)
    p_v = dense.projector(sum(t * q for t, q in zip(answer.values, qs, strict=True)))
    information = 0.5 * np.array([[np.trace(p_v @ k @ p_v @ q) for q in qs] for k in qs])
    scale = np.sqrt(np.outer(np.diag(information), np.diag(information)))
    np.testing.assert_allclose(np.linalg.inv(answer.covariance) / scale, information / scale, atol=1e-4)


def correlated_groups(rng):
    sizes = (20, 12, 30)
    design = [rng.normal(size=(m, 7)) for m in sizes]
    roots = [np.linalg.cholesky(0.5 * np.eye(m) + 0.5 * np.ones((m, m))) for m in sizes]
    return sizes, Dense(design, [r @ r.T for r in roots]), roots


def test_factors_of_correlated_groups_maximise_the_restricted_likelihood():
    rng = np.random.default_rng(11)
    sizes, dense, roots = correlated_groups(rng)
    observed = np.concatenate([k * r @ rng.normal(size=len(r)) for k, r in zip((1.0, 3.0, 0.5), roots, strict=True)])
    answer = variance_components(dense.solver(observed), GroupFactors(("A", "B", "C"), sizes), tolerance=1e-8)

    def cost(logs):
        return dense.minus_restricted_likelihood(
            dense.scaled([np.full(m, np.exp(s / 2)) for m, s in zip(sizes, logs, strict=True)]), observed
        )

    best = minimize(cost, np.zeros(3), method="BFGS")
    np.testing.assert_allclose(np.log(answer.values), best.x, atol=1e-4)
    assert answer.names[1] == "variance factor of B"
    assert [f.pvv for f in answer.fits] == pytest.approx([np.sum(f.redundancy) for f in answer.fits], rel=1e-4)


def test_one_factor_for_all_is_the_variance_factor_in_one_step():
    rng = np.random.default_rng(0)
    sizes, dense, _ = correlated_groups(rng)
    observed = rng.normal(size=62)
    whole = dense.solver(observed)([np.ones(m) for m in sizes])
    answer = variance_components(dense.solver(observed), GroupFactors(("A", "B", "C"), sizes, (0, 0, 0)))
    assert answer.iterations == 2  # and the second finds nothing to do
    assert answer.values[0] == pytest.approx(sum(f.pvv for f in whole) / (62 - 7), rel=1e-9)
    assert answer.u[0] == pytest.approx(answer.values[0] * np.sqrt(2 / 55), rel=1e-5)


def test_a_group_taken_as_claimed_stays_as_claimed():
    rng = np.random.default_rng(1)
    sizes, dense, _ = correlated_groups(rng)
    model = GroupFactors(("A", "prior", "C"), sizes, (0, -1, 1))
    answer = variance_components(dense.solver(3 * rng.normal(size=62)), model)
    assert answer.names == ("variance factor of A", "variance factor of C")
    np.testing.assert_allclose(answer.fits[1].sigma, 1.0)
    assert answer.fits[0].sigma[0] == pytest.approx(np.sqrt(answer.values[0]))


@quick
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_observations_twice_as_wrong_give_components_four_times_as_large(seed, factor):
    dense, model, _, true = rangers(seed, m=25)
    observed = true * np.random.default_rng(seed).normal(size=50)
    one = variance_components(dense.solver(observed), model, tolerance=1e-7)
    other = variance_components(dense.solver(factor * observed), model, tolerance=1e-7)
    np.testing.assert_allclose(other.values / factor**2, one.values, atol=1e-4 * np.nanmax(one.u[::2]), rtol=1e-4)
    assert (one.values >= 0.0).all()


def test_negative_component_is_set_to_zero_and_reported():
    dense, _, distances, _ = rangers(5)
    claimed = tuple(np.full(40, 1e-4) for _ in range(2))
    true = np.concatenate([1e-6 * d for d in distances])  # no constant part
    zeros = 0
    for seed in range(8):
        model = constant_and_scale(["A", "B"], distances, claimed, start=(1e-4, 1e-6))
        answer = variance_components(dense.solver(true * np.random.default_rng(seed).normal(size=80)), model)
        assert answer.status == CONVERGED
        assert (answer.values >= 0.0).all()
        observed, expected, _ = model.equations(answer.fits, answer.values)
        unit = np.sqrt(np.diag(answer.covariance))
        assert ((observed - expected) * unit < 0.01)[answer.at_zero].all()  # it would rather be negative
        assert (np.abs(observed - expected) * unit < 0.01)[~answer.at_zero].all()
        zeros += np.count_nonzero(answer.at_zero)
        assert np.isinf(answer.roots()[1][answer.at_zero]).all()
    assert 2 <= zeros <= 14


def test_constant_and_scale_at_one_distance_are_not_separable():
    dense, _, _, _ = rangers(1, count=1)
    model = constant_and_scale(["ZY1"], [np.full(40, 100.0)], [np.full(40, 1e-4)], start=(5e-5, 1e-6))
    answer = variance_components(dense.solver(1e-4 * np.random.default_rng(0).normal(size=40)), model)
    assert answer.status.startswith("not separable: constant^2 of ZY1, scale^2 of ZY1 have the same effect")
    assert np.isnan(answer.covariance).all()
    with pytest.raises(EstimationError, match="not separable"):
        answer.require_converged()


def test_a_group_without_redundancy_is_named():
    rng = np.random.default_rng(0)
    a = [np.hstack([rng.normal(size=(10, 2)), np.zeros((10, 2))]), np.hstack([np.zeros((2, 2)), np.eye(2)])]
    dense = Dense(a, [np.eye(10), np.eye(2)])
    with pytest.raises(EstimationError, match="variance factor of alone affects no residual"):
        variance_components(dense.solver(rng.normal(size=12)), GroupFactors(("many", "alone"), (10, 2)))


def test_rows_of_a_correlated_group_are_refused():
    rng = np.random.default_rng(0)
    _, dense, _ = correlated_groups(rng)
    dense = Dense(dense.a[:1], dense.covariances[:1])
    model = constant_and_scale(["ZY1"], [rng.uniform(20, 200, 20)], [np.ones(20)], start=(1.0, 1e-3))
    with pytest.raises(EstimationError, match=r"group 0: .* are correlated; give it one factor"):
        variance_components(dense.solver(rng.normal(size=20)), model)


def test_a_variance_of_zero_is_refused_with_its_row():
    model = RowModel(("b^2",), (np.ones(2),), (np.array([[4.0], [0.0]]),), (np.array([0]),), np.array([1.0]))
    with pytest.raises(EstimationError, match="group 0, observation 1: its variance is 0 with b"):
        model.variances(model.start)


def test_iteration_limit_is_reported():
    dense, model, _, true = rangers(1)
    answer = variance_components(dense.solver(true), model, iterations=1)
    assert answer.status.startswith("not converged: ")
    assert answer.iterations == 1


def scatter(trials):
    """Components of a fixed two-ranger network over many draws, with their claimed uncertainties."""
    dense, model, _, true = rangers(9, m=80, count=2)
    rng = np.random.default_rng(31)
    answers = [variance_components(dense.solver(true * rng.normal(size=160)), model) for _ in range(trials)]
    values, u = np.array([a.values for a in answers]), np.array([a.u for a in answers])
    assert all(a.status == CONVERGED for a in answers)
    truth = np.array([5e-5, 1e-6, 1e-4, 3e-6]) ** 2
    return (values - truth) / u.mean(axis=0), values, u


@draws(40)
def test_components_scatter_about_the_truth_as_they_claim(runs):
    z, _, _ = scatter(runs)
    assert np.abs(z.mean(axis=0)).max() < same_sigmas(0.75, 40, runs)  # 40 draws: 0.16, and held at zero now and then
    assert np.abs(z.std(axis=0) - 1.0).max() < same_sigmas(0.4, 40, runs)


@pytest.mark.slow
def test_components_scatter_about_the_truth_as_they_claim_in_a_thousand_draws():
    z, values, _ = scatter(1000)
    assert np.abs(z.mean(axis=0)).max() < 0.12  # what the bound at zero adds stays within
    # a component that may be held at zero scatters less than claimed; the claim is the one without the bound
    free = (values > 0.0).all(axis=0)
    assert np.abs(z.std(axis=0)[free] - 1.0).max(initial=0.0) < 0.12
    assert z.std(axis=0).max() < 1.15
    assert z.std(axis=0).min() > 0.6


@draws(150, 100)
def test_factors_of_groups_scatter_about_the_truth_as_they_claim(runs):
    rng = np.random.default_rng(17)
    sizes, dense, roots = correlated_groups(rng)
    truth = np.array([1.0, 9.0, 0.25])
    z = []
    for _ in range(runs):
        observed = np.concatenate([np.sqrt(f) * r @ rng.normal(size=len(r)) for f, r in zip(truth, roots, strict=True)])
        answer = variance_components(dense.solver(observed), GroupFactors(("A", "B", "C"), sizes))
        z.append((answer.values - truth) / truth / (answer.u / answer.values))
    z = np.array(z)
    assert np.abs(z.mean(axis=0)).max() < same_sigmas(0.3, 150, runs)  # 150 draws: 0.08; small groups' are skew
    assert np.abs(z.std(axis=0) - 1.0).max() < same_sigmas(0.25, 150, runs)
