"""The series against its printed formula worked elsewhere, and against the exact geometry of a crooked mount.

The mount below is built of rotations of vectors alone (scipy): a beam in an elevation structure on a tilted azimuth
axis. Nothing of it knows the series.
"""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import ValidityError
from catseye.geometry.antenna.pointing_series import (
    PUBLISHED_SKY_RMS_ARCSEC,
    TERMS,
    PointingSeries,
    axis_terms,
    design,
    published,
)
from repository import TESTS

VECTORS = tomllib.loads((TESTS / "vectors" / "pointing.toml").read_text())
EAST, NORTH, UP = np.eye(3)
small = st.floats(-20.0, 20.0)
azimuths, elevations = st.floats(0.0, 2 * np.pi), st.floats(0.1, 1.35)


@pytest.mark.parametrize("row", VECTORS["prediction"], ids=lambda r: f"{r['azimuth_deg']}-{r['elevation_deg']}")
def test_the_published_series_predicts_what_its_formula_gives_by_hand(row):
    found = published().correction(row["azimuth_deg"] * DEGREE, row["elevation_deg"] * DEGREE) / ARCSECOND
    wanted = [row["azimuth_cos_e_arcsec"], row["elevation_arcsec"]]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)  # printed to 12 digits


def test_the_published_coefficients_are_those_of_the_vector_file():
    told = dict(zip(TERMS, published().values / ARCSECOND, strict=True))
    assert told == pytest.approx({t: VECTORS["series"][t] for t in TERMS}, abs=1e-12)
    assert VECTORS["series"]["sky_rms"] == PUBLISHED_SKY_RMS_ARCSEC


def on_the_sky(azimuth, elevation, *, ia=0.0, ie=0.0, ca=0.0, npae=0.0, north=0.0, west=0.0):
    """Where the beam is on the sky, exactly, when the encoders read (azimuth, elevation).

    The azimuth encoder reads ia too much, the elevation encoder ie too little; the beam is ca to the left of square to
    the elevation axis; that axis's right end stands npae too high; the azimuth axis leans north and west.
    """
    beam = Rotation.from_rotvec(ca * UP).apply(NORTH)  # at rest: looks north, level; a left turn about up
    right = Rotation.from_rotvec(-npae * NORTH).apply(EAST)  # about north, right-handed: east goes down; so minus
    beam = Rotation.from_rotvec((elevation + ie) * right).apply(beam)
    beam = Rotation.from_rotvec(-(azimuth - ia) * UP).apply(beam)
    beam = Rotation.from_rotvec(-north * EAST).apply(beam)  # about east, right-handed: up goes south; so minus
    beam = Rotation.from_rotvec(-west * NORTH).apply(beam)  # about north: up goes east; so minus
    return np.arctan2(beam[0], beam[1]), np.arcsin(beam[2])


@given(v=st.lists(small, min_size=6, max_size=6), azimuth=azimuths, elevation=elevations)
def test_the_series_is_the_exact_mount_to_first_order(v, azimuth, elevation):
    v = np.array(v) * ARCSECOND
    terms = ("IA", "IE", "CA", "NPAE", "AN", "AW")
    a, e = on_the_sky(azimuth, elevation, ia=v[0], ie=v[1], ca=v[2], npae=v[3], north=v[4], west=v[5])
    off = (azimuth - a + np.pi) % (2 * np.pi) - np.pi
    found = PointingSeries(terms, v, np.zeros((6, 6))).correction(a, e)
    # second order: (120 arcsec)^2 tan 77 deg = 1.5e-6 rad at the very worst
    np.testing.assert_allclose(found, [off * np.cos(e), elevation - e], rtol=0, atol=1.5e-6)


@pytest.mark.parametrize("term", ["ia", "ie", "ca", "npae", "north", "west"])
def test_each_sign_is_that_of_its_own_crookedness(term):
    """One at a time and small, so that a wrong sign is a hundred thousand times what is left of second order."""
    size = 1.0 * ARCSECOND
    name = {"north": "AN", "west": "AW"}.get(term, term.upper())
    series = PointingSeries((name,), np.array([size]), np.zeros((1, 1)))
    for azimuth, elevation in ((0.3, 0.5), (2.0, 1.2), (4.4, 0.9)):
        a, e = on_the_sky(azimuth, elevation, **{term: size})
        off = (azimuth - a + np.pi) % (2 * np.pi) - np.pi
        np.testing.assert_allclose(series.correction(a, e), [off * np.cos(e), elevation - e], rtol=0, atol=1e-4 * size)


def test_an_axis_that_leans_north_is_found_in_an_and_west_in_aw():
    axis = Rotation.from_rotvec([-2e-5, -3e-5, 1e-3]).apply(UP)
    np.testing.assert_allclose(axis_terms([-2e-5, -3e-5, 1e-3]), [axis[1], -axis[0]], rtol=0, atol=2e-8)
    assert axis[1] > 0.0  # leans to the north


@given(azimuths, elevations)
def test_encoders_are_the_sky_and_the_correction(azimuth, elevation):
    a, e = published().encoders(azimuth, elevation)
    delta = published().correction(azimuth, elevation)
    np.testing.assert_allclose([(a - azimuth) * np.cos(elevation), e - elevation], delta, rtol=0, atol=1e-15)


def test_the_covariance_of_a_prediction_is_that_of_many_series():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(3, 3)) * ARCSECOND
    q, terms = root @ root.T, ("IE", "HZCZ", "CA")
    series = PointingSeries(terms, np.zeros(3), q)
    draws = rng.multivariate_normal(np.zeros(3), q, 20_000)
    seen = np.array([PointingSeries(terms, d, q).correction(1.0, 0.7) for d in draws])
    claimed = series.covariance_of_correction(1.0, 0.7)
    np.testing.assert_allclose(np.cov(seen.T), claimed, rtol=0.04, atol=0.04 * np.abs(claimed).max())  # 4 / sqrt(n/2)


def test_broadcasting_keeps_shapes():
    assert design(np.zeros((4, 1)), np.linspace(0, 1, 3)).shape == (4, 3, 2, 8)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: PointingSeries(("IA", "XX"), np.zeros(2), np.zeros((2, 2))), "'XX' is none of"),
        (lambda: PointingSeries(("IA", "IA"), np.zeros(2), np.zeros((2, 2))), "repeated"),
        (lambda: PointingSeries(("IA",), np.zeros(2), np.zeros((2, 2))), r"expected \(1,\)"),
        (lambda: published().encoders(0.0, np.pi / 2), "zenith"),
        (lambda: axis_terms([1.0, 2.0]), "expected"),
    ],
)
def test_meaningless_input_is_refused(made, said):
    with pytest.raises(ValidityError, match=said):
        made()
