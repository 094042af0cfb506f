"""Budgets: contributions add up to the u that is reported, and k follows from them."""

import tomllib

import numpy as np
import pytest
from scipy.stats import t as student_t

from catseye.reduction.calibrations.budget import SCATTER, Contribution, combined, significant, welch_satterthwaite
from catseye.reduction.calibrations.fit import Effect, ObservedScatter, fit_readings
from catseye.reduction.calibrations.kind import quantities
from catseye.reduction.calibrations.kinds import KINDS, calibrate
from repository import ROOT

EXAMPLES = ROOT / "examples" / "calibrations"
KEY = [("x_mm", "mm", "a mean")]


def example_of(kind):
    """Table of a kind's example, the planted one where there is no other."""
    for path in sorted(EXAMPLES.glob("*.csv"), key=lambda p: "planted" in p.stem):
        if tomllib.loads(path.with_suffix(".toml").read_text(encoding="utf-8"))["kind"] == kind:
            return path
    raise AssertionError(f"no example of {kind}")


@pytest.mark.parametrize("kind", KINDS)
def test_the_contributions_of_every_kind_add_up_to_its_u(kind):
    for q in calibrate(kind, example_of(kind)).quantities:
        assert q.budget, q.key
        # 1e-6: priors of very different size are inverted together
        assert combined(q.budget) == pytest.approx(q.u, rel=1e-6)
        assert all(row.part > 0.0 and row.degrees > 0.0 and row.source for row in q.budget)
        assert all(row.unit or not q.unit for row in q.budget), [row.source for row in q.budget if not row.unit]
        if np.isfinite(q.degrees):
            assert welch_satterthwaite(q.budget) == pytest.approx(q.degrees, rel=1e-5)
            assert q.coverage == pytest.approx(student_t.ppf(0.5 * (1.0 + 0.954499736), q.degrees), rel=1e-6)
        else:
            assert q.coverage == 2.0


def test_a_mean_with_a_known_offset_is_worked_by_hand():
    # 8, 9, 9, 12, 12 have the mean 10 and the squares 4 + 1 + 1 + 4 + 4 = 14 about it
    readings = np.array([8.0, 9.0, 9.0, 12.0, 12.0])
    fit = fit_readings(
        readings,
        np.ones((5, 1)),
        ObservedScatter(np.zeros((5, 5)), {"scatter": np.eye(5)}),
        names=["x"],
        effects=[Effect("gauge", np.ones(5), 0.6, "mm")],
    )
    [q] = quantities(KEY, fit.x, fit.covariance, fit=fit)
    variance_of_mean = 14.0 / 4.0 / 5.0  # s² / n = 3.5 / 5
    u = np.sqrt(variance_of_mean + 0.36)
    assert q.u == pytest.approx(u, rel=1e-6)
    scatter, gauge = q.budget
    assert (scatter.evaluation, scatter.distribution, gauge.evaluation) == ("A", SCATTER, "B")
    assert scatter.part == pytest.approx(np.sqrt(variance_of_mean), rel=1e-6)
    assert scatter.degrees == pytest.approx(4.0, rel=1e-6)
    assert (gauge.u, gauge.unit) == (0.6, "mm")
    assert gauge.sensitivity == pytest.approx(-1.0, rel=1e-6)  # a gauge that reads too high makes the size too small
    effective = u**4 / (variance_of_mean**2 / 4.0)  # [JCGM100] eq. G.2b
    assert q.degrees == pytest.approx(effective, rel=1e-5)
    assert q.coverage == pytest.approx(student_t.ppf(0.97725, effective), rel=1e-5)
    assert (round(q.degrees, 2), round(q.coverage, 3)) == (9.17, 2.313)


def test_a_sensitivity_is_the_change_by_the_input():
    random = np.random.default_rng(7)
    m = 12
    design = np.column_stack([np.ones(m), np.linspace(-1.0, 1.0, m)])
    column, y = np.linspace(0.2, 1.4, m) ** 2, random.normal(0.0, 0.1, m)
    scatter = ObservedScatter(0.01 * np.eye(m))

    def slope_of(readings):
        return fit_readings(readings, design, scatter, names=["a", "b"], effects=[Effect("e", column, 0.3)]).x[1]

    fit = fit_readings(y, design, scatter, names=["a", "b"], effects=[Effect("e", column, 0.3, "mm")])
    rows = fit.parts.contributions(np.array([0.0, 1.0]), "mm")
    # an effect whose prior stands at 0.05 is that of readings without 0.05 of it
    change = (slope_of(y - 0.05 * column) - slope_of(y)) / 0.05
    assert rows[-1].sensitivity == pytest.approx(change, rel=1e-6)


def test_two_estimated_scatters_have_the_degrees_of_their_sets():
    # four sets of ten readings that agree within 0.01: what the mean rests on are the four sets, with three degrees
    random = np.random.default_rng(3)
    of_set = np.repeat(np.arange(4), 10)
    y = np.array([0.0, 1.0, 2.0, 4.0])[of_set] + random.normal(0.0, 0.01, 40)
    same = (of_set[:, None] == of_set).astype(float)
    fit = fit_readings(
        y, np.ones((40, 1)), ObservedScatter(np.zeros((40, 40)), {"reading": np.eye(40), "set": same}), names=["x"]
    )
    [q] = quantities(KEY, fit.x, fit.covariance, fit=fit)
    assert [row.source for row in q.budget] == ["reading and set"]
    assert q.degrees == pytest.approx(3.0, rel=1e-3)
    assert q.coverage == pytest.approx(student_t.ppf(0.97725, 3.0), rel=1e-3)


def test_intervals_of_few_readings_hold_what_they_claim():
    # means of four readings and a gauge's offset: 2000 runs scatter by 0.5 % about 95.45 %; Welch and Satterthwaite's
    # formula is an approximation that is good to 1 % here
    random = np.random.default_rng(11)
    held, runs = 0, 2000
    for _ in range(runs):
        y = random.normal(0.0, 1.0, 4) + random.normal(0.0, 0.3)
        fit = fit_readings(
            y,
            np.ones((4, 1)),
            ObservedScatter(np.zeros((4, 4)), {"scatter": np.eye(4)}),
            names=["x"],
            effects=[Effect("gauge", np.ones(4), 0.3, "mm")],
        )
        [q] = quantities(KEY, fit.x, fit.covariance, fit=fit)
        held += abs(q.value) <= q.coverage * q.u
    assert held / runs == pytest.approx(0.9545, abs=0.02)


def test_negligible_contributions_are_left_out():
    rows = [
        Contribution(name, u, "mm", "B", "normal", np.inf, 1.0) for name, u in (("a", 1.0), ("b", 1e-5), ("c", 0.0))
    ]
    assert [row.source for row in significant(rows)] == ["a"]
    assert significant([]) == ()
