"""Rigid transforms between named frames: x_to = rotation @ x_from + translation.

Names cancel: ground_from_dish = ground_from_alidade @ alidade_from_dish.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import FrameError, ValidityError

ORTHONORMAL_TOLERANCE = 1e-9  # largest element of R R^T - 1: 0.1 um at 100 m


@dataclass(frozen=True, eq=False)
class Transform:
    """A rigid transform that knows its two frames and refuses strangers.

    to             name of the frame of the result
    from_          name of the frame of the argument
    rotation       (3, 3), the axes of `from_` in the frame `to`, one a column
    translation    (3,), m, the origin of `from_` in the frame `to`

    Source: [PARKER04] sec. 2.2 and 2.6. Exact; a rotation further than 1e-9 from orthonormal is refused.

    >>> ground_from_alidade = Transform("ground", "alidade", np.eye(3), np.array([0.0, 0.0, 1.0]))
    >>> ground_from_alidade.inverse().points([0.0, 0.0, 3.0]).tolist()
    [0.0, 0.0, 2.0]
    """

    to: str
    from_: str
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, dtype=float)
        translation = np.array(self.translation, dtype=float)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise ValidityError(
                f"{self}: rotation and translation have shapes {rotation.shape} and {translation.shape}, "
                "expected (3, 3) and (3,)"
            )
        if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
            raise ValidityError(f"{self}: rotation or translation holds a number that is not finite")
        departure = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if departure > ORTHONORMAL_TOLERANCE:
            raise ValidityError(
                f"{self}: rotation departs from orthonormal by {departure:.1e}, limit {ORTHONORMAL_TOLERANCE:.0e}; "
                "build it from angles, not from printed digits"
            )
        if np.linalg.det(rotation) < 0.0:
            raise ValidityError(f"{self}: rotation has determinant -1, expected +1: an axis is mirrored")
        rotation.flags.writeable = False
        translation.flags.writeable = False
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    def __str__(self) -> str:
        return f"{self.to}_from_{self.from_}"

    def points(self, x: ArrayLike) -> NDArray[np.float64]:
        """Points of the frame `from_`, (..., 3) in metres, in the frame `to`."""
        return self.directions(x) + self.translation

    def directions(self, v: ArrayLike) -> NDArray[np.float64]:
        """Directions or displacements of the frame `from_`, (..., 3), in the frame `to`: turned, not moved."""
        vectors = np.asarray(v, dtype=float)
        if vectors.shape[-1:] != (3,):
            raise ValidityError(f"{self}: points have shape {vectors.shape}, expected (..., 3)")
        return vectors @ self.rotation.T

    def inverse(self) -> "Transform":
        """The transform back."""
        return Transform(self.from_, self.to, self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: "Transform") -> "Transform":
        if not isinstance(other, Transform):
            return NotImplemented
        if self.from_ != other.to:
            raise FrameError(f"cannot join {other} to {self}: '{self.from_}' is not '{other.to}'")
        return Transform(
            self.to,
            other.from_,
            self.rotation @ other.rotation,
            self.rotation @ other.translation + self.translation,
        )
