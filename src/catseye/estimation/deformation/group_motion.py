"""Rigid motion and homogeneous strain of a group of points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import (
    KNOWN,
    CongruenceTest,
    Epochs,
    VarianceFactor,
    differences,
    global_test,
)
from catseye.estimation.shapes.motions import MOTIONS
from catseye.estimation.shapes.rigid_body import motion_columns


@dataclass(frozen=True, eq=False)
class GroupMotion:
    """Motion of a group of points: translation + rotation x arm + strain arm, arm from the pivot.

    names         of the group
    pivot         (3,) m
    translation   (3,) m, of the pivot, relative to the stable points
    rotation      (3,) rad
    strain        (3, 3) symmetric; zero if not estimated
    covariance    (6 + s, 6 + s), translation, rotation, then the s strain components in the order of `components`
    components    names of the strain components, such as "xx" or, in other axes, "11"
    motion        test that the group did not move, given that it is rigid (6 degrees of freedom)
    rigid         test that it did not deform (strain zero); None if strain was not estimated
    fit           test of the residuals of motion and strain; None without redundancy
    curvature     m, second-order effect of the rotation neglected by this linear model; if above the points' sigma
                  use `shapes.rigid_body.fit_transformation`
    """

    names: tuple[str, ...]
    pivot: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    strain: np.ndarray
    covariance: np.ndarray
    components: tuple[str, ...]
    motion: CongruenceTest
    rigid: CongruenceTest | None
    fit: CongruenceTest | None
    curvature: float


def group_motion(
    epochs: Epochs,
    group: Sequence[str],
    *,
    stable: Sequence[str],
    datum: str = "rigid",
    strain_axes: np.ndarray | None = None,
    pivot: np.ndarray | None = None,
    variance_factor: VarianceFactor = KNOWN,
) -> GroupMotion:
    """Rigid motion of a group of points, optionally with homogeneous strain, relative to stable points.

    epochs            see `Epochs`
    group             names of points that move together, at least three, not collinear
    stable            names of points that did not move and define the datum; may be empty where datum is "absolute"
    datum             allowed differences of the two datums, as `congruence_test`
    strain_axes       (3, k) orthonormal directions in which strain is allowed: np.eye(3) for all 6 components (four
                      points, not coplanar), the two axes of a plane for 3, one column for a stretch along a line;
                      None: rigid
    pivot             (3,) m, default the centroid of the group
    variance_factor   known or estimated

    One weighted adjustment of the differences of stable points and group with all their correlations. Raises
    EstimationError naming undetermined parameters. Source: [CASPARY87] (strain and rigid-body models); tests as
    `congruence_test`.
    """
    places = {name: i for i, name in enumerate(epochs.names)}
    unknown = [name for name in [*group, *stable] if name not in places]
    if unknown or set(group) & set(stable):
        wrong = ", ".join(unknown or sorted(set(group) & set(stable)))
        raise EstimationError(f"{wrong}: {'not common to both epochs' if unknown else 'both in group and stable'}")
    of_group, stable_rows = [places[name] for name in group], [places[name] for name in stable]
    n = len(epochs.names)
    between = differences(epochs, datum, np.isin(np.arange(n), stable_rows))
    retained = np.repeat(np.isin(np.arange(n), of_group + stable_rows), 3)
    between = replace(between, used=between.used & retained)
    points = np.asarray(epochs.first, dtype=float)
    centre = points[of_group].mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    on_group = np.repeat(np.isin(np.arange(n), of_group), 3)[:, None]
    rigid = np.where(on_group, motion_columns(points, centre)[:, :6], 0.0)
    names = [f"{motion} of the group" for motion in MOTIONS[:6]]
    base, components = _strain_base(strain_axes)
    arms = points - centre
    stretch = np.where(on_group, np.einsum("cij,nj->nic", base, arms).reshape(3 * n, -1), 0.0)
    still = between.fit()
    moving = between.fit(rigid, names)
    full = between.fit(np.concatenate([rigid, stretch], axis=1), [*names, *(f"strain {c}" for c in components)])
    block = slice(len(full.estimate) - 6 - len(components), None)
    estimate, covariance = full.estimate[block], full.covariance[block, block] * variance_factor.value
    turn = estimate[3:6]
    return GroupMotion(
        names=tuple(group),
        pivot=centre,
        translation=estimate[:3],
        rotation=turn,
        strain=np.einsum("c,cij->ij", estimate[6:], base),
        covariance=covariance,
        components=components,
        motion=global_test(still.pvv - moving.pvv, 6, variance_factor),
        rigid=global_test(moving.pvv - full.pvv, len(components), variance_factor) if components else None,
        fit=global_test(full.pvv, full.degrees_of_freedom, variance_factor) if full.degrees_of_freedom else None,
        curvature=float(0.5 * (turn @ turn) * np.linalg.norm(arms[of_group], axis=1).max()),
    )


def _strain_base(axes: np.ndarray | None) -> tuple[np.ndarray, tuple[str, ...]]:
    """Base tensors (c, 3, 3) of the strain components in the axes, and component names."""
    if axes is None:
        return np.zeros((0, 3, 3)), ()
    e = np.asarray(axes, dtype=float)
    if e.ndim != 2 or e.shape[0] != 3 or not np.allclose(e.T @ e, np.eye(e.shape[1]), rtol=0.0, atol=1e-9):
        raise EstimationError(f"strain axes of shape {e.shape} are not orthonormal columns (3, k)")
    labels = "xyz" if np.array_equal(e, np.eye(3)) else "123"
    pairs = [(i, i) for i in range(e.shape[1])] + [(i, j) for i in range(e.shape[1]) for j in range(i + 1, e.shape[1])]
    tensors = [np.outer(e[:, i], e[:, j]) for i, j in pairs]
    base = [t if i == j else t + t.T for t, (i, j) in zip(tensors, pairs, strict=True)]
    return np.array(base), tuple(labels[i] + labels[j] for i, j in pairs)
