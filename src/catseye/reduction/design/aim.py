"""Aim of a design: what is made small, as a criterion of a scene's network."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal, get_args

import numpy as np

from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import InputError
from catseye.estimation.design.criteria import SQUARINGS, BodyPose, Criterion, MeanVariance, SurfaceVariance, WorstAxis
from catseye.optics.aperture import cells, cos_incidence, ruze_gain
from catseye.reduction.design.scene import DesignScene

CriterionName = Literal["trace", "worst", "pose", "gain"]
CRITERIA: tuple[CriterionName, ...] = get_args(CriterionName)
TAPER_DB = 13.0  # edge taper of a prime-focus feed
FEWEST_OF_A_BODY, FEWEST_OF_A_SURFACE = 3, 7


@dataclass(frozen=True)
class DesignAim:
    """Criterion of a design, and the points that it is about.

    name        trace: mean variance of a coordinate; worst: variance along the worst axis; pose: of a body moved
                by the errors of its pose; gain: of the dish's half-path errors
    interest    names of the points
    frequency   Hz, at which the gain is said
    """

    name: CriterionName
    interest: tuple[str, ...]
    frequency: float | None = None

    def criterion(self, scene: DesignScene, posture: int, squarings: int = SQUARINGS) -> Criterion:
        """Criterion of the scene's network in a posture.

        squarings   of a smooth worst axis
        """
        rows = np.array([scene.row[name] for name in self.interest], dtype=int)
        if self.name == "trace":
            return MeanVariance(rows)
        if self.name == "worst":
            return WorstAxis(rows, squarings)
        if self.name == "pose":
            return BodyPose(rows)
        return _surface(scene, rows, posture)

    def loss(self, variance: float) -> float:
        """Share of the gain that is lost, by Ruze, at a variance of half-path errors m^2; nan without a frequency."""
        if self.frequency is None:
            return float("nan")
        return float(1.0 - ruze_gain(variance, SPEED_OF_LIGHT / self.frequency))


def aim_of(
    scene: DesignScene, name: CriterionName, patterns: Sequence[str], frequency: float | None = None
) -> DesignAim:
    """Aim at points by patterns of their names.

    patterns    none: the feed arm's points; the dish's prisms for the gain; without an arm every target

    Raises InputError for a pattern without a point, too few points, and a gain without a dish or frequency.
    """
    if name == "gain" and (scene.dish is None or frequency is None):
        missing = "a frequency" if scene.dish is not None else "a site with a dish"
        raise InputError(f"criterion gain: {missing} is missing (expected a site and the frequency of its gain)")
    if patterns:
        chosen = []
        for pattern in patterns:
            found = [p.name for p in scene.points if fnmatchcase(p.name, pattern)]
            if not found:
                raise InputError(f"interest {pattern!r} is no point of {scene.name} (expected a name or a pattern)")
            chosen += [n for n in found if n not in chosen]
    elif name == "gain":
        chosen = [p.name for p in scene.points if p.dish]
    else:
        chosen = [p.name for p in scene.points if p.body == "arm"]
        chosen = chosen or [p.name for p in scene.points if p.role == "target"]
    fewest = {"pose": FEWEST_OF_A_BODY, "gain": FEWEST_OF_A_SURFACE}.get(name, 1)
    if len(chosen) < fewest:
        raise InputError(f"criterion {name}: {len(chosen)} points of interest (expected at least {fewest})")
    off_dish = next((n for n in chosen if name == "gain" and not scene.points[scene.row[n]].dish), None)
    if off_dish is not None:
        raise InputError(f"criterion gain: {off_dish!r} is no prism of the dish (expected prisms of its surface)")
    return DesignAim(name, tuple(chosen), frequency if name == "gain" else None)


def _surface(scene: DesignScene, rows: np.ndarray, posture: int) -> SurfaceVariance:
    """Half-path errors of the dish's prisms less five motions and the focal length of the paraboloid."""
    assert scene.dish is not None
    shape, local = scene.dish, scene.places[rows]
    x, y, _ = local.T
    cos = cos_incidence(x, y, shape.focal_length)
    normal = np.stack([-x, -y, np.full(len(x), 2.0 * shape.focal_length)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = normal * cos[:, None]
    turns = np.stack([np.sum(along * np.cross(axis, local), axis=1) for axis in np.eye(3)[:2]], axis=1)
    focus = -along[:, 2] * (x * x + y * y) / (4.0 * shape.focal_length**2)
    weights = cells((local[:, :2] - np.array(shape.centre)) / shape.radius, edge_db=TAPER_DB)
    return SurfaceVariance(
        points=rows,
        along=np.einsum("nij,nj->ni", scene.turns[posture][rows], along),
        weights=weights / weights.sum(),
        fitted=np.concatenate([along, turns, focus[:, None]], axis=1),
    )
