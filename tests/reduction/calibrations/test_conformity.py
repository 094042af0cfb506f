"""Decision rules: statements by hand on both sides of every limit."""

import pytest
from scipy.stats import norm
from scipy.stats import t as student_t

from catseye.errors import InputError
from catseye.records.laboratory.certificate_job import CertificateJob, Specification
from catseye.reduction.calibrations.calibration import Quantity
from catseye.reduction.calibrations.conformity import conformities, conformity

LIMITS = Specification(key="x_mm", lower=-1.0, upper=1.0)


def quantity(value, u=0.1, **more):
    return Quantity("x_mm", value, u, "mm", "", **more)


@pytest.mark.parametrize(
    ("value", "simple", "guarded"),  # U = 0.2
    [
        (0.0, "pass", "pass"),
        (0.79, "pass", "pass"),
        (0.81, "pass", "conditional pass"),
        (1.0, "pass", "conditional pass"),
        (1.01, "fail", "conditional fail"),
        (1.19, "fail", "conditional fail"),
        (1.21, "fail", "fail"),
        (-0.79, "pass", "pass"),
        (-0.81, "pass", "conditional pass"),
        (-1.21, "fail", "fail"),
    ],
)
def test_statements_by_rule(value, simple, guarded):
    assert conformity(quantity(value), LIMITS, "simple-acceptance").statement == simple
    judged = conformity(quantity(value), LIMITS, "guarded-acceptance")
    assert (judged.statement, judged.guard) == (guarded, pytest.approx(0.2))


def test_a_probability_is_that_of_the_results_distribution():
    wide = conformity(quantity(0.9, 0.1), LIMITS, "simple-acceptance")
    assert wide.probability == pytest.approx(norm.cdf(1.0) - norm.cdf(-19.0), rel=1e-9)
    few = conformity(quantity(0.9, 0.1, degrees=3.0), LIMITS, "simple-acceptance")
    assert few.probability == pytest.approx(student_t.cdf(1.0, 3) - student_t.cdf(-19.0, 3), rel=1e-9)
    one_sided = conformity(quantity(0.9, 0.1), Specification(key="x_mm", upper=1.0), "simple-acceptance")
    assert one_sided.probability == pytest.approx(norm.cdf(1.0), rel=1e-9)
    exact = conformity(quantity(1.1, 0.0), LIMITS, "guarded-acceptance")
    assert (exact.probability, exact.statement) == (0.0, "fail")


def test_a_job_judges_known_quantities_that_have_an_uncertainty():
    job = CertificateJob(format="catseye-job-1", decision_rule="simple-acceptance", specification=[LIMITS])
    assert [each.statement for each in conformities((quantity(0.0),), job)] == ["pass"]
    assert conformities((quantity(0.0),), CertificateJob(format="catseye-job-1")) == ()
    with pytest.raises(InputError, match=r"specification\[0\]\.key = 'x_mm' is not a quantity .*expected one of y_mm"):
        conformities((Quantity("y_mm", 0.0, 0.1, "mm", ""),), job)
    with pytest.raises(InputError, match="has no uncertainty to judge it by"):
        conformities((quantity(0.0, float("nan")),), job)
