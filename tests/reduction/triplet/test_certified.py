"""A triplet's quantities: the reduction's own numbers, whose parts add up."""

import dataclasses
import math

import pytest

from catseye.records.files.reading import read_record
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.calibrations.budget import combined
from catseye.reduction.triplet.certified import triplet_quantities
from catseye.reduction.triplet.unit import reduce_triplet
from repository import ROOT


def reduced(name):
    return reduce_triplet(read_record(ROOT / "examples" / "triplets" / name, TripletMeasurement))


@pytest.mark.parametrize("name", ["TR01.toml", "TR02.toml"])
def test_parts_add_up_to_the_uncertainties_of_the_reduction(name):
    unit = reduced(name)
    h_corr, l_mpbc, difference = triplet_quantities(unit)
    for q, value, u in (
        (h_corr, unit.h_corr, unit.u_h_corr),
        (l_mpbc, unit.l_mpbc, unit.u_l_mpbc),
        (difference, unit.difference, unit.u_difference),
    ):
        assert (q.value, q.u) == (pytest.approx(1e3 * value, rel=1e-12), pytest.approx(1e3 * u, rel=1e-9))
        assert combined(q.budget) == pytest.approx(q.u, rel=1e-9)
        assert (q.unit, q.degrees, q.coverage) == ("mm", math.inf, 2.0)
    assert {row.source for row in l_mpbc.budget} <= {row.source for row in difference.budget}


def test_without_a_height_by_ranging_the_plates_stands_alone():
    unit = dataclasses.replace(reduced("TR01.toml"), h_corr=math.nan, difference=math.nan)
    assert [q.key for q in triplet_quantities(unit)] == ["l_mpbc_mm"]
