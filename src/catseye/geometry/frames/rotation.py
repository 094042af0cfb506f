"""Rotation matrices, (..., 3, 3).

`rx`, `ry`, `rz` are passive, as in the notes: they turn the axes, not the point. `from_vector` is active: it turns
the point, not the axes. Hence rx(a) is the transpose of from_vector((a, 0, 0)).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError


def _matrix(rows: list[list[NDArray[np.float64]]]) -> NDArray[np.float64]:
    """Array (..., 3, 3) of nine broadcast elements."""
    elements = np.broadcast_arrays(*[element for row in rows for element in row])
    return np.stack(elements, axis=-1).reshape((*elements[0].shape, 3, 3))


def _sines(angle: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Cosine, sine, 0 and 1, shaped as the angle."""
    a = np.asarray(angle, dtype=float)
    return np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)


def rx(angle: ArrayLike) -> NDArray[np.float64]:
    """Matrix to coordinates in axes turned about x.

    angle    rad, any, positive by the right-hand rule about x

    Source: [PARKER04] eq. 2.10 (the first factor of 2.4). Exact.

    >>> rx(0.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -0.0, 1.0]]
    """
    c, s, zero, one = _sines(angle)
    return _matrix([[one, zero, zero], [zero, c, s], [zero, -s, c]])


def ry(angle: ArrayLike) -> NDArray[np.float64]:
    """Matrix to coordinates in axes turned about y.

    angle    rad, any, positive by the right-hand rule about y

    Source: [PARKER04] eq. 2.9 (the third factor of 2.4). Exact.

    >>> ry(np.pi / 2).round(12).tolist()
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    """
    c, s, zero, one = _sines(angle)
    return _matrix([[c, zero, -s], [zero, one, zero], [s, zero, c]])


def rz(angle: ArrayLike) -> NDArray[np.float64]:
    """Matrix to coordinates in axes turned about z.

    angle    rad, any, positive by the right-hand rule about z

    Source: [PARKER04] the second factor of eq. 2.4. Exact.

    >>> (rz(np.pi / 2) @ [1.0, 0.0, 0.0]).round(12).tolist()
    [0.0, -1.0, 0.0]
    """
    c, s, zero, one = _sines(angle)
    return _matrix([[c, s, zero], [-s, c, zero], [zero, zero, one]])


def skew(v: ArrayLike) -> NDArray[np.float64]:
    """Matrix whose product with u is v x u.

    v    (..., 3), any unit

    Source: [SHUSTER93] (there with the opposite sign). Exact.

    >>> (skew([0.0, 0.0, 2.0]) @ [1.0, 0.0, 0.0]).tolist()
    [0.0, 2.0, 0.0]
    """
    x, y, z = np.moveaxis(_triples(v, "vector"), -1, 0)
    zero = np.zeros_like(x)
    return _matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def from_vector(rotation_vector: ArrayLike) -> NDArray[np.float64]:
    """Active rotation matrix of a rotation vector.

    It turns a point about the vector by the vector's length.

    rotation_vector    (..., 3), rad, any length

    Source: [SHUSTER93], Rodrigues' formula. Exact, and smooth through zero: sin(t)/t and (1 - cos t)/t^2 are evaluated
    as sinc functions, so that neither divides by zero nor cancels.

    >>> (from_vector([0.0, 0.0, np.pi / 2]) @ [1.0, 0.0, 0.0]).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    v = _triples(rotation_vector, "rotation vector")
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = skew(v)
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (k @ k)


def to_vector(matrix: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector (0 to pi) of an active rotation matrix.

    matrix    (..., 3, 3), orthonormal with determinant +1

    Source: [SHEPPERD78], through the quaternion whose largest element is found first. Good to 1e-15 rad near zero and
    to 1e-15 of the angle elsewhere; at a half turn the vector and its opposite are the same rotation; either is
    returned.

    >>> to_vector(from_vector([1e-9, -2e-9, 0.5])).round(12).tolist()
    [1e-09, -2e-09, 0.5]
    """
    m = np.asarray(matrix, dtype=float)
    if m.shape[-2:] != (3, 3):
        raise ValidityError(f"rotation matrix has shape {m.shape}, expected (..., 3, 3)")
    trace = np.trace(m, axis1=-2, axis2=-1)
    symmetric = m + np.swapaxes(m, -1, -2)
    # Row i of `products` is 4 q_i (q_w, q_x, q_y, q_z): the row with the largest diagonal is the best conditioned.
    products = np.empty((*m.shape[:-2], 4, 4))
    products[..., 0, 0] = 1.0 + trace
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        products[..., 0, i + 1] = products[..., i + 1, 0] = m[..., k, j] - m[..., j, k]
        products[..., i + 1, i + 1] = 1.0 + 2.0 * m[..., i, i] - trace
        products[..., j + 1, k + 1] = products[..., k + 1, j + 1] = symmetric[..., j, k]
    best = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    safe = np.where(sine > 0.0, sine, 1.0)
    return q[..., 1:] * np.where(sine > 0.0, 2.0 * np.arctan2(sine, q[..., :1]) / safe, 2.0)


def _triples(v: ArrayLike, what: str) -> NDArray[np.float64]:
    """Convert to a float array; refuse a last axis without three elements."""
    array = np.asarray(v, dtype=float)
    if array.shape[-1:] != (3,):
        raise ValidityError(f"{what} has shape {array.shape}, expected (..., 3)")
    return array
