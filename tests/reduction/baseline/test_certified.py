"""A baseline's quantities: the adjustment's own numbers, whose parts add up, with its degrees of freedom."""

import pytest
from scipy.stats import t as student_t

from catseye.records.laboratory.baseline import read_heights, read_observations
from catseye.reduction.baseline.certified import baseline_quantities
from catseye.reduction.baseline.instrument import calibrate_baseline
from catseye.reduction.baseline.settings import BaselineSettings
from catseye.reduction.calibrations.budget import combined
from repository import ROOT

BUSSELTON = ROOT / "examples" / "baselines" / "busselton"


def test_parts_add_up_and_the_factor_is_that_of_the_sets():
    shots = read_observations(BUSSELTON / "ts30-baseline-observations.csv")
    heights = read_heights(BUSSELTON / "pillar-heights.csv")
    found = calibrate_baseline(shots, heights, None, settings=BaselineSettings())
    quantities = {q.key: q for q in baseline_quantities(found)}
    assert list(quantities) == ["zero_mm", *(f"x_{name}_m" for name in found.names[1:])]  # nobody tells the scale
    zero, u_zero = found.solution.of("zero")
    assert (quantities["zero_mm"].value, quantities["zero_mm"].u) == (
        pytest.approx(1e3 * zero),
        pytest.approx(1e3 * u_zero),
    )
    for key, q in quantities.items():
        parameter = "zero" if key == "zero_mm" else f"x {found.names.index(key[2:-2])}"
        assert combined(q.budget) == pytest.approx(q.u, rel=1e-7)
        assert q.degrees == pytest.approx(found.solution.freedom_of(parameter), rel=1e-9)
        assert q.coverage == pytest.approx(student_t.ppf(0.977249868, q.degrees), rel=1e-6)
    [scatter] = [row for row in quantities["zero_mm"].budget if row.evaluation == "A"]
    assert scatter.degrees == found.solution.freedom_sets
