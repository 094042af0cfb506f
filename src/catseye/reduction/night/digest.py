"""Digest of a reduction's numbers: equal to the last bit, or different."""

import hashlib

import numpy as np

from catseye.reduction.epoch.epoch import Reduction

MOST_POINTS = 500  # whose full covariance is digested: 18 MB, a fraction of a second
SAMPLE = 100  # points of a larger night, evenly spaced by name, whose joint covariance is digested


def digest(reduction: Reduction) -> str:
    """SHA-256 over names, x, u and covariance of the points, in hexadecimal.

    Up to 500 points the covariance is all of it, (3n, 3n). Beyond, it is the (3, 3) block of each point, the joint
    block of 100 points evenly spaced in the order of names, and estimate and u of the parameters that shots have in
    common: zeros, heads, leakage, air and sound. Doubles enter as little-endian bytes.
    """
    coordinates, joint = reduction.coordinates, reduction.coordinates.joint
    sha = hashlib.sha256()
    for name in coordinates.points:
        sha.update(name.encode() + b"\0")
    _update(sha, coordinates.x)
    _update(sha, joint.u)
    count = len(coordinates.points)
    if count <= MOST_POINTS:
        _update(sha, joint.block(np.arange(count)))
        return sha.hexdigest()
    _update(sha, joint.blocks)
    _update(sha, joint.block(np.linspace(0, count - 1, SAMPLE).round().astype(int)))
    common = (coordinates.zeros, coordinates.heads, coordinates.leakage, coordinates.air, coordinates.sound)
    for estimates in common:
        for name, (value, u) in sorted(estimates.items()):
            sha.update(name.encode() + b"\0")
            _update(sha, np.array([value, u]))
    return sha.hexdigest()


def _update(sha: "hashlib._Hash", values: np.ndarray) -> None:
    sha.update(np.ascontiguousarray(values, dtype="<f8").data)
