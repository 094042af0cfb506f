"""Surfaces as JSON and text; SI units unless a key says otherwise."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.optics.zernike import Numbering, number
from catseye.reduction.surface.actuators import Actuators
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.dish import TABLE, DishDesign
from catseye.reduction.surface.findings import SurfaceFindings
from catseye.reduction.surface.lookup import Lookup
from catseye.reduction.surface.shape import Expansion, Gain, MeanSquare, SurfaceShape

FORMAT = "catseye-surface-1"
UNOBSERVED = "rotation about the dish's own axis: a paraboloid does not show it"


def dish_object(dish: DishDesign) -> dict[str, Any]:
    """Design as an object for JSON."""
    aperture, nominal = dish.aperture, dish.nominal
    return {
        "site": None if dish.site is None else dish.site.site.campaign.name,
        "focal_length": aperture.focal_length,
        "radius": aperture.radius,
        "centre": aperture.centre,
        "vertex": None if nominal is None else nominal.translation,
        "axis": None if nominal is None else nominal.rotation[:, 2],
        "x": None if nominal is None else nominal.rotation[:, 0],
    }


def shape_object(shape: SurfaceShape) -> dict[str, Any]:
    """Shape of one epoch as an object for JSON."""
    fit = shape.fit
    u = np.sqrt(np.diag(fit.deviation_covariance))
    return {
        "source": shape.prisms.source,
        "elevation_deg": shape.prisms.elevation_deg,
        "prisms": len(shape.prisms.names),
        "free": list(fit.free),
        "taper_db": shape.settings.taper_db,
        "paraboloid": {
            "frame": shape.prisms.nominal.to,
            "vertex": fit.frame.translation,
            "axis": fit.frame.rotation[:, 2],
            "focus": fit.frame.translation + fit.focal_length * fit.frame.rotation[:, 2],
            "translation": fit.translation,
            "rotation": fit.rotation,
            "covariance": fit.covariance,
            "covariance_order": ["translation x", "y", "z", "rotation x", "y", "z"],
            "focal_length": fit.focal_length,
            "u_focal_length": fit.u_focal_length,
            "unobserved": [UNOBSERVED],
        },
        "rms_normal": shape.rms_normal,
        **_square(shape.square),
        "gain": [_gain(g) for g in shape.gains],
        "zernike": zernike_object(shape.expansion, shape.settings.numbering),
        "deviations": {
            name: {"deviation": d, "u_deviation": s, "half_path": h}
            for name, d, s, h in zip(shape.prisms.names, fit.deviation, u, fit.half_path, strict=True)
        },
    }


def change_object(change: Change) -> dict[str, Any]:
    """Second epoch minus first."""
    u = np.sqrt(np.diag(change.deviation_covariance))
    return {
        "sources": [change.first.source, change.second.source],
        "prisms": len(change.names),
        "motion": change.motion,
        "motion_covariance": change.motion_covariance,
        "motion_order": ["translation x", "y", "z", "rotation x", "y", "z"],
        "frame": change.first.nominal.from_,
        "pivot": [0.0, 0.0, 0.0],
        **_square(change.square),
        "gain": [_gain(g) for g in change.gains],
        "zernike": zernike_object(change.expansion, change.settings.numbering),
        "deviations": {
            name: {"deviation": d, "u_deviation": s, "half_path": h}
            for name, d, s, h in zip(change.names, change.deviation, u, change.half_path, strict=True)
        },
    }


def _square(square: MeanSquare) -> dict[str, Any]:
    return {
        "half_path_rms_measured": square.measured_rms,
        "half_path_rms_noise": square.noise_rms,
        "half_path_rms": square.rms,
        "u_half_path_rms": square.u_rms,
        "half_path_mean_square": square.own,
        "u_half_path_mean_square": square.u,
    }


def _gain(gain: Gain) -> dict[str, Any]:
    return {
        "frequency": gain.frequency,
        "gain": gain.ruze,
        "u_gain": gain.u_ruze,
        "loss_db": gain.loss_db,
        "gain_noise_included": gain.measured,
        "gain_coherent_noise_included": gain.coherent,
    }


def zernike_object(expansion: Expansion, numbering: Numbering) -> dict[str, Any]:
    """Terms and coefficients, m."""
    u, u_joint = np.sqrt(np.diag(expansion.covariance)), np.sqrt(np.diag(expansion.joint_covariance))
    return {
        "of": "half-path errors over the aperture, rms 1",
        "numbering": numbering,
        "terms": [
            {
                "number": number(term, numbering),
                "n": term.n,
                "m": term.m,
                "name": term.name,
                "value": expansion.value[k],
                "u": u[k],
                "share_taken": expansion.share[k],
                "joint": expansion.joint[k],
                "u_joint": u_joint[k],
                "orthonormal": expansion.orthonormal[k],
                "u_orthonormal": expansion.u_orthonormal[k],
            }
            for k, term in enumerate(expansion.terms)
        ],
        "covariance": expansion.covariance,
    }


def lookup_object(lookup: Lookup) -> dict[str, Any]:
    """Terms by elevation as an object for JSON."""
    numbering = lookup.shapes[0].settings.numbering
    return {
        "columns": list(lookup.columns),
        "left_out": lookup.left_out,
        "elevation_deg": lookup.elevation_deg,
        "rising": [direction > 0.0 for direction in lookup.rising],
        "terms": [
            {
                "number": number(model.term, numbering),
                "name": model.term.name,
                **dict(zip(lookup.columns, model.value.tolist(), strict=True)),
                **{
                    f"u_{name}": model.raised * float(np.sqrt(v))
                    for name, v in zip(lookup.columns, np.diag(model.covariance), strict=True)
                },
                "variance_factor": model.variance_factor,
            }
            for model in lookup.models
        ],
        "table": {
            "elevation_deg": lookup.table_deg,
            "rising": lookup.table[:, :, 0],
            "mean": lookup.table[:, :, 1],
            "falling": lookup.table[:, :, 2],
            "u_mean": lookup.u_table[:, :, 1],
        },
    }


def actuators_object(actuators: Actuators) -> dict[str, Any]:
    """Number, uncertainty and size of actuator corrections."""
    return {
        "actuators": len(actuators.names),
        "measured": int(actuators.measured.sum()),
        "beyond_limits": [name for name, ok in zip(actuators.names, actuators.within, strict=True) if not ok],
        "largest_correction": float(np.abs(actuators.correction).max()),
        "u_correction_median": float(np.median(actuators.u_correction)),
        "u_correction_largest": float(actuators.u_correction.max()),
        "roughness": {
            "smooth": actuators.roughness.smooth,
            "length": actuators.roughness.length,
            "own": actuators.roughness.own,
        },
    }


def shape_passages(shape: SurfaceShape) -> list[Passage]:
    """Passages on one epoch, in order."""
    fit, square = shape.fit, shape.square
    u = np.sqrt(np.diag(fit.deviation_covariance)) / MILLIMETRE
    noun = "points" if shape.prisms.nominal.to == TABLE else "prisms"
    passages = [
        Passage(
            "The dish",
            f"{len(shape.prisms.names)} {noun} of {shape.prisms.source}, normal deviations {shape.rms_normal * 1e3:.3f}"
            f" mm rms, u {u.min():.3f} to {u.max():.3f} mm each",
        ),
        Passage("Paraboloid", f"free: {', '.join(fit.free) or 'nothing'}. {_pose(shape)}"),
        Passage("Half path", _rms(square, shape.settings.taper_db)),
    ]
    passages += [_gain_passage(g) for g in shape.gains]
    if shape.absorbed:
        dish = "offset dish" if np.any(shape.aperture.centre) else "dish with a shift of its vertex"
        absorbed = ", ".join(term.name for term in shape.absorbed)
        passages.append(
            Passage(
                "Note",
                f"the free paraboloid absorbs most of {absorbed} as a rotation of the {dish}; hold the axis (free "
                "vertex and focal length), fit fewer terms and use `joint`, or compare two epochs",
            )
        )
    return passages


def _pose(shape: SurfaceShape) -> str:
    fit, u = shape.fit, np.sqrt(np.diag(shape.fit.covariance))
    parts = []
    if "vertex" in fit.free:
        moved = ", ".join(
            f"{v / MILLIMETRE:+.3f} ± {s / MILLIMETRE:.3f}" for v, s in zip(fit.translation, u[:3], strict=True)
        )
        parts.append(f"vertex off nominal by {moved} mm ({shape.prisms.nominal.to} axes)")
    if "axis" in fit.free:
        turned = ", ".join(
            f"{v / ARCSECOND:+.2f} ± {s / ARCSECOND:.2f}" for v, s in zip(fit.rotation, u[3:], strict=True)
        )
        parts.append(f"rotated by {turned}″")
    if "focal-length" in fit.free:
        parts.append(f"focal length {fit.focal_length:.5f} ± {fit.u_focal_length:.5f} m")
    return "; ".join(parts)


def _rms(square: MeanSquare, taper_db: float) -> str:
    lit = f"weighted for an edge taper of {taper_db:g} dB" if taper_db else "uniform weight over the aperture"
    text = f"{(square.measured_rms or 0.0) * 1e3:.4f} mm rms as measured, {lit}; "
    if square.rms is None or square.u_rms is None or not square.stands_out:
        return text + "not above the measurement noise"
    return text + f"{square.rms * 1e3:.4f} ± {square.u_rms * 1e3:.4f} mm without measurement noise"


def _gain_passage(gain: Gain) -> Passage:
    text = f"{gain.frequency / 1e9:g} GHz: {gain.ruze:.4f} ± {gain.u_ruze:.4f} of the perfect surface's (Ruze)"
    return Passage("Gain", text + f"; {gain.coherent:.4f} by the aperture integral, including noise")


def change_passages(change: Change) -> list[Passage]:
    """Passages on a difference, in order."""
    u = np.sqrt(np.diag(change.motion_covariance))
    shift = ", ".join(f"{v * 1e3:+.3f} ± {s * 1e3:.3f}" for v, s in zip(change.motion[:3], u[:3], strict=True))
    turn = ", ".join(
        f"{v / ARCSECOND:+.2f} ± {s / ARCSECOND:.2f}" for v, s in zip(change.motion[3:], u[3:], strict=True)
    )
    rms = float(np.sqrt(np.mean(change.deviation**2)))
    return [
        Passage(
            "Change",
            f"{change.second.source} minus {change.first.source}, {len(change.names)} prisms: the surface by "
            f"{rms * 1e3:.3f} mm rms along its normals, after removing the dish's motion relative to its posture",
        ),
        Passage("Motion", f"{shift} mm; {turn}″, {change.first.nominal.from_} axes, about the nominal vertex"),
        Passage("Half path", _rms(change.square, change.settings.taper_db)),
        *[_gain_passage(g) for g in change.gains],
    ]


def lookup_passages(lookup: Lookup) -> list[Passage]:
    """Passages on an elevation series."""
    low, high = lookup.elevation_deg.min(), lookup.elevation_deg.max()
    rising = int((lookup.rising > 0).sum())
    text = (
        f"{len(lookup.shapes)} epochs from {low:g}° to {high:g}°, {rising} going up, {len(lookup.shapes) - rising} "
        f"down; each term by {', '.join(lookup.columns)}"
    )
    passages = [Passage("Elevation", text)]
    passages += [Passage("Left out", f"{name}: {why}") for name, why in lookup.left_out.items()]
    return passages


def actuators_passage(actuators: Actuators) -> Passage:
    """Passage on the actuators."""
    outside, rough = int((~actuators.within).sum()), actuators.roughness
    u = actuators.u_correction * 1e3
    return Passage(
        "Actuators",
        f"{len(actuators.names)}, {int(actuators.measured.sum())} with their own measured prism; corrections to "
        f"{np.abs(actuators.correction).max() * 1e3:.3f} mm, u {np.median(u):.3f} mm (median) to {u.max():.3f} mm; "
        f"{outside or 'none'} beyond their limits. Besides the trend the surface has {rough.smooth * 1e3:.3f} mm over "
        f"{rough.length:.0f} m and {rough.own * 1e3:.3f} mm per point",
    )


def surface_passages(result: SurfaceFindings) -> list[Passage]:
    """Passages on the shapes or the look-up table, then on change and actuators if present."""
    passages: list[Passage] = []
    if result.lookup is not None:
        passages += lookup_passages(result.lookup)
    else:
        for shape in result.shapes:
            passages += shape_passages(shape)
    if result.change is not None:
        passages += change_passages(result.change)
    if result.actuators is not None:
        passages.append(actuators_passage(result.actuators))
    return passages


def term_lines(shapes: Sequence[SurfaceShape], change: Change | None, lookup: Lookup | None) -> list[str]:
    """One line per Zernike term: of the change, the elevation model or the only epoch; mm."""
    shape = shapes[0]
    numbering = shape.settings.numbering
    if lookup is not None:
        lines = [f"{'term':>4}  {'':<26}" + "".join(f"{name:>22}" for name in lookup.columns) + "   mm"]
        for model in lookup.models:
            cells = "".join(
                f"{v * 1e3:+13.4f} ± {model.raised * np.sqrt(s) * 1e3:.4f}"
                for v, s in zip(model.value, np.diag(model.covariance), strict=True)
            )
            lines.append(f"{number(model.term, numbering):>4}  {model.term.name:<26}{cells}")
        return lines
    expansion = shape.expansion if change is None else change.expansion
    u, u_joint = np.sqrt(np.diag(expansion.covariance)), np.sqrt(np.diag(expansion.joint_covariance))
    lines = [f"{numbering:>4}  {'term':<26}{'left':>18}   taken{'itself':>20}   mm"]
    for k, term in enumerate(expansion.terms):
        line = f"{number(term, numbering):>4}  {term.name:<26}{expansion.value[k] * 1e3:+9.4f} ± {u[k] * 1e3:.4f}"
        line += f"  {round(100.0 * float(expansion.share[k])):4d} %"
        if np.isfinite(u_joint[k]):
            line += f"{expansion.joint[k] * 1e3:+12.4f} ± {u_joint[k] * 1e3:.4f}"
        lines.append(line)
    return lines
