"""Zernike polynomials by Noll or ANSI number, and orthonormal functions.

With a quadrature over their circle.

Azimuth counts from +x towards +y: cosines have m above zero, sines below. Each has rms 1 over the unit circle, the
first one (piston) apart from mean 0; so a coefficient is the rms that its term makes.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

Numbering = Literal["noll", "ansi"]
NUMBERINGS: tuple[Numbering, ...] = ("noll", "ansi")
LARGEST = 500  # terms: radial order 30, to which rounding stays below 1e-12
DEPENDENT = 1e-9  # of a column's length: remainder after projection on earlier columns
NAMES = {
    (0, 0): "piston", (1, 1): "tilt x", (1, -1): "tilt y", (2, 0): "defocus", (2, 2): "astigmatism 0°",
    (2, -2): "astigmatism 45°", (3, 1): "coma x", (3, -1): "coma y", (3, 3): "trefoil 0°", (3, -3): "trefoil 30°",
    (4, 0): "spherical", (4, 2): "secondary astigmatism 0°", (4, -2): "secondary astigmatism 45°",
    (4, 4): "quadrafoil 0°", (4, -4): "quadrafoil 22.5°",
}  # fmt: skip


class Term(NamedTuple):
    """Radial order n, azimuthal frequency m; n - |m| even, not negative."""

    n: int
    m: int

    @property
    def name(self) -> str:
        """Optical name of the term."""
        return NAMES.get((self.n, self.m), f"order {self.n}, {'cosine' if self.m >= 0 else 'sine'} {abs(self.m)}")


def term(number: int, numbering: Numbering) -> Term:
    """Zernike term with a number.

    number      from 1 as Noll counts, from 0 as ANSI does
    numbering   "noll" or "ansi"

    Source: [NOLL76] table I; [THIBOS02]. Raises ValidityError for a number below the first one.

    >>> term(6, "noll"), term(5, "ansi")
    (Term(n=2, m=2), Term(n=2, m=2))
    """
    if numbering not in NUMBERINGS:
        raise ValidityError(f"numbering {numbering!r} is unknown (expected {' or '.join(NUMBERINGS)})")
    first = 1 if numbering == "noll" else 0
    if number < first:
        raise ValidityError(f"Zernike number {number} is below {first}, where {numbering} begins")
    at = number - first  # the row of order n begins at n (n + 1) / 2
    n = int((np.sqrt(8.0 * at + 1.0) - 1.0) / 2.0)
    p = at - n * (n + 1) // 2
    if numbering == "ansi":
        return Term(n, 2 * p - n)
    size = 2 * ((p + 1) // 2) if n % 2 == 0 else 2 * (p // 2) + 1
    return Term(n, size if number % 2 == 0 else -size)


def number(of: Term, numbering: Numbering) -> int:
    """Number of a Zernike term.

    of          n - |m| even and not below zero
    numbering   "noll" or "ansi"

    Source: [NOLL76] table I; [THIBOS02]. Raises ValidityError for an invalid term.

    >>> number(Term(4, 0), "noll"), number(Term(4, 0), "ansi")
    (11, 12)
    """
    n, m = of
    if n < abs(m) or (n - m) % 2:
        raise ValidityError(f"n = {n}, m = {m} is not a Zernike term (expected n - |m| even and not below zero)")
    row = n * (n + 1) // 2
    candidates = range(row, row + n + 1)
    first = 1 if numbering == "noll" else 0
    return next(first + at for at in candidates if term(first + at, numbering) == of)


def terms(count: int, numbering: Numbering) -> tuple[Term, ...]:
    """First terms, in the order of their numbers.

    count       1 to 500
    numbering   "noll" or "ansi"

    Raises ValidityError for another count.
    """
    if not 1 <= count <= LARGEST:
        raise ValidityError(f"{count} Zernike terms (expected 1 to {LARGEST})")
    first = 1 if numbering == "noll" else 0
    return tuple(term(first + k, numbering) for k in range(count))


def zernike(selection: tuple[Term, ...], x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    """Values (..., k) of Zernike terms, rms 1 over the unit circle.

    The radial part by Jacobi's recurrence.

    selection   k terms
    x, y     in units of the circle's radius, from its centre; outside the circle the polynomials go on

    R_n^m(r) = r^m P_j^(0,m)(2 r^2 - 1), j = (n - m)/2, times sqrt(n + 1), and sqrt(2) where m is not zero.
    Source: [NOLL76] eqs. 1, 2. Good to 1e-12 to order 30.

    >>> zernike((Term(2, 0),), 1.0, 0.0).round(6).tolist()
    [1.732051]
    """
    from scipy.special import eval_jacobi

    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    r2, angle = x * x + y * y, np.arctan2(y, x)
    terms = np.empty((*x.shape, len(selection)))
    for k, (n, m) in enumerate(selection):
        size = abs(m)
        radial = np.sqrt(r2) ** size * eval_jacobi((n - size) // 2, 0, size, 2.0 * r2 - 1.0)
        wave = np.sqrt(2.0) * (np.cos(size * angle) if m > 0 else np.sin(size * angle)) if m else 1.0
        terms[..., k] = np.sqrt(n + 1.0) * radial * wave
    return terms


def disk_quadrature(degree: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (q, 2) of the unit circle, weights (q,) for polynomial averages.

    The weights sum to 1.

    degree   to which it is exact, 0 or more

    Gauss and Legendre in r^2, equal steps in azimuth. Raises ValidityError for a degree below zero.

    >>> points, weights = disk_quadrature(4)
    >>> round(float(weights @ points[:, 0] ** 2), 12)  # of x^2: a quarter
    0.25
    """
    if degree < 0:
        raise ValidityError(f"degree {degree} of a quadrature is below zero")
    rings, spokes = degree // 4 + 1, degree + 1  # r^2 to the power degree / 2: 2 rings - 1 at least
    node, weight = np.polynomial.legendre.leggauss(rings)
    radius = np.sqrt((node + 1.0) / 2.0)
    angle = 2.0 * np.pi * (np.arange(spokes) + 0.5) / spokes
    points = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return points.reshape(-1, 2), np.repeat(weight / 2.0 / spokes, spokes)


def orthonormal(values: ArrayLike, weights: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Functions made orthonormal on weighted points.

    Each from itself and those before it (Gram and Schmidt by QR).

    values    (k, t), t functions at k points
    weights   (k,) 0 or more; taken as shares of their sum

    Returns the basis (k, t), whose weighted products average to the unit matrix, and the matrix (t, t), upper
    triangular with diagonal above zero: basis = values @ matrix. Raises ValidityError for weights below zero or none,
    and for functions that these points do not separate.
    """
    values, weights = np.asarray(values, dtype=float), np.asarray(weights, dtype=float)
    if (weights < 0.0).any() or not (total := float(weights.sum())) > 0.0:
        raise ValidityError(
            f"weights from {weights.min():g} with sum {weights.sum():g} (expected 0 or more, not all 0)"
        )
    root = np.sqrt(weights / total)[:, None]
    points, count = values.shape
    if points < count:
        raise ValidityError(f"{points} points do not determine {count} functions (expected as many points at least)")
    triangle = np.linalg.qr(root * values, mode="r")
    size = np.linalg.norm(root * values, axis=0)
    poor = np.flatnonzero(np.abs(np.diag(triangle)) <= DEPENDENT * size)
    if len(poor):
        raise ValidityError(
            f"function {poor[0] + 1} of {count} is not separable from those before it on these {points} points; "
            "ask for fewer terms"
        )
    signs = np.sign(np.diag(triangle))
    matrix = np.linalg.solve(triangle * signs[:, None], np.eye(count))
    return values @ matrix, matrix  # not by the orthogonal factor, which is undefined where a weight is zero
