"""Poses and pointing offsets as JSON and text."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.estimation.shapes.pose import COMPONENTS
from catseye.estimation.shapes.rigid_body import weak_axis
from catseye.records.network.written_pose import GROUP_POSE
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.pointing_offsets import COMPONENTS as BEAM
from catseye.reduction.pose.pointing_offsets import PointingOffset


def pose_result_object(result: PoseFindings) -> dict[str, Any]:
    """Object that `catseye pose --json` prints: m and rad."""
    group, pose = result.pose, result.pose.pose
    posture = group.epoch.posture
    moved, _ = pose.displacement(group.places)
    return {
        "format": GROUP_POSE,
        "verdict": result.verdict.to_object(),
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
        "status": result.status,
        "chi2": pose.motion.pvv,
        "degrees_of_freedom": pose.motion.degrees_of_freedom,
        "p": pose.p,
        "points": {
            name: {"place": place, "displacement": d, "residual": r, "w": w}
            for name, place, d, r, w in zip(pose.names, group.places, moved, pose.motion.residual, pose.w, strict=True)
        },
        "left_out": pose.left_out,
        "missing": list(group.missing),
        "unobserved": _unobserved(result),
        "pointing": None if result.beam is None else beam_object(result.beam),
    }


def _unobserved(result: PoseFindings) -> list[str]:
    """Rotations that the points hardly determine."""
    weak = weak_axis(result.pose.pose.covariance)
    if weak is None:
        return []
    axis = ", ".join(f"{v:.3f}" for v in weak[0])
    return [f"rotation about ({axis}): u {weak[1]:.2g} rad"]


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
        fits = "moves as one" if result.rigid else "does not move as one: check the residuals"
        passages.append(
            (
                "Rigid",
                f"chi-square {pose.motion.pvv:.1f} with {pose.motion.degrees_of_freedom} degrees of freedom, "
                f"p {pose.p:.2g}: the group {fits}",
            )
        )
    if not result.sound:
        passages.append(("Status", result.status))
    for name, w in pose.left_out.items():
        passages.append(("Left out", f"{name}: |w| {w:.1f}, it moved separately"))
    if group.missing:
        some = ", ".join(group.missing[:6]) + (" ..." if len(group.missing) > 6 else "")
        count = f"{len(group.missing)} points are" if len(group.missing) > 1 else "one point is"
        passages.append(("Missing", f"{count} not in both: {some}"))
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


def pose_lines(result: PoseFindings) -> list[str]:
    """Lines of the six numbers; with a beam, of its numbers and terms."""

    def lines(rows: list[tuple[str, str, str, str]]) -> list[str]:
        return [f"{'':<14}{name:<20}{value:>12} {unit:<7} u {u}" for name, value, u, unit in rows]

    rows = lines(pose_rows(result))
    if result.beam is not None:
        rows += ["", "The beam (its correction is the opposite)", *lines(beam_rows(result.beam))]
        for name, part in result.beam.terms.items():
            a, b, c = part[0] / ARCSECOND, part[1] / ARCSECOND, part[2] / MILLIMETRE
            rows.append(f"{'':<14}{name:<36}{a:+9.3f} {b:+9.3f} arcsec {c:+9.3f} mm")
    return rows
