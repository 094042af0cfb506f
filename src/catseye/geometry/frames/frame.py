"""Rigid transforms between named frames: x_to = rotation @ x_from + translation.

Names cancel: ground_from_dish = ground_from_alidade @ alidade_from_dish.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import FrameError, ValidityError

ORTHONORMAL_TOLERANCE = 1e-9  # largest element of R R^T - 1: 0.1 um at 100 m


@dataclass(frozen=True, eq=False)
class Transform:
    """Rigid transform between two named frames; refuses other frames.

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
        """Points (..., 3), m, of the frame `from_` in the frame `to`."""
        return self.directions(x) + self.translation

    def directions(self, v: ArrayLike) -> NDArray[np.float64]:
        """Directions or displacements (..., 3) in the frame `to`, rotated only."""
        vectors = np.asarray(v, dtype=float)
        if vectors.shape[-1:] != (3,):
            raise ValidityError(f"{self}: points have shape {vectors.shape}, expected (..., 3)")
        return vectors @ self.rotation.T

    def inverse(self) -> "Transform":
        """Inverse transform, from the frame `to` to `from_`."""
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


@dataclass(frozen=True, eq=False)
class Transforms:
    """Many rigid transforms between the same two frames.

    A `Transform` with batch axes in front.

    to             name of the frame of the results
    from_          name of the frame of the arguments
    rotation       (..., 3, 3), orthonormal; not tested, as they are built from angles
    translation    (..., 3), m

    Batch axes broadcast against those of points; `transforms[:, None]` makes room for several points at each time.
    Raises ValidityError for other shapes and FrameError where names do not cancel.

    >>> lifted = Transforms("ground", "arm", np.eye(3), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]))
    >>> lifted.points([5.0, 0.0, 0.0]).tolist()
    [[5.0, 0.0, 1.0], [5.0, 0.0, 2.0]]
    """

    to: str
    from_: str
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def __post_init__(self) -> None:
        rotation, translation = np.asarray(self.rotation, dtype=float), np.asarray(self.translation, dtype=float)
        if rotation.shape[-2:] != (3, 3) or translation.shape[-1:] != (3,):
            raise ValidityError(
                f"{self}: rotations and translations have shapes {rotation.shape} and {translation.shape}, "
                "expected (..., 3, 3) and (..., 3)"
            )
        batch = np.broadcast_shapes(rotation.shape[:-2], translation.shape[:-1])
        object.__setattr__(self, "rotation", np.broadcast_to(rotation, (*batch, 3, 3)))
        object.__setattr__(self, "translation", np.broadcast_to(translation, (*batch, 3)))

    def __str__(self) -> str:
        return f"{self.to}_from_{self.from_}"

    @classmethod
    def of(cls, transform: "Transform | Transforms") -> "Transforms":
        """Transforms, without batch axes for a single Transform."""
        return cls(transform.to, transform.from_, transform.rotation, transform.translation)

    @property
    def single(self) -> Transform:
        """Single Transform, if there are no batch axes."""
        return Transform(self.to, self.from_, self.rotation, self.translation)

    def __getitem__(self, index: Any) -> "Transforms":
        """Index the batch axes; None adds an axis."""
        at = index if isinstance(index, tuple) else (index,)
        at = at if Ellipsis in at else (*at, Ellipsis)
        rotation = self.rotation[(*at, slice(None), slice(None))]
        translation = self.translation[(*at, slice(None))]
        return Transforms(self.to, self.from_, rotation, translation)

    def points(self, x: ArrayLike) -> NDArray[np.float64]:
        """Points (..., 3), m, of the frame `from_` in the frame `to`."""
        return self.directions(x) + self.translation

    def directions(self, v: ArrayLike) -> NDArray[np.float64]:
        """Directions or displacements (..., 3) in the frame `to`, rotated only."""
        vectors = np.asarray(v, dtype=float)
        if vectors.shape[-1:] != (3,):
            raise ValidityError(f"{self}: points have shape {vectors.shape}, expected (..., 3)")
        return np.einsum("...ij,...j->...i", self.rotation, vectors)

    def inverse(self) -> "Transforms":
        """Inverse transforms, from the frame `to` to `from_`."""
        back = np.swapaxes(self.rotation, -1, -2)
        return Transforms(self.from_, self.to, back, -np.einsum("...ij,...j->...i", back, self.translation))

    def __matmul__(self, other: "Transform | Transforms") -> "Transforms":
        if not isinstance(other, Transform | Transforms):
            return NotImplemented
        if self.from_ != other.to:
            raise FrameError(f"cannot join {other} to {self}: '{self.from_}' is not '{other.to}'")
        return Transforms(self.to, other.from_, self.rotation @ other.rotation, self.points(other.translation))
