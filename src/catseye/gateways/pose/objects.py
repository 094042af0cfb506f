"""Poses and pointing offsets as JSON and text."""

from typing import Any, NamedTuple

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.shapes.pose import COMPONENTS, RIGID
from catseye.records.files.reading import Folder
from catseye.records.files.verdicts import stored_verdict
from catseye.reduction.pose.pointing_offsets import COMPONENTS as BEAM
from catseye.reduction.pose.pointing_offsets import PointingOffset
from catseye.reduction.pose.verdicts import PoseFindings, pose_status, pose_verdict
from catseye.verdict import Verdict

FORMAT = "catseye-pose-1"


def pose_result_object(result: PoseFindings) -> dict[str, Any]:
    """Object that `catseye pose --json` prints: m and rad."""
    group, pose = result.pose, result.pose.pose
    posture = group.epoch.posture
    moved, _ = pose.displacement(group.places)
    return {
        "format": FORMAT,
        "verdict": pose_verdict(result).to_object(),
        "group": group.group,
        "epoch": group.epoch.campaign,
        "against": group.against,
        "posture": None
        if posture is None
        else {"azimuth_deg": posture[0] / DEGREE, "elevation_deg": posture[1] / DEGREE},
        "frame": pose.frame,
        "pivot": pose.pivot,
        "translation": pose.translation,
        "rotation": pose.rotation,
        "u_translation": pose.u[:3],
        "u_rotation": pose.u[3:],
        "covariance": pose.covariance,
        "covariance_order": list(COMPONENTS),
        "matrix": pose.motion.matrix,
        "status": pose_status(result),
        "chi2": pose.motion.pvv,
        "degrees_of_freedom": pose.motion.degrees_of_freedom,
        "p": pose.p,
        "points": {
            name: {"place": place, "displacement": d, "residual": r, "w": w}
            for name, place, d, r, w in zip(pose.names, group.places, moved, pose.motion.residual, pose.w, strict=True)
        },
        "left_out": pose.left_out,
        "missing": list(group.missing),
        "pointing": None if result.beam is None else beam_object(result.beam),
    }


def beam_object(beam: PointingOffset) -> dict[str, Any]:
    """Beam and focus: rad, rad, m, always in this order."""
    return {
        "optics": beam.optics,
        "order": list(BEAM),
        "offset": beam.offset,
        "u_offset": np.sqrt(np.maximum(np.diag(beam.covariance), 0.0)),
        "covariance": beam.covariance,
        "correction": beam.correction,
        "terms": beam.terms,
        "plate_scale": beam.plate_scale,
        "beam_deviation": beam.beam_deviation,
        "slopes": beam.slopes,
        "relative": beam.relative,
        "u_relative": np.sqrt(np.maximum(np.diag(beam.relative_covariance), 0.0)),
    }


def pose_rows(result: PoseFindings) -> list[tuple[str, str, str, str]]:
    """Component, value, standard uncertainty and unit as text."""
    pose = result.pose.pose
    values = [*(pose.translation / MILLIMETRE), *(pose.rotation / ARCSECOND)]
    us = [*(pose.u[:3] / MILLIMETRE), *(pose.u[3:] / ARCSECOND)]
    units = ["mm"] * 3 + ["arcsec"] * 3
    return [(c, f"{v:+.3f}", f"{u:.3f}", x) for c, v, u, x in zip(COMPONENTS, values, us, units, strict=True)]


def beam_rows(beam: PointingOffset) -> list[tuple[str, str, str, str]]:
    """The same for the beam, then its terms without uncertainty."""
    u = np.sqrt(np.maximum(np.diag(beam.covariance), 0.0))
    scale = (ARCSECOND, ARCSECOND, MILLIMETRE)
    units = ("arcsec", "arcsec", "mm")
    return [
        (name, f"{v / s:+.3f}", f"{w / s:.3f}", unit)
        for name, v, w, s, unit in zip(BEAM, beam.offset, u, scale, units, strict=True)
    ]


def pose_words(result: PoseFindings) -> list[tuple[str, str]]:
    """Title and text of each passage, in order."""
    group, pose = result.pose, result.pose.pose
    pivot = ", ".join(f"{v:.3f}" for v in pose.pivot)
    passages = [
        ("Group", f"{group.group}: {len(pose.names)} points, against {group.against}"),
        ("Frame", f"{pose.frame}, rotations about the pivot ({pivot}) m"),
    ]
    if pose.motion.degrees_of_freedom:
        fits = "moves as one" if pose.p >= RIGID else "does not move as one: check the residuals"
        passages.append(
            (
                "Rigid",
                f"chi-square {pose.motion.pvv:.1f} with {pose.motion.degrees_of_freedom} degrees of freedom, "
                f"p {pose.p:.2g}: the group {fits}",
            )
        )
    if pose_status(result) != "converged":
        passages.append(("Status", pose_status(result)))
    for name, w in pose.left_out.items():
        passages.append(("Left out", f"{name}: |w| {w:.1f}, it moved separately"))
    if group.missing:
        some = ", ".join(group.missing[:6]) + (" ..." if len(group.missing) > 6 else "")
        passages.append(("Missing", f"{len(group.missing)} points of the group are not in both epochs: {some}"))
    if result.beam is not None:
        across, along = result.beam.beam_deviation
        passages.append(
            (
                "Optics",
                f"{result.beam.optics}; plate scale {result.beam.plate_scale * MILLIMETRE / ARCSECOND:.3f} arcsec per "
                f"mm, times {across:.3f} for a shift across, {along:.3f} for one in the plane of symmetry",
            )
        )
    return passages


class TiltOfPose(NamedTuple):
    """Part of a pose for a track profile: file, azimuth (rad), turn (2,), covariance (2, 2), verdict."""

    file: str
    azimuth: float
    turn: np.ndarray
    covariance: np.ndarray
    verdict: Verdict | None = None


def tilt_of_pose(folder: Folder, name: str) -> TiltOfPose:
    """Rotations about the alidade's x and y from a pose.json of `catseye pose`; or InputError."""
    import json

    try:
        stored = json.loads(folder.text(name))
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{name}: is not JSON: {problem}") from problem
    if not isinstance(stored, dict) or stored.get("format") != FORMAT:
        raise InputError(f"{name}: is not a pose (expected format '{FORMAT}', as catseye pose --out writes it)")
    if stored.get("frame") != "alidade" or not stored.get("posture"):
        raise InputError(f"{name}: is in the frame {stored.get('frame')!r} (expected 'alidade', with its posture)")
    try:
        turn = np.array(stored["rotation"], dtype=float)[:2]
        spread = np.array(stored["covariance"], dtype=float)[3:5, 3:5]
        azimuth = float(stored["posture"]["azimuth_deg"]) * DEGREE
    except (KeyError, TypeError, ValueError, IndexError) as problem:
        raise InputError(f"{name}: rotation, covariance or posture cannot be read: {problem}") from problem
    if turn.shape != (2,) or spread.shape != (2, 2) or not np.isfinite([*turn, *spread.ravel(), azimuth]).all():
        raise InputError(f"{name}: rotation and covariance have wrong sizes (expected 3 and 6 x 6 numbers)")
    return TiltOfPose(name, azimuth, turn, spread, stored_verdict(name, stored))
