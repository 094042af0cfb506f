"""The cat's-eye: two concentric half-balls of glass, the large one silvered.

Its reference point is the common centre. Seen from anywhere, the ray through the centre meets the same glass.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def range_constant(r1: ArrayLike, r2: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """Distance to add to the measured length for the glass of a cat's-eye, negative.

    r1    m, radius of the small ball, through which the light enters
    r2    m, radius of the silvered large ball
    n     group index of the glass over that of the air, 1.4 to 2

    Source: [GOLDMAN00] eq. 3.14, exact for the ray through the centre. The memo's table prints about -173.6 mm where
    its own radii and index give -173.715 mm.

    >>> round(float(range_constant(1.969 * 0.0254, 3.799 * 0.0254, 1.527077)), 6)
    -0.173715
    """
    small, large = np.asarray(r1, dtype=float), np.asarray(r2, dtype=float)
    return -(np.asarray(n, dtype=float) * (small + large) - small)
