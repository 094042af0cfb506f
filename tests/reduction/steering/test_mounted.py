"""Rangers of a site: the u of a feed-arm ranger's counts by Monte Carlo; the site's place for the Sun."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import TWO_PI
from catseye.errors import InputError
from catseye.geometry.antenna.rigid_telescope import RigidTelescope
from catseye.geometry.frames.rotation import from_vector
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.records.site.folder import read_site
from catseye.reduction.steering.aiming import BeamSurroundings, aim_ranger
from catseye.reduction.steering.mounted import posture_of_site, ranger_of_site, telescope_of_site
from repository import ROOT

SITE = read_site(ROOT / "examples/sites/gbt")
TELESCOPE = telescope_of_site(SITE, posture_of_site(SITE))
TO = TELESCOPE.ground_from("reflector").points(np.array([[2.0, 54.0, 12.2], [-20.0, 80.0, 30.0]]))
U = {"place": 0.4e-3, "turn": 2e-5, "offset": 0.1e-3, "beta": 3e-5, "zero": 1.5}


@pytest.fixture
def ranger():
    """ZY115 with every uncertainty known."""
    found = ranger_of_site(SITE, "ZY115")
    arm = found.arm.model_copy(update={"u_position_mm": 1e3 * U["place"], "u_mount_rad": U["turn"]})
    u = {"u_offset_mm": 1e3 * U["offset"], "u_beta_rad": U["beta"], "u_zero_counts": U["zero"]}
    return replace(found, arm=arm, mirror=found.mirror.model_copy(update=u))


def test_the_u_of_counts_is_the_scatter_of_stations_that_are_off(ranger):
    station, rng, draws = ranger.station(TELESCOPE), np.random.default_rng(115), 4000
    claim, lacking = ranger.counts_covariance(station, TO)
    assert lacking == ()
    turned = station.gamma @ np.swapaxes(from_vector(U["turn"] * rng.normal(size=(draws, 3))), -1, -2)
    drawn = MirrorStation.from_matrix(
        station.scan_point
        + U["place"] * rng.normal(size=(draws, 3))
        + (U["offset"] * rng.normal(size=(draws, 3)) @ station.gamma),
        turned,
        offset=np.tile(station.offset, (draws, 1)),
        beta=station.beta + U["beta"] * rng.normal(size=(draws, 2)),
        zeros=station.zeros + U["zero"] * rng.normal(size=(draws, 2)),
    )
    scatter = counts(drawn[:, None], TO)
    for k in range(len(TO)):
        sample = np.cov(scatter[:, k].T)
        width = np.sqrt((np.outer(np.diag(claim[k]), np.diag(claim[k])) + claim[k] ** 2) / draws)
        assert np.all(np.abs(sample - claim[k]) < 4.0 * width)


def test_without_the_mount_s_u_that_of_counts_is_unknown():
    aimed = aim_ranger(ranger_of_site(SITE, "ZY115"), TO, BeamSurroundings(), TELESCOPE)
    assert "u_mount_rad" in aimed.pointings.lacking
    assert np.isnan(aimed.pointings.u).all()


def test_a_feed_arm_ranger_needs_the_posture():
    with pytest.raises(InputError, match="ZY115 moves with the telescope"):
        ranger_of_site(SITE, "ZY115").station()


def test_the_sun_is_seen_from_the_site_where_the_ranger_has_no_place_of_its_own():
    scene = BeamSurroundings(mjd=52892.58)
    on_arm = aim_ranger(ranger_of_site(SITE, "ZY115"), TO, scene, TELESCOPE).sightings[0]
    ground = aim_ranger(ranger_of_site(SITE, "ZY103"), TO, scene).sightings[0]
    assert on_arm.azimuth == pytest.approx(ground.azimuth, abs=1e-4 * TWO_PI)
    assert on_arm.separation != pytest.approx(ground.separation, abs=1e-3)


def test_the_telescope_has_the_site_s_lengths():
    nominal = RigidTelescope(*posture_of_site(SITE))
    for name, value in vars(TELESCOPE).items():
        assert value == pytest.approx(getattr(nominal, name), abs=1e-12), name
