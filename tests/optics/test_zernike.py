"""Zernike terms: printed tables, orthonormality by exact quadrature over the site's aperture and on any prisms."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.zernike import Term, disk_quadrature, number, orthonormal, term, terms, zernike
from catseye.records.site.folder import read_site
from repository import ROOT

SITE = ROOT / "examples" / "sites" / "gbt"
# [NOLL76] table I: n, m, and the polynomial as printed (r, angle)
NOLL = {
    1: (0, 0, lambda r, t: 1.0 + 0.0 * r),
    2: (1, 1, lambda r, t: 2.0 * r * np.cos(t)),
    3: (1, -1, lambda r, t: 2.0 * r * np.sin(t)),
    4: (2, 0, lambda r, t: np.sqrt(3) * (2 * r**2 - 1)),
    5: (2, -2, lambda r, t: np.sqrt(6) * r**2 * np.sin(2 * t)),
    6: (2, 2, lambda r, t: np.sqrt(6) * r**2 * np.cos(2 * t)),
    7: (3, -1, lambda r, t: np.sqrt(8) * (3 * r**3 - 2 * r) * np.sin(t)),
    8: (3, 1, lambda r, t: np.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(t)),
    9: (3, -3, lambda r, t: np.sqrt(8) * r**3 * np.sin(3 * t)),
    10: (3, 3, lambda r, t: np.sqrt(8) * r**3 * np.cos(3 * t)),
    11: (4, 0, lambda r, t: np.sqrt(5) * (6 * r**4 - 6 * r**2 + 1)),
    12: (4, 2, lambda r, t: np.sqrt(10) * (4 * r**4 - 3 * r**2) * np.cos(2 * t)),
    13: (4, -2, lambda r, t: np.sqrt(10) * (4 * r**4 - 3 * r**2) * np.sin(2 * t)),
    14: (4, 4, lambda r, t: np.sqrt(10) * r**4 * np.cos(4 * t)),
    15: (4, -4, lambda r, t: np.sqrt(10) * r**4 * np.sin(4 * t)),
    22: (6, 0, lambda r, t: np.sqrt(7) * (20 * r**6 - 30 * r**4 + 12 * r**2 - 1)),
}
# the pyramid of ANSI Z80.28, as [THIBOS02] prints it: number -> n, m
ANSI = {0: (0, 0), 1: (1, -1), 2: (1, 1), 3: (2, -2), 4: (2, 0), 5: (2, 2), 6: (3, -3), 7: (3, -1), 8: (3, 1),
        9: (3, 3), 12: (4, 0), 24: (6, 0), 27: (6, 6)}  # fmt: skip


@pytest.mark.parametrize("j", NOLL)
def test_nolls_table(j):
    n, m, printed = NOLL[j]
    assert term(j, "noll") == (n, m)
    r, t = np.random.default_rng(j).uniform([[0.0], [-4.0]], [[1.0], [4.0]], (2, 50))
    found = zernike((Term(n, m),), r * np.cos(t), r * np.sin(t))[:, 0]
    np.testing.assert_allclose(found, printed(r, t), atol=1e-13)


@pytest.mark.parametrize("j", ANSI)
def test_ansis_pyramid(j):
    assert term(j, "ansi") == ANSI[j]


@pytest.mark.parametrize("numbering", ["noll", "ansi"])
def test_numbers_and_terms_are_each_others_inverse(numbering):
    first = 1 if numbering == "noll" else 0
    found = terms(200, numbering)
    assert len(set(found)) == 200
    assert [number(t, numbering) for t in found] == list(range(first, first + 200))


def test_they_are_orthonormal_over_the_sites_aperture():
    """Quadrature over the circle of site.toml in its own metres, against the area it has there."""
    paraboloid = read_site(SITE).site.paraboloid
    centre, radius = np.array(paraboloid.aperture_centre_mm) / 1e3, paraboloid.aperture_radius_mm / 1e3
    wanted = terms(231, "noll")  # to order 20
    nodes, weights = disk_quadrature(40)
    metres, area = centre + radius * nodes, weights * np.pi * radius**2
    assert area.sum() == pytest.approx(np.pi * 50.0**2, rel=1e-13)
    assert area @ metres[:, 1] ** 2 / area.sum() == pytest.approx(54.0**2 + 50.0**2 / 4, rel=1e-13)  # by hand
    values = zernike(wanted, *((metres - centre) / radius).T)
    gram = values.T @ (area[:, None] * values) / area.sum()
    assert np.abs(gram - np.eye(231)).max() < 1e-10


def test_the_quadrature_is_that_of_another_kind():
    """Against scipy's adaptive one, of a function that is no polynomial."""
    from scipy.integrate import dblquad

    def f(x, y):
        return np.exp(x - 0.5 * y) * np.cos(2 * y)

    nodes, weights = disk_quadrature(40)

    def reach(x):
        return np.sqrt(1 - x * x)

    other = dblquad(lambda y, x: f(x, y), -1, 1, lambda x: -reach(x), reach, epsabs=1e-11)[0] / np.pi
    assert weights @ f(*nodes.T) == pytest.approx(other, abs=1e-9)


@pytest.mark.parametrize("count", [21, 60, 400])
def test_gram_and_schmidt_makes_them_orthonormal_on_any_prisms(count):
    rng = np.random.default_rng(count)
    points = rng.normal(0.0, 0.5, (count, 2))
    weights = rng.uniform(0.0, 1.0, count)
    weights[3] = 0.0
    values = zernike(terms(15, "noll"), *points.T)
    basis, matrix = orthonormal(values, weights)
    gram = basis.T @ (weights[:, None] * basis) / weights.sum()
    assert np.abs(gram - np.eye(15)).max() < 1e-10
    np.testing.assert_allclose(np.tril(matrix, -1), 0.0, atol=1e-13)
    assert (np.diag(matrix) > 0).all()
    np.testing.assert_allclose(basis, values @ matrix, atol=1e-10)


def test_on_dense_prisms_the_orthonormal_ones_are_zernikes():
    nodes, weights = disk_quadrature(30)
    values = zernike(terms(28, "noll"), *nodes.T)
    basis, _ = orthonormal(values, weights)
    np.testing.assert_allclose(basis, values, atol=1e-10)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: term(0, "noll"), "below 1"),
        (lambda: term(1, "fringe"), "is unknown"),
        (lambda: number(Term(3, 2), "noll"), "not a Zernike term"),
        (lambda: terms(0, "ansi"), "expected 1 to 500"),
        (lambda: disk_quadrature(-1), "below zero"),
        (lambda: orthonormal(np.ones((3, 1)), [0.0, 0.0, 0.0]), "not all 0"),
        (lambda: orthonormal(np.ones((3, 4)), [1.0, 1.0, 1.0]), "3 points do not determine 4"),
        (lambda: orthonormal(np.ones((5, 2)), np.ones(5)), "function 2 of 2"),
    ],
)
def test_invalid_values_are_refused(call, said):
    with pytest.raises(ValidityError, match=said):
        call()
