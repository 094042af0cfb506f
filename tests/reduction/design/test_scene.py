"""A site as a design study sees it, and the derivative of its criteria by the places of what moves."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.estimation.design.network import predict
from catseye.records.site.folder import read_site
from catseye.records.site.solids import Solids, SphereRecord
from catseye.reduction.design.aim import aim_of
from catseye.reduction.design.candidates import with_ranger_at
from catseye.reduction.design.objective import DesignObjective
from catseye.reduction.design.regions import Constraints, moving_units
from catseye.reduction.design.scene import scene_of_site
from catseye.reduction.design.vary import variations
from repository import ROOT

SITE = read_site(ROOT / "examples" / "sites" / "gbt")
SCENE = scene_of_site(SITE, Solids())
TWO = scene_of_site(SITE, Solids(), postures=np.radians([[145.3, 30.0], [10.0, 60.0]]).tolist())
FREE = Constraints(5.0, 1.0, SCENE.solids)


def pairs(scene, posture=0):
    network = scene.network(posture)
    return {(scene.points[scene.rangers[r]].name, scene.points[t].name) for r, t in network.pairs}


def test_rangers_on_the_ground_do_not_see_through_the_dish():
    seen = pairs(SCENE)
    assert ("ZY101", "ZEG41040L") not in seen or ("ZY107", "ZEG41040L") not in seen
    assert ("ZY113", "TR01-L") in seen  # prisms face the feed arm,
    assert ("ZY113", "TR01-B") not in seen  # balls the ground
    assert ("ZY113", "ZY114") in seen
    assert ("ZY101", "ZY102") not in seen
    assert not any(ranger == target for ranger, target in seen)


def test_a_solid_takes_sights_away():
    sphere = SphereRecord(name="tank", frame="ground", centre_mm=(0.0, -20e3, 40e3), radius_mm=20e3)
    assert pairs(scene_of_site(SITE, Solids(sphere=(sphere,)))) < pairs(SCENE)


def test_the_feed_arm_is_known_to_some_hundredths_of_a_millimetre():
    prediction = predict(SCENE.network(0))
    arm = [SCENE.row[p.name] for p in SCENE.points if p.body == "arm"]
    longest = np.sqrt(np.linalg.eigvalsh(prediction.covariance[arm])[:, -1])
    assert len(arm) == 8
    assert 2e-5 < longest.min() < longest.max() < 1e-4


def test_the_dish_comes_with_the_gain_alone():
    assert not any(p.dish for p in SCENE.points)
    assert sum(p.dish for p in scene_of_site(SITE, Solids(), dish=True).points) == 2209


@pytest.mark.parametrize("criterion", ["trace", "worst", "pose"])
@pytest.mark.parametrize("scene", [SCENE, TWO], ids=["one posture", "two postures"])
def test_the_derivative_by_the_moving_units_is_that_of_differences(scene, criterion):
    """Units on the ground, on the arm and a triplet; central differences of 1 mm are good to 1e-6 here."""
    varied = variations(["ranger ZY107 within 20 m", "ranger ZY115 within 2 m", "target TR04-? within 1 m"])
    units = moving_units(scene, varied)
    assert [unit.name for unit in units] == ["ZY107", "ZY115", "TR04"]
    objective = DesignObjective(scene, aim_of(scene, criterion, []), units, FREE, squarings=3)
    places = objective.places
    _, slopes = objective(places)
    numeric = np.zeros_like(slopes)
    for i, k in np.ndindex(*slopes.shape):
        step = np.zeros_like(places)
        step[i, k] = 1e-3
        if units[i].level and k == 2:
            continue
        numeric[i, k] = (objective(places + step)[0] - objective(places - step)[0]) / 2e-3
    assert np.abs(numeric).max() > 1e-5  # per metre
    np.testing.assert_allclose(slopes, numeric, atol=1e-5 * np.abs(numeric).max())


def test_a_candidate_s_low_rank_update_is_the_whole_prediction():
    point, aim = SCENE.points[SCENE.row["ZY107"]], aim_of(SCENE, "worst", [])
    without = SCENE.without(["ZY107"])
    places = np.array([[-20.0, -100.0, 0.0], [60.0, 90.0, 1.0]])
    found = with_ranger_at(without, aim, point, places)
    for place, u in zip(places, found, strict=True):
        scene = without.with_point(replace(point, place=tuple(place.tolist())))
        expected = aim.criterion(scene, 0).true_value(predict(scene.network(0))) ** 0.5
        assert u == pytest.approx(expected, rel=1e-9)


def test_places_are_restricted_to_regions_clearances_and_distances():
    tank = SphereRecord(name="tank", frame="ground", centre_mm=(-26.6e3, -105e3, 0.0), radius_mm=4e3)
    constraints = Constraints(5.0, 1.0, Solids(sphere=(tank,)))
    units = moving_units(SCENE, variations(["ranger ZY107 within 20 m", "ranger ZY108 within 200 m"]))
    objective = DesignObjective(SCENE, aim_of(SCENE, "worst", []), units, constraints)
    present = objective.places
    wished = present.copy()
    wished[0] = (500.0, -115.0, 50.0)
    far = objective.restrict(wished, present)
    assert np.linalg.norm(far[0] - present[0]) == pytest.approx(20.0)
    assert far[0, 2] == present[0, 2]  # its height stays
    wished[0] = (-26.6, -105.0, 0.0)  # in the tank: a part of the way
    part = objective.restrict(wished, present)
    assert constraints.free_of_solids(SCENE, part[:1]).all()
    assert 0.0 < np.linalg.norm(part[0] - present[0]) < 20.0
    wished = present.copy()
    wished[1] = SCENE.places[SCENE.row["ZY109"]] + (1.0, 0.0, 0.0)  # beside another ranger: it stays
    np.testing.assert_array_equal(objective.restrict(wished, present)[1], present[1])


@pytest.mark.parametrize(
    ("vary", "why"),
    [
        ("ranger ZY999 within 2 m", "no such ranger in gbt"),
        ("targets between 2 and 3 m", "not on the ground"),
        ("rangers between 2 and 30 m", "stands outside"),
    ],
)
def test_variations_that_do_not_fit_are_refused(vary, why):
    with pytest.raises(InputError, match=why):
        moving_units(SCENE, variations([vary]))


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("worst", ["XX*"]), "no point of gbt"),
        (("pose", ["ZY113"]), "expected at least 3"),
        (("gain", []), "a frequency is missing"),
        (("gain", ["ZY113"] * 1, 1e11), "expected at least 7"),
    ],
)
def test_aims_without_points_are_refused(arguments, why):
    with pytest.raises(InputError, match=why):
        aim_of(SCENE, *arguments)
