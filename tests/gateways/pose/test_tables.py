"""The tables of poses, of a pointing series and of a track: each number over the unit in its column's name."""

from types import SimpleNamespace

import numpy as np

from catseye.constants import ARCSECOND
from catseye.gateways.pose.tables import observations_csv, points_csv, tilt_csv
from catseye.geometry.antenna.pointing_series import published
from catseye.reduction.pose.pointing_fit import fit_pointing
from catseye.reduction.pose.track_profile import track_profile
from column_scene import assert_columns

RNG = np.random.default_rng(32)


def test_every_column_of_the_points_of_a_pose_has_the_unit_of_its_name():
    places, moved, residual = (RNG.normal(size=(4, 3)) * size for size in (30.0, 1e-3, 1e-4))
    pose = SimpleNamespace(
        names=("A", "B", "C", "D"),
        displacement=lambda x: (moved, None) if x is places else None,
        motion=SimpleNamespace(residual=residual),
        w=np.array([0.5, 1.25, np.nan, 2.0]),
    )
    told = {
        "point": lambda i: pose.names[i],
        **{f"{'xyz'[a]}_m": lambda i, a=a: places[i, a] for a in range(3)},
        **{f"d{'xyz'[a]}_mm": lambda i, a=a: moved[i, a] for a in range(3)},
        **{f"residual_{'xyz'[a]}_mm": lambda i, a=a: residual[i, a] for a in range(3)},
        "w": lambda i: pose.w[i],
    }
    found = SimpleNamespace(pose=SimpleNamespace(pose=pose, places=places))
    assert_columns(points_csv(found), told, range(4))


def test_every_column_of_pointing_offsets_has_the_unit_of_its_name():
    a, e = RNG.uniform(0, 2 * np.pi, 40), RNG.uniform(0.2, 1.4, 40)
    seen = published().correction(a, e) + RNG.normal(size=(40, 2)) * 3 * ARCSECOND
    fit = fit_pointing(a, e, seen, u=3 * ARCSECOND)
    where = [f"stars line {k}" for k in range(40)]
    told = {
        "place": lambda k: where[k],
        "azimuth_deg": lambda k: a[k],
        "elevation_deg": lambda k: e[k],
        "correction_azimuth_cos_e_arcsec": lambda k: seen[k, 0],
        "correction_elevation_arcsec": lambda k: seen[k, 1],
        "residual_azimuth_cos_e_arcsec": lambda k: fit.residual[k, 0],
        "residual_elevation_arcsec": lambda k: fit.residual[k, 1],
        "w_azimuth": lambda k: fit.w[k, 0],
        "w_elevation": lambda k: fit.w[k, 1],
        "used": lambda k: "yes" if fit.used[k] else "no",
    }
    left = seen - fit.series.correction(a, e)
    np.testing.assert_allclose(np.abs(fit.residual), np.abs(left), rtol=0, atol=1e-12)  # rad
    found = SimpleNamespace(fit=fit, observations=SimpleNamespace(where=where))
    assert_columns(observations_csv(found), told, range(40))


def test_every_column_of_the_tilt_has_the_unit_of_its_name():
    azimuth = np.radians(np.arange(0.0, 360.0, 30.0))
    turns = np.stack([3.0 + np.cos(2 * azimuth), -2.0 + np.sin(azimuth)], axis=-1) * ARCSECOND
    spread = np.repeat((np.diag([1.0, 4.0]) * (0.2 * ARCSECOND) ** 2)[None], 12, axis=0)
    found = track_profile(azimuth, turns, spread, tilts=None, harmonics=2)
    at = np.radians(np.arange(0.0, 360.0, 5.0))
    tilt, covariance = found.series.at(at)
    told = {
        "azimuth_deg": lambda k: at[k],
        "tilt_east_arcsec": lambda k: tilt[k, 0],
        "tilt_north_arcsec": lambda k: tilt[k, 1],
        "u_east_arcsec": lambda k: covariance[k, 0, 0] ** 0.5,
        "u_north_arcsec": lambda k: covariance[k, 1, 1] ** 0.5,
    }
    assert_columns(tilt_csv(found), told, range(72))
