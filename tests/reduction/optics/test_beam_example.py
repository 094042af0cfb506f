"""The train of the notes' figure 6.1 that ships: its printed numbers by hand, and against the link budget."""

import numpy as np
import pytest

from catseye.optics import coating
from catseye.records.files.reading import read_record
from catseye.records.site.beam import BeamTrain
from catseye.reduction.optics.beam import reduce_beam
from catseye.reduction.optics.link import Link, LinkReflector
from catseye.reduction.optics.link_budget import link_budget
from repository import ROOT

LIGHT = 0.78e-6


@pytest.fixture(scope="module")
def found():
    return reduce_beam(read_record(ROOT / "examples" / "beams" / "train.toml", BeamTrain))


@pytest.fixture(scope="module")
def at(found):
    return {place.name: place for place in found.places}


def test_it_has_the_elements_of_the_figure(found):
    names = [place.name for place in found.places]
    assert names == [
        *("collimating lens", "isolator", "beam splitter, out", "steering mirror, out", "retroreflector"),
        *("steering mirror, back", "beam splitter, back", "collecting lens", "detector"),
    ]


def test_the_beam_is_that_of_a_waist_in_the_collimators_focus(at):
    """A waist in the front focal plane goes to the back one, wavelength f/(pi w) wide (Self 1983)."""
    w = 0.060 * np.tan(np.radians(5.6) * np.sqrt(2.0 / np.log(2.0)) / 2.0)
    assert at["collimating lens"].radius == pytest.approx([w, w], rel=1e-6)
    assert w == pytest.approx(4.992e-3, abs=1e-6)
    rayleigh = np.pi * w**2 / LIGHT
    for name, way in (("retroreflector", 60.22), ("collecting lens", 120.43)):  # from 60 mm behind the lens
        assert at[name].radius == pytest.approx([w * np.hypot(1.0, way / rayleigh)] * 2, rel=1e-6)
        assert 1.0 / at[name].curvature == pytest.approx([way + rayleigh**2 / way] * 2, rel=1e-5)
    image, lens = at["detector"], at["collecting lens"]
    smallest = LIGHT * 0.2 / (np.pi * lens.radius)
    assert image.radius == pytest.approx(smallest, rel=0.03)  # 32 um before its waist, of a depth of 0.16 mm


def test_each_elements_power_is_the_product_of_what_its_data_say(at):
    films = coating.named("dielectric", 0.78, np.pi / 4)
    shown = np.mean([coating.response(films, 0.78, np.pi / 4, polarization=p).reflectance for p in "sp"])
    turn = np.radians(45.0) * 293.15 / 298.15
    expected = 10e-3 * 0.98 * 0.92 * np.cos(np.pi / 4 - turn) ** 2 * 0.5 * shown * 0.92 * shown * 0.5 * 0.98
    assert at["detector"].power == pytest.approx(expected, rel=2e-4)
    assert expected == pytest.approx(2.02e-3, rel=5e-3)


def test_an_isolator_5_degrees_warmer_lets_light_back(found):
    """0.755 degrees of turn are missing: -20 log sin of them, and 0.36 dB of plain loss."""
    missing = 45.0 * (1.0 - 293.15 / 298.15)
    assert found.laser["isolation_db"] == pytest.approx(-20 * np.log10(np.sin(np.radians(missing))) + 0.362, abs=0.03)
    assert found.laser["isolation_db"] == pytest.approx(37.97, abs=0.01)
    cool = found.train.model_copy(
        update={"outward": tuple(e.model_copy(update={"temperature_c": None}) for e in found.train.outward)}
    )
    assert reduce_beam(cool).laser["isolation_db"] > 60.0


def test_the_link_budget_of_the_same_head_has_the_same_power(found):
    through = found.places[-1].power / 10e-3 / 0.92
    assert through == pytest.approx(0.2198, abs=1e-4)
    link = Link(waist=found.places[0].radius[0], receiver=25e-3, transmission=through, extinction_per_m=0.0)
    for row in found.returned:
        budget = link_budget(link, LinkReflector(aperture=25.4e-3, reflectance=0.92), row.distance + 0.2)
        lost = 1.0 - row.hit * row.collected  # behind the lens's edge it spreads in rings, which a detector misses
        assert budget.received == pytest.approx(row.power, rel=3e-4 + 0.05 * lost), row.distance
