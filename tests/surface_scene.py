"""The dish of the bundled site with planted half-path errors, measured prism by prism."""

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.geometry.frames.frame import Transform
from catseye.optics.aperture import cos_incidence
from catseye.optics.zernike import zernike
from catseye.records.site.folder import read_site
from catseye.reduction.surface.actuators import actuators_of
from catseye.reduction.surface.shape import LitAperture, Prisms
from repository import ROOT

SITE = read_site(ROOT / "examples" / "sites" / "gbt")
APERTURE = LitAperture.of(SITE.site.paraboloid)
NAMES, PLACES = actuators_of(SITE)
OWN = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
NORMAL = np.column_stack([-PLACES[:, :2] / 120.0, np.ones(len(PLACES))])
NORMAL /= np.linalg.norm(NORMAL, axis=1, keepdims=True)
COS = cos_incidence(PLACES[:, 0], PLACES[:, 1], 60.0)


def half_path_of(term, size):
    return size * zernike((term,), *APERTURE.unit(PLACES).T)[:, 0]


def prisms(half, *, u=5e-5, seed=0, rows=None, turn=(0.0, 0.0), shift=(0.0, 0.0, 0.0)):
    """Prisms of the design raised by a half-path error (2209,), moved as a body, measured."""
    rows = np.arange(len(NAMES)) if rows is None else rows
    true = PLACES[rows] + (half / COS)[rows, None] * NORMAL[rows]
    true = true @ Rotation.from_rotvec([*turn, 0.0]).as_matrix().T + shift
    points = true + u * np.random.default_rng(seed).normal(size=true.shape)
    blocks = np.broadcast_to(u**2 * np.eye(3), (len(rows), 3, 3)).copy()
    return Prisms(tuple(NAMES[r] for r in rows), points, blocks, OWN, f"seed {seed}", 45.0)
