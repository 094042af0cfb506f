"""A night whose telescope bends by a structural model, reduced with the model and without.

The truth is the simulator's: it evaluates the file with scipy's rotations and splines, apart from the reduction.
"""

from dataclasses import replace

import numpy as np
import pytest

from catseye.api.reading import place_of, with_structure
from catseye.errors import InputError, ValidityError
from catseye.records.night.campaign import read_campaign
from catseye.records.site.folder import read_site
from catseye.records.site.structural_model import KEYS, read_structural_model
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.structure.site_bending import RememberedBending, bending_of, displaced_site, refuse_narrow_model
from catseye.simulator.night.faults import Planted
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from catseye.simulator.structure.bent_telescope import BentTelescope
from repository import ROOT

MODEL = read_structural_model(ROOT / "examples" / "structural-model" / "telescope.toml")
COLD = MODEL.model_copy(update={"assumed_temperature_c": 3.0})
ELEVATION = 50.0


def renamed(model, old, new):
    """The model with a point of its groups named as one of the site."""

    def named(group):
        points = tuple(p.model_copy(update={"name": new if p.name == old else p.name}) for p in group.point)
        return group.model_copy(update={"point": points})

    return model.model_copy(update={"group": tuple(named(group) for group in model.group)})


def still(model):
    """The model without its repeatable motions: what it leaves, 100 mm and 1000 arc seconds, is unknown."""
    wide = dict.fromkeys(KEYS) | {"u_shift_mm": 100.0, "u_turn_arcsec": 1000.0}
    frames = tuple(f.model_copy(update={"motion": f.motion and f.motion.model_copy(update=wide)}) for f in model.frame)
    return model.model_copy(update={"frame": frames})


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """A small night of a bent telescope that nothing else moves."""
    simulated = simulate_night(
        7,
        telescope=SimulatedTelescope(145.3, ELEVATION, dish_prisms=16, triplets=2, structure=MODEL),
        schedule=Schedule(interval_s=14.0, again=0.0),
        planted=Planted(ignore=frozenset({"posture", "feed_arm"})),
    )
    return simulated, read_campaign(write_night(simulated, tmp_path_factory.mktemp("night") / "bent"))


def standardised(reduction, truth):
    """Deviations of the points from the truth over their u."""
    coordinates = reduction.coordinates
    names = [name for name in coordinates.points if name in truth.points]
    rows = coordinates.rows(names)
    return (coordinates.x[rows] - np.array([truth.points[n] for n in names])) / coordinates.u[rows]


@pytest.mark.parametrize(
    ("body", "frame", "name"),
    [
        ("alidade", "alidade", ""),
        ("dish", "reflector", ""),
        ("arm", "feed_arm", ""),
        ("dish", "reflector", "TR01-B"),
    ],
)
def test_simulator_and_reduction_bend_the_telescope_alike(body, frame, name):
    model = renamed(COLD, "TR01", "TR01-B")
    bending = bending_of(replace(read_site(place_of("gbt")), structure=model))
    azimuth, elevation = np.array([0.3, 2.0, 4.0]), np.array([0.1, 0.7, 1.5])
    found = bending.motion(bending.body(name) if name else frame, azimuth, elevation)
    truth = BentTelescope(model).shift(body, azimuth, elevation, name)
    np.testing.assert_allclose(found.rotation, truth.turn, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.translation, truth.shift, rtol=0.0, atol=1e-12)  # rounding at 100 m
    assert np.linalg.norm(found.translation, axis=1).max() > 1e-3


def test_night_of_a_bent_telescope_reduced_with_its_model_gives_the_truth(night):
    simulated, campaign = night
    reduction = reduce_epoch(with_structure(campaign, MODEL))
    assert reduction.verdict.word == "good"
    w = standardised(reduction, simulated.truth)
    assert np.sqrt(np.mean(w**2)) < 1.3  # correlated errors: 60 points of one network
    assert np.abs(w).max() < 4.5
    found = reduction.third_order
    assert found.corrections.names == ("ZAG731P", "ZAG731D", "ZEG41040L", "ZEG20440L")
    # the targets' places at rest are the design's, and nothing but the model moves them
    for name, six in found.corrections.six.items():
        u = np.sqrt(np.diag(found.corrections.covariance)).reshape(-1, 6)[found.corrections.frames.index(name)]
        assert np.all(np.abs(six) < u), name
    assert np.all(np.abs(found.residual) < 4.5 * found.u)
    correlation = found.covariance / (found.u[:, :, None] * found.u[:, None, :])
    assert np.abs(correlation - np.eye(3)).max() < 0.1  # of 10 mm that were typed, each coordinate by itself
    assert found.u.min() > 0.01


def test_reduced_with_a_still_model_the_third_order_shows_what_the_model_bends(night):
    simulated, campaign = night
    reduction = reduce_epoch(with_structure(campaign, still(MODEL)))
    found, names = reduction.third_order, ["ZEG41040L", "ZEG20440L"]
    rows = [found.names.index(name) for name in names]
    np.testing.assert_array_equal(found.displacement[rows], 0.0)
    bent = BentTelescope(MODEL).shift("arm", np.radians([145.3]), np.radians([ELEVATION]))
    for name, k in zip(names, rows, strict=True):
        at_rest = (simulated.truth.points[name] - bent.shift[0]) @ bent.turn[0]
        expected = simulated.truth.points[name] - at_rest
        assert np.linalg.norm(expected) > 0.01
        assert np.all(np.abs(found.residual[k] - expected) < 3.0 * found.u[k])  # u is mostly the typed place's
    tip = found.corrections.names.index("ZEG41040L")
    assert np.all(np.abs(found.corrections.residual[tip]) < 0.005)  # the frames' motion explains it


def test_places_of_the_ground_stay_and_those_of_the_arm_move_by_the_model():
    site = replace(read_site(place_of("gbt")), structure=MODEL)
    moved = displaced_site(site)
    assert displaced_site(replace(site, structure=None)).targets is not moved.targets
    benchmarks = [n for n, t in site.targets.items() if t.frame == "ground" and t.position_mm[2] < 1e4]
    assert all(moved.targets[n] == site.targets[n] for n in benchmarks)
    before, after = (np.array(s.feedarm.ranger[0].nominal_scan_point_mm) for s in (site, moved))
    assert 5.0 < np.linalg.norm(after - before) < 200.0
    mount = site.feedarm.ranger[0].mount_z
    if mount is not None:
        turn = np.arccos(np.clip(np.dot(mount, moved.feedarm.ranger[0].mount_z), -1.0, 1.0))
        assert turn < 1e-3


def test_a_model_of_fewer_elevations_is_refused(night):
    narrow = MODEL.model_copy(update={"elevation_deg": (60.0, 95.0)})
    with pytest.raises(ValidityError, match="elevation 50 deg is outside 60 to 95 deg"):
        reduce_epoch(with_structure(night[1], narrow))
    site = replace(read_site(place_of("gbt")), structure=narrow)
    with pytest.raises(InputError, match="it holds from elevation 60 to 95 deg"):
        refuse_narrow_model(RememberedBending(bending_of(site)))
    with pytest.raises(ValidityError, match="elevation 50 deg is outside 60 to 95"):
        BentTelescope(narrow).shift("arm", np.radians([1.0]), np.radians([50.0]))


def test_a_site_with_its_own_model_is_read_and_written(tmp_path):
    from catseye.records.site.folder import STRUCTURAL_MODEL, site_files

    site = with_structure(read_site(place_of("gbt")), COLD)
    for path, text in site_files(site).items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    again = read_site(tmp_path)
    assert again.structure == COLD.model_copy(update={"format": again.structure.format})
    assert STRUCTURAL_MODEL in again.hashes
