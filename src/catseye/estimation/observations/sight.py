"""Line of sight from origin to target: length and angles, with derivatives by x, y, z.

A sight is (m, 3), target minus origin in metres. Derivatives are by the sight: by the target they are the same, by the
origin the opposite. Results are nan for a sight of zero length, and
for azimuths of a vertical sight.
"""

import numpy as np

from catseye.errors import EstimationError

TWO_PI = 2.0 * np.pi
XYZ = np.arange(3)


def triples(first: np.ndarray) -> np.ndarray:
    """Columns (m, 3) of points whose x is at `first` (m,).

    EstimationError if negative.
    """
    if first.size and first.min() < 0:
        raise EstimationError(f"row {int(np.argmin(first))} names no point (column {int(first.min())}); give its own")
    return first[:, None] + XYZ


def sight(x: np.ndarray, origin: np.ndarray, target: np.ndarray, *, shift: np.ndarray | None) -> np.ndarray:
    """Target minus origin (m, 3), plus the shift by instrument and target heights.

    x        parameters
    origin   (m,) column of the x of the point measured from
    target   (m,) column of the x of the point measured to
    shift    (m, 3) or (3,) m, or None
    """
    along = x[triples(target)] - x[triples(origin)]
    return along if shift is None else along + shift


def length(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length (m,) and its derivative, the unit vector (m, 3).

    >>> length(np.array([[3.0, 4.0, 12.0]]))[0]
    array([13.])
    """
    a, b, c = along[:, 0], along[:, 1], along[:, 2]
    size = np.sqrt(a * a + b * b + c * c)
    return size, along / _or_nan(size)[:, None]


def level_length(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal length (m,) of the sight, and its derivative (m, 3).

    >>> level_length(np.array([[3.0, 4.0, 12.0]]))[0]
    array([5.])
    """
    size = np.hypot(along[:, 0], along[:, 1])
    return size, along * (1.0, 1.0, 0.0) / _or_nan(size)[:, None]


def bearing(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth (m,) clockwise from +y to +x, in (-pi, pi], and derivative (m, 3).

    tan A = e / n gives dA = (n de - e dn) / (e^2 + n^2).

    >>> bearing(np.array([[1.0, 0.0, 5.0]]))[0] == np.pi / 2
    array([ True])
    """
    east, north = along[:, 0], along[:, 1]
    square = _or_nan(east * east + north * north)
    slope = np.stack([north / square, -east / square, 0.0 * square], axis=1)
    return np.arctan2(east, north) + 0.0 * square, slope


def elevation(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Elevation angle (m,) of the sight, and its derivative (m, 3).

    tan a = u / h gives da = (h du - u dh) / (h^2 + u^2), with h the level length.

    >>> elevation(np.array([[0.0, 1.0, 1.0]]))[0] == np.pi / 4
    array([ True])
    """
    level, outward = level_length(along)
    up = along[:, 2]
    square = level * level + up * up
    slope = -up[:, None] * outward
    slope[:, 2] = level
    return np.arctan2(up, _or_nan(level)), slope / _or_nan(square)[:, None]


def by_ends(slope: np.ndarray) -> np.ndarray:
    """Derivatives (m, 6) by origin and target."""
    return np.concatenate([-slope, slope], axis=1)


def nearest_turn(predicted: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Predicted angles shifted by turns so that observed less predicted is in (-pi, pi].

    >>> nearest_turn(np.array([0.1]), np.array([TWO_PI])).round(12)
    array([6.38318531])
    """
    return predicted + TWO_PI * np.ceil((observed - predicted) / TWO_PI - 0.5)


def _or_nan(size: np.ndarray) -> np.ndarray:
    return np.where(size > 0.0, size, np.nan)
