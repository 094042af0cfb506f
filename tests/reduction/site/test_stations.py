"""From records to counts: what the records do not know shows in u, and nothing else does."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_counts
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.site.stations import AXES, TILTS, imperfections_of, pointings_of, station_of
from catseye.reduction.steering.mounted import ranger_of_records
from draws import draws

MONUMENT = MonumentGeometry(
    monument="ZY1", x_mm=0.0, y_mm=20_000.0, z_mm=0.0, alpha1_rad=0.0, alpha2_rad=0.0, alpha3_rad=0.0,
    u_x_mm=1.0, u_y_mm=1.0, u_z_mm=1.0, u_alpha1_rad=2e-5, u_alpha2_rad=1e-5, u_alpha3_rad=1e-5,
)  # fmt: skip
MIRROR = MirrorGeometry(
    zp="ZP1", dx_mm=0.0, dy_mm=250.0, dz_mm=0.0, beta1_rad=0.0, beta2_rad=0.0, na0=-4195, ne0=-4935,
    az_low_limit=-28195, az_high_limit=68805, u_offset_mm=0.01, u_beta_rad=1e-5, u_zero_counts=0.5,
)  # fmt: skip
REAL = MIRROR.model_copy(
    update={
        "axis_offset_mm": 0.3,
        "u_axis_mm": 5.0,
        "face_tilt_rad": 1e-3,
        "beam_tilt_x_rad": -5e-4,
        "u_tilt_rad": 3e-4,
        "azimuth_encoder_cosine_counts": (5.0, 1.0),
        "azimuth_encoder_sine_counts": (2.0, 0.0),
        "elevation_encoder_cosine_counts": (3.0,),
        "elevation_encoder_sine_counts": (1.0,),
        "u_encoder_counts": 2.0,
    }
)
TO = np.array([[5.0, 10.0, 20.0], [-8.0, 12.0, -3.0], [6.0, 19.0, -9.0]])  # the last two to either side of Theta's cut


def point(monument, mirror, to):
    """Counts of a ranger of two records, with their u."""
    ranger = ranger_of_records(monument, mirror)
    station = ranger.station(None)
    return pointings_of(station, mirror, to, name=ranger.name, spread=lambda at: ranger.counts_covariance(station, at))


@draws(2000, name="n")
def test_u_of_a_real_mirrors_counts_is_their_scatter(n):
    rng = np.random.default_rng(5)
    station, mean = station_of(MONUMENT, REAL), imperfections_of(REAL)
    u = np.array([1e-3] * 3 + [2e-5, 1e-5, 1e-5] + [1e-5] * 3 + [1e-5] * 2 + [0.5] * 2)
    drawn = []
    for _ in range(n):
        off = Imperfections(
            mean.axes + rng.normal(0.0, REAL.u_axis_mm * 1e-3, len(AXES)),
            mean.tilts + rng.normal(0.0, REAL.u_tilt_rad, len(TILTS)),
            mean.azimuth_waves + rng.normal(0.0, REAL.u_encoder_counts, (2, 2)),
            mean.elevation_waves + rng.normal(0.0, REAL.u_encoder_counts, (2, 1)),
        )
        drawn.append(imperfect_counts(MirrorStation.of_parameters(station.parameters + rng.normal(0.0, u)), off, TO))
    found = point(MONUMENT, REAL, TO)
    apart = np.array(drawn) - found.counts
    apart[..., 0] -= 1e5 * np.round(apart[..., 0] / 1e5)
    # 4 sigma of a standard deviation of 2000 draws
    np.testing.assert_allclose(np.sqrt(np.mean(apart**2, axis=0)), found.u, rtol=4 / np.sqrt(2 * n))


def test_a_tilt_known_to_be_about_zero_counts_in_u_too():
    plain = point(MONUMENT, MIRROR, TO)
    doubtful = point(MONUMENT, MIRROR.model_copy(update={"u_tilt_rad": 1e-3}), TO)
    np.testing.assert_array_equal(doubtful.counts, plain.counts)
    assert np.all(doubtful.u[:, 1] > 7.0)  # a leaning beam of 1e-3 rad is 8 counts, a face twice that


def test_on_the_azimuth_axis_any_azimuth_serves_and_none_is_claimed_worse():
    at = np.array([[0.0, 10.0, 0.25], [1e-9, 10.0, 0.25]])
    found = point(MONUMENT, MIRROR, at)
    np.testing.assert_allclose(found.u[:, 0], 1e5 / np.sqrt(12.0))
    assert np.isnan(found.u[0, 1])


@pytest.mark.parametrize("far", [1e200, -2e12, np.inf, np.nan])
def test_a_point_beyond_any_site_is_refused(far):
    with pytest.raises(InputError, match=r"m is too far \(expected within 20000 m\)"):
        point(MONUMENT, MIRROR, np.array([[0.0, 10.0, 20.0], [far, 0.0, 0.0]]))
