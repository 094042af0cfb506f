"""Half-path errors against exact paths; taper and gain against integrals and another way to compute them."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import Voronoi

from catseye.errors import ValidityError
from catseye.optics.aperture import cells, coherent_gain, cos_incidence, ruze_gain, taper

F = 60.0
PLACES = [(0.0, 4.0), (0.0, 54.0), (0.0, 104.0), (50.0, 54.0), (-30.0, 80.0), (10.0, 20.0)]


def path(x, y, z):
    """From a plane across the axis at z = 100 down to the surface and to the focus, a ray that falls there."""
    return 100.0 - z + np.sqrt(x**2 + y**2 + (z - F) ** 2)


def z0(x, y):
    return (x**2 + y**2) / (4 * F)


@pytest.mark.parametrize(("x", "y"), PLACES)
def test_every_ray_of_a_paraboloid_is_as_long(x, y):
    assert path(x, y, z0(x, y)) == pytest.approx(100.0 + F, abs=1e-12)


@pytest.mark.parametrize(("x", "y"), PLACES)
@pytest.mark.parametrize("dz", [1e-3, -1e-3, 3e-5])
def test_a_surface_lifted_along_the_axis(x, y, dz):
    """2 dz cos^2 i; second order dz^2 / F."""
    change = path(x, y, z0(x, y) + dz) - path(x, y, z0(x, y))
    assert -change / 2 == pytest.approx(dz * cos_incidence(x, y, F) ** 2, abs=dz**2 / F)


@pytest.mark.parametrize(("x", "y"), PLACES)
@pytest.mark.parametrize("d", [1e-3, -3e-4])
def test_a_surface_lifted_along_its_normal(x, y, d):
    """The surface through all points raised by d; the ray falls where the lifted surface is above (x, y)."""

    def lifted(u):  # the foot on the design surface at a share u of the radius, raised
        foot = np.array([u * x, u * y, z0(u * x, u * y)])
        n = np.array([-u * x / (2 * F), -u * y / (2 * F), 1.0])
        return foot + d * n / np.linalg.norm(n)

    radius = np.hypot(x, y)
    u = brentq(lambda u: np.hypot(*lifted(u)[:2]) * np.sign(u) - radius, 0.9, 1.1, xtol=1e-15)
    change = path(x, y, lifted(u)[2]) - path(x, y, z0(x, y))
    assert -change / 2 == pytest.approx(d * float(cos_incidence(x, y, F)), abs=2 * d**2 / F)


def test_the_incidence_is_half_the_angle_at_the_focus():
    for x, y in PLACES:
        ray = np.array([x, y, z0(x, y) - F])
        angle = np.arccos(-ray[2] / np.linalg.norm(ray))
        assert float(cos_incidence(x, y, F)) == pytest.approx(np.cos(angle / 2), abs=1e-14)


def test_the_taper_is_an_amplitude():
    assert 20 * np.log10(taper(0.0, 13.0) / taper(1.0, 13.0)) == pytest.approx(13.0)
    assert (taper(np.linspace(0, 1, 5), 0.0) == 1.0).all()
    with pytest.raises(ValidityError, match="expected 0 to 60"):
        taper(1.0, -3.0)


@pytest.mark.parametrize("rms", [1e-4, 2.1e-4, 3e-4])
def test_ruze_is_the_mean_gain_of_many_rough_surfaces(rms):
    """Independent normal errors of 4000 patches: the coherent gain scatters by about a percent about Ruze."""
    rng, wavelength = np.random.default_rng(7), 3.5e-3
    weights = taper(np.sqrt(rng.random(4000)), 13.0)
    found = np.mean([coherent_gain(rms * rng.normal(size=4000), weights, wavelength) for _ in range(40)])
    assert found == pytest.approx(float(ruze_gain(rms**2, wavelength)), abs=0.004)


def test_the_amplitude_is_the_weight_of_small_errors():
    """One less the variance under the amplitude, not under the power."""
    rng = np.random.default_rng(2)
    rho = np.sqrt(rng.random(3000))
    error = 1e-5 * rho**2
    weights = taper(rho, 20.0)
    k = 4 * np.pi / 3e-3
    variance = np.average(error**2, weights=weights) - np.average(error, weights=weights) ** 2
    assert 1 - coherent_gain(error, weights, 3e-3) == pytest.approx(k**2 * variance, rel=1e-3)


def test_cells_are_voronois_areas_under_the_taper():
    """Against the polygons of scipy's Voronoi for inner points of a lattice, uniform light."""
    rng = np.random.default_rng(4)
    lattice = np.stack(np.meshgrid(*[np.linspace(-1, 1, 15)] * 2), axis=-1).reshape(-1, 2)
    points = lattice[np.linalg.norm(lattice, axis=1) < 0.98]
    points = points + rng.normal(0, 0.02, points.shape)
    found = cells(points, edge_db=0.0, rings=200)
    assert found.sum() == pytest.approx(1.0)
    diagram = Voronoi(points)
    for k in np.flatnonzero(np.linalg.norm(points, axis=1) < 0.6):
        x, y = diagram.vertices[diagram.regions[diagram.point_region[k]]].T
        turn = np.argsort(np.arctan2(y - y.mean(), x - x.mean()))
        x, y = x[turn], y[turn]
        area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
        assert found[k] == pytest.approx(area / np.pi, rel=0.04)  # of some 800 nodes a cell
    assert cells(points, edge_db=20.0)[0] < found[0]  # at the edge it is darker


def test_cells_average_a_smooth_function_over_the_aperture():
    rng = np.random.default_rng(5)
    points = np.concatenate([rng.uniform(-1, 1, (3000, 2)), rng.uniform(0.0, 0.4, (3000, 2))])  # dense in a corner
    points = points[np.linalg.norm(points, axis=1) <= 1.0]
    found = cells(points, edge_db=0.0)
    assert found @ points[:, 0] ** 2 == pytest.approx(0.25, abs=0.005)
    assert np.mean(points[:, 0] ** 2) < 0.2  # plainly averaged, the corner would count too much
