"""Surfaces of dishes without a site: exact geometry, a fit by scipy, scatter of the claimed u, offset dishes."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import catseye
from catseye.errors import ArgumentError, InputError
from draws import draws, same_sigmas
from reduction.surface.any_dish_scene import FOLDER, NoNoise, maker
from surface_scene import SITE, prisms

DISH = {"focal_length_m": 9.0, "diameter_m": 25.0}
ARCSEC = np.pi / 180.0 / 3600.0


@pytest.fixture(scope="module")
def example():
    return maker()


def of_shape(example, rng, *, astigmatism=0.0, trefoil=0.0):
    example.ASTIGMATISM, example.TREFOIL = astigmatism, trefoil
    return example.surface(rng)


def test_a_perfect_dish_is_found_exactly(example):
    found = catseye.surface(points=of_shape(maker(), NoNoise()), u=1e-5, **DISH)
    np.testing.assert_allclose(found.translation, example.VERTEX, atol=1e-10)  # m, the steps' end
    np.testing.assert_allclose(found.rotation, example.TILT, atol=1e-11)
    assert found.focal_length == pytest.approx(example.FOCAL_LENGTH, abs=1e-10)
    assert np.abs(found.deviations).max() < 1e-11
    assert found.verdict.word == "doubtful"  # nothing stands out


def test_the_planted_terms_come_back_with_a_gain():
    found = catseye.surface(FOLDER / "surface.csv", **DISH, frequency_ghz=86, zernike=11)
    shape = found.found.shapes[0]
    u = np.sqrt(np.diag(shape.expansion.covariance))
    for number, size in {5: 0.0, 6: 0.25e-3, 9: 0.0, 10: 0.10e-3}.items():
        assert abs(shape.expansion.value[number - 1] - size) < 4.0 * u[number - 1]
    assert shape.square.rms == pytest.approx(np.hypot(0.25e-3, 0.10e-3), abs=4 * shape.square.u_rms)
    planted = np.exp(-((4.0 * np.pi * np.hypot(0.25e-3, 0.10e-3) * 86e9 / 299_792_458.0) ** 2))  # Ruze
    assert shape.gains[0].ruze == pytest.approx(planted, abs=4 * shape.gains[0].u_ruze)
    assert found.verdict.word == "good"
    assert "160 points" in found.verdict.why


def orthogonal_fit(points, weights, start):
    """Vertex, axis and focal length by scipy, from distances to the meridian found by Newton's method."""

    def half_path(p):
        local = Rotation.from_rotvec([p[3], p[4], 0.0]).inv().apply(points - p[:3])
        f, r = p[5], np.hypot(local[:, 0], local[:, 1])
        foot = r.copy()
        for _ in range(20):
            off = foot**2 / (4.0 * f) - local[:, 2]
            value = foot - r + off * foot / (2.0 * f)
            foot = foot - value / (1.0 + foot**2 / (4.0 * f * f) + off / (2.0 * f))
        distance = np.hypot(foot - r, foot**2 / (4.0 * f) - local[:, 2])
        side = np.sign(local[:, 2] - r**2 / (4.0 * f))
        return side * distance / np.sqrt(1.0 + foot**2 / (4.0 * f * f))

    close = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    fit = least_squares(lambda p: np.sqrt(weights) * half_path(p), start, x_scale=[1, 1, 1, 0.1, 0.1, 1], **close)
    return fit.x, half_path(fit.x)


def test_scipy_finds_the_same_paraboloid_and_errors():
    points = maker().surface(np.random.default_rng(3))
    found = catseye.surface(points=points, u=5e-5, **DISH)
    shape = found.found.shapes[0]
    fitted, half_path = orthogonal_fit(points, shape.weights / shape.weights.sum(), [0, 0, 0, 0, 0, 9.0])
    u = np.sqrt(np.diag(shape.fit.covariance))
    # vertex and tilt are nearly one motion: what both leave out, a millionth of the slope, is 2 % of u there
    np.testing.assert_allclose(found.translation, fitted[:3], atol=0.05 * u[:3].max())
    np.testing.assert_allclose(found.rotation[:2], fitted[3:5], atol=0.05 * u[3:5].max())
    assert found.focal_length == pytest.approx(fitted[5], abs=0.01 * found.u_focal_length)
    np.testing.assert_allclose(found.half_path, half_path, atol=0.01 * found.u.min())


@draws(200)
def test_what_is_claimed_is_the_scatter(runs):
    example, found = maker(), []
    q = np.tile(np.diag(example.U_SURFACE**2), (example.TARGETS, 1, 1))
    for seed in range(runs):
        points = example.surface(np.random.default_rng(1000 + seed))
        found.append(
            catseye.surface(points=points, covariance=q, **DISH, zernike=11, free=("vertex", "axis", "focal-length"))
        )
    off = same_sigmas(0.4, 200, runs)  # a variance of 200 draws scatters by 10 %; 4 sigma
    fits = [one.found.shapes[0] for one in found]
    claimed = fits[0].fit.parameter_covariance
    sample = np.array([np.concatenate([s.fit.translation, s.fit.rotation[:2], [s.fit.focal_length]]) for s in fits])
    half = np.linalg.inv(np.linalg.cholesky(claimed))
    np.testing.assert_allclose(half @ np.cov(sample.T) @ half.T, np.eye(6), atol=off)
    value = np.array([s.expansion.value for s in fits])
    of_terms = np.diag(fits[0].expansion.covariance)
    held = [4, 5, 8, 9]  # astigmatism and trefoil, which the paraboloid leaves
    np.testing.assert_allclose(value.var(axis=0, ddof=1)[held] / of_terms[held], 1.0, atol=off)
    deviation = np.array([one.deviations for one in found])
    mean = float(np.mean(deviation.var(axis=0, ddof=1) / found[0].u ** 2))
    assert mean == pytest.approx(1.0, abs=same_sigmas(0.05, 200, runs))
    rms = np.array([s.square.rms for s in fits])
    assert np.mean([s.square.u_rms for s in fits]) == pytest.approx(rms.std(ddof=1), rel=same_sigmas(0.2, 200, runs))


def test_a_dish_in_any_axes_is_the_same_dish():
    points = maker().surface(np.random.default_rng(3))
    turn = Rotation.from_euler("xyz", [40, 20, 10], degrees=True).as_matrix()
    away = np.array([100.0, 50.0, 30.0])
    plain = catseye.surface(points=points, u=5e-5, **DISH)
    elsewhere = catseye.surface(
        points=points @ turn.T + away, u=5e-5, **DISH, vertex=(100.1, 50, 30), axis=[0.36, -0.6, 0.72]
    )
    fit, own = elsewhere.found.shapes[0].fit, plain.found.shapes[0].fit
    u = np.sqrt(np.diag(own.covariance))  # cells of a grid over the aperture, which turns with it, are the weights
    np.testing.assert_allclose(fit.frame.translation, turn @ own.frame.translation + away, atol=0.3 * u[:3].max())
    np.testing.assert_allclose(fit.frame.rotation[:, 2], turn @ own.frame.rotation[:, 2], atol=0.3 * u[3:].max())
    np.testing.assert_allclose(elsewhere.half_path, plain.half_path, atol=0.1 * plain.u.min())
    np.testing.assert_allclose(elsewhere.u, plain.u, rtol=1e-2)


def test_an_offset_dish_is_that_of_the_same_site():
    made = prisms(np.zeros(2209), seed=2, rows=np.arange(0, 2209, 20), turn=(2e-5, -1e-5), shift=(1e-3, 2e-3, -1e-3))
    record = SITE.site.paraboloid
    centre = np.array(record.aperture_centre_mm) * 1e-3
    options = {"points": made.points, "u": 5e-5, "zernike": 6, "free": ("vertex", "focal-length")}
    of_site = catseye.surface(**options)
    own = catseye.surface(
        **options,
        focal_length_m=record.focal_length_mm * 1e-3,
        radius_m=record.aperture_radius_mm * 1e-3,
        centre=centre,
    )
    np.testing.assert_allclose(own.half_path, of_site.half_path, atol=1e-6)  # weights at the fitted place
    np.testing.assert_allclose(own.translation, of_site.translation, atol=2e-5)
    assert own.found.shapes[0].aperture.radius == of_site.found.shapes[0].aperture.radius


def test_parts_of_the_paraboloid_are_held_where_asked(example):
    points = of_shape(maker(), NoNoise())
    held = catseye.surface(points=points, u=5e-5, focal_length_m=9.002, radius_m=12.5, free=("vertex", "axis"))
    assert (held.u_focal_length, held.focal_length) == (0.0, 9.002)
    np.testing.assert_allclose(held.translation, example.VERTEX, atol=1e-9)
    place = {"vertex": example.VERTEX, "axis": Rotation.from_rotvec(example.TILT).apply([0.0, 0.0, 1.0])}
    none = catseye.surface(points=points, u=5e-5, focal_length_m=9.002, radius_m=12.5, free=(), **place)
    assert np.abs(none.deviations).max() < 1e-12


def test_two_tables_give_their_change(tmp_path):
    example = maker()
    q = np.tile(np.diag(example.U_SURFACE**2), (example.TARGETS, 1, 1))
    one = example.surface(np.random.default_rng(1))
    example.ASTIGMATISM = 0.35e-3
    two = example.surface(np.random.default_rng(2)) + np.array([0.0, 0.0, 1e-3])
    change = catseye.surface(points=[one, two], covariance=q, **DISH, zernike=6).found.change
    u = np.sqrt(np.diag(change.expansion.covariance))
    assert change.expansion.value[5] == pytest.approx(0.10e-3, abs=4 * u[5])
    u = np.sqrt(np.diag(change.motion_covariance))
    np.testing.assert_array_less(np.abs(change.motion - [0, 0, 1e-3, 0, 0, 0]) / u, 4.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"radius_m": 12.5}, "radius_m needs focal_length_m"),
        ({"centre": (0.0, 5.0)}, "centre needs focal_length_m"),
        ({"axis": (0.0, 1.0, 0.0)}, "axis needs focal_length_m"),
        ({"focal_length_m": 9.0}, "needs radius_m or diameter_m"),
        ({**DISH, "radius_m": 12.5}, "needs radius_m or diameter_m, one of the two"),
        ({**DISH, "site": "gbt"}, "site or focal_length_m"),
        ({**DISH, "frame": "ground"}, "frame needs the records of a site"),
        ({**DISH, "azimuth_deg": 10.0}, "azimuth_deg needs the records of a site"),
        ({**DISH, "actuators": True}, "actuators needs the records of a site"),
    ],
)
def test_arguments_that_do_not_fit_together_are_named(options, said):
    with pytest.raises(ArgumentError, match=said):
        catseye.surface(points=np.zeros((9, 3)), u=1e-4, **options)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"focal_length_m": 9000.0, "diameter_m": 25.0}, r"focal_length_m = 9000 \(expected 0.05 to 1000 m\)"),
        ({**DISH, "vertex": (0.0, 1.0)}, "vertex = .*expected 3 numbers"),
        ({**DISH, "axis": (0.0, 0.0, 0.0)}, "axis = 0,0,0"),
        ({**DISH, "u_mm": 0.0}, "u_mm = 0 "),
    ],
)
def test_values_that_cannot_be_are_named(options, said):
    with pytest.raises(InputError, match=said):
        catseye.surface(points=np.zeros((9, 3)), u=1e-4, **options)
