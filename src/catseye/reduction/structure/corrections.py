"""Third order in one posture: corrections by measured targets.

Added to the structural model.

    frame_motion      shift and turn of one frame from three targets or more, independent of the model's own
    correct_posture   corrections to all frames with measured targets, the model's uncertainty as their prior

Measured coordinates have their full covariance, as in `coordinates.json`; targets' places in their frames
(the sheet) are uncertain too. Many postures together change the model itself: `fit`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError, InputError
from catseye.estimation.shapes.rigid_body import fit_transformation
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.frame import Transforms
from catseye.geometry.frames.rotation import to_vector
from catseye.reduction.structure.antenna import Added, Antenna, SubreflectorPosition

ITERATIONS = 20  # of Gauss-Newton; two or three suffice
SETTLED = 1e-9  # m: largest change of a predicted coordinate in the last step


@dataclass(frozen=True, eq=False)
class MeasuredPosture:
    """Targets measured in one posture.

    names         n, points of the model's groups
    coordinates   (n, 3) m, ground frame
    covariance    (3n, 3n) m^2
    posture       a single one
    subreflector  its commanded position then, if any
    """

    names: tuple[str, ...]
    coordinates: np.ndarray
    covariance: np.ndarray
    posture: TelescopePosture
    subreflector: SubreflectorPosition | None = None


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Shift and turn of one frame in its own nominal axes.

    About its motion's pivot.

    frame        its name
    names        targets
    six          (6,) m and rad, total of the frame
    correction   (6,) m and rad: six less the model's
    covariance   (6, 6) of either, by targets and sheet alone: its parent frames are taken as exact;
                 its turn is a further small one: different by half the turn itself, 1e-3 or less
    residual     (n, 3) m, frame axes: measured minus the sheet's place moved by the frame's motion
    pvv          weighted sum of squares
    degrees_of_freedom
    """

    frame: str
    names: tuple[str, ...]
    six: np.ndarray
    correction: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    pvv: float
    degrees_of_freedom: int


@dataclass(frozen=True, eq=False)
class Corrections:
    """Corrections to the model by one posture's targets.

    frames               F frames and groups, in the order of the covariance
    six                  frame: (6,) m and rad, to be added to the model's shift and turn
    covariance           (6F, 6F)
    names                targets
    residual             (n, 3) m, ground axes: observed less predicted with the corrections
    standardised         (n, 3) residual over its own standard uncertainty
    pvv                  weighted squares of residuals and of corrections over their priors
    degrees_of_freedom   3 n: each correction brings its prior
    """

    frames: tuple[str, ...]
    six: dict[str, np.ndarray]
    covariance: np.ndarray
    names: tuple[str, ...]
    residual: np.ndarray
    standardised: np.ndarray
    pvv: float
    degrees_of_freedom: int


def frame_motion(antenna: Antenna, measured: MeasuredPosture, frame: str, *, added: Added | None = None) -> FrameMotion:
    """Shift and turn of one frame from its targets.

    Its parents are where the model and `added` have them.

    antenna    the structural model
    measured   three targets or more in the groups of this frame, not on one line
    frame      its name
    added      frame: (6,) m and rad on top of the model's, of this frame's parents

    Raises EstimationError with fewer targets, or on one line.

    Source: [KABSCH76], [POPE72], as `estimation.shapes.rigid_body`.
    """
    chosen = [i for i, name in enumerate(measured.names) if antenna.groups[group_of(antenna, name)].frame == frame]
    names = tuple(measured.names[i] for i in chosen)
    posture = measured.posture
    above = {name: six for name, six in (added or {}).items() if name != frame}
    nominal = antenna.nominal(frame, posture, measured.subreflector)
    if antenna.parents[frame] != "ground":
        parent = antenna.parents[frame]
        nominal = antenna.ground_from(parent, posture, added=above, subreflector=measured.subreflector) @ nominal
    place, u = _places(antenna, names, posture, above)
    rows = np.concatenate([3 * i + np.arange(3) for i in chosen]) if chosen else np.zeros(0, dtype=int)
    turn = np.kron(np.eye(len(names)), nominal.rotation.T)
    fit = fit_transformation(
        place,
        nominal.inverse().points(measured.coordinates[chosen]),
        covariance_first=np.diag(np.repeat(u**2, 3)),
        covariance_second=turn @ measured.covariance[np.ix_(rows, rows)] @ turn.T,
        pivot=antenna.pivot(frame),
        names=names,
    ).require_converged()
    vector = to_vector(fit.matrix)
    six = np.concatenate([fit.translation, vector])
    correction = six - antenna.six(frame, posture)
    return FrameMotion(
        frame=frame,
        names=names,
        six=six,
        correction=correction,
        covariance=fit.covariance,
        residual=fit.residual,
        pvv=fit.pvv,
        degrees_of_freedom=fit.degrees_of_freedom,
    )


def correct_posture(antenna: Antenna, measured: MeasuredPosture) -> Corrections:
    """Corrections to all frames with measured targets, from one posture.

    The model's u is their prior.

    antenna    the structural model
    measured   one target or more

    Frames with few targets stay near the model, and their uncertainty shows it. Least squares with priors, derived
    in closed form; iterated until the predictions no longer change. Raises EstimationError where they do not settle.

    Source: [JCGM102] section 6.2 (propagation), least squares with the corrections as observed unknowns.
    """
    if not measured.names:
        raise EstimationError("no target was measured: no corrections possible")
    frames = _frames_of(antenna, measured.names)
    prior = np.zeros((6 * len(frames), 6 * len(frames)))
    for i, name in enumerate(frames):
        prior[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = antenna.motions[name].six_covariance(measured.posture)
    theta = np.zeros(len(prior))
    u = np.concatenate([_places(antenna, (name,), measured.posture, {})[1] for name in measured.names])
    noise = measured.covariance + np.diag(np.repeat(u**2, 3))
    for _ in range(ITERATIONS):
        added = {name: theta[6 * i : 6 * i + 6] for i, name in enumerate(frames)}
        predicted, slopes = predicted_points(antenna, measured, added)
        design = np.concatenate([slopes.get(name, np.zeros((len(noise), 6))) for name in frames], axis=1)
        misfit = (measured.coordinates - predicted).ravel() + design @ theta
        spread = design @ prior @ design.T + noise
        gain = np.linalg.solve(spread, design @ prior).T
        step = gain @ misfit - theta
        theta = theta + step
        if np.max(np.abs(design @ step), initial=0.0) < SETTLED:
            break
    else:
        raise EstimationError(f"corrections did not settle in {ITERATIONS} steps: a target is measured far off")
    reduction = np.eye(len(theta)) - gain @ design
    covariance = reduction @ prior @ reduction.T + gain @ noise @ gain.T
    residual = misfit - design @ theta
    standardised = residual / np.sqrt(np.diag(noise @ np.linalg.solve(spread, noise)))
    pvv = float(misfit @ np.linalg.solve(spread, misfit))
    six = {name: theta[6 * i : 6 * i + 6] for i, name in enumerate(frames)}
    shape = (-1, 3)
    return Corrections(
        frames=frames,
        six=six,
        covariance=covariance,
        names=measured.names,
        residual=residual.reshape(shape),
        standardised=standardised.reshape(shape),
        pvv=pvv,
        degrees_of_freedom=len(misfit),
    )


def group_of(antenna: Antenna, target: str) -> str:
    for group in antenna.groups.values():
        if target in group.names:
            return group.group
    raise InputError(f"target {target!r} is in no group of the structural model")


def u_sheet(antenna: Antenna, target: str) -> float:
    """Standard uncertainty of a target's coordinates in its frame, m."""
    group = antenna.groups[group_of(antenna, target)]
    return float(group.u[group.names.index(target)])


def _places(
    antenna: Antenna, names: Sequence[str], posture: TelescopePosture, added: Added
) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 3) in the axes of the targets' frames, and u (n,).

    In one posture.
    """
    place, u = [], []
    for name in names:
        group = group_of(antenna, name)
        row = antenna.groups[group].names.index(name)
        place.append(antenna.in_frame(group, posture, added=added)[row])
        u.append(antenna.u_points(group)[row])
    return np.array(place).reshape(-1, 3), np.array(u)


def _frames_of(antenna: Antenna, names: Sequence[str]) -> tuple[str, ...]:
    """Parent frames with a motion, from the ground up.

    Of the targets; then groups with a motion.
    """
    groups = list(dict.fromkeys(group_of(antenna, name) for name in names))
    frames = {frame: None for group in groups for frame in antenna.chain(antenna.groups[group].frame)}
    return tuple(name for name in [*frames, *groups] if name in antenna.motions)


def predicted_points(
    antenna: Antenna, measured: MeasuredPosture, added: Added, *, places: Mapping[str, np.ndarray] | None = None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Target coordinates (n, 3), and derivatives (3n, 6).

    By the shift and turn of each frame and group.
    """
    n = len(measured.names)
    predicted = np.zeros((n, 3))
    by_frame: dict[str, np.ndarray] = {}
    owners = [group_of(antenna, name) for name in measured.names]
    commanded = measured.subreflector
    for group in dict.fromkeys(owners):
        targets = [i for i, owner in enumerate(owners) if owner == group]
        points = antenna.groups[group]
        rows = [points.names.index(measured.names[i]) for i in targets]
        at = antenna.in_frame(group, measured.posture, added=added)[rows]
        if places is not None:
            at = at + np.array([places[measured.names[i]] for i in targets])
        predicted[targets] = ground_from_group(antenna, measured, group, added=added).points(at)
        slopes = antenna.derivatives(points.frame, at, measured.posture, added=added, subreflector=commanded)
        if group in antenna.motions:
            by_name = antenna.group_derivatives(group, measured.posture, added=added, subreflector=commanded)
            slopes[group] = by_name[group][rows]
        for frame, slope in slopes.items():
            by_frame.setdefault(frame, np.zeros((n, 3, 6)))[targets] = slope
    return predicted, {frame: slope.reshape(3 * n, 6) for frame, slope in by_frame.items()}


def ground_from_group(antenna: Antenna, measured: MeasuredPosture, group: str, *, added: Added) -> Transforms:
    frame = antenna.groups[group].frame
    return antenna.ground_from(frame, measured.posture, added=added, subreflector=measured.subreflector)
