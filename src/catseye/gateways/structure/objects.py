"""Structural model and vibration as JSON, text and sampler tables; SI unless a key says otherwise."""

from dataclasses import asdict
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, SECONDS_PER_DAY, ZERO_CELSIUS_K
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable
from catseye.geometry.antenna.deformation import COMPONENTS
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.findings import PredictionRequest, StructureFindings
from catseye.reduction.structure.series import Prediction, StructureFit
from catseye.reduction.structure.vibration import Vibration

FORMAT = "catseye-structure-1"
PSD = "m2 / Hz"
MOST_PEAKS = 10  # in the text


def structure_object(found: StructureFindings) -> dict[str, Any]:
    """Object that `catseye structure --json` prints."""
    fit, check, predicted = found.fit, found.check, found.predicted
    six, covariance = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, 6).T
    series, motion = fit.series, fit.fit
    rms = np.sqrt(np.nanmean(motion.residual**2, axis=(0, 2)))
    return {
        "verdict": found.verdict.to_object(),
        "group": series.group,
        "frame": series.frame,
        "pivot": series.pivot,
        "epochs": len(series),
        "elevation_deg": _elevations(fit),
        "temperature_c": _range(series.posture.temperature_c) if fit.model.temperature else None,
        "reference_temperature_c": fit.reference_c if fit.model.temperature else None,
        "functions": fit.model.functions,
        "own": fit.model.own,
        "coefficients": {
            name: {"value": six[:, k], "u": u[:, k], "components": COMPONENTS}
            for k, name in enumerate(fit.model.functions)
        },
        "covariance_order": [f"{name} {c}" for name in fit.model.functions for c in COMPONENTS],
        "covariance": covariance,
        "points": {
            name: {"rest": fit.rest[i], "own": motion.own[i].T, "residual_rms": float(rms[i])}
            for i, name in enumerate(series.names)
        },
        "variance_factor": motion.variance_factor,
        "degrees_of_freedom": motion.degrees_of_freedom,
        "scatter": {"u_shift": fit.scatter.u_six[:3], "u_turn": fit.scatter.u_six[3:], "u_point": fit.scatter.u_point},
        "left_out": None if check is None else _check(check),
        "prediction": None if predicted is None else _prediction(predicted, found.request),
        "notes": list(found.notes),
    }


def structure_passages(found: StructureFindings) -> list[Passage]:
    """Passages on the group, its scatter, the epochs left out, predicted points, notes."""
    fit, check, series = found.fit, found.check, found.fit.series
    low, high = _elevations(fit)
    passages = [
        Passage(
            "Structure",
            f"{len(series.names)} points of {series.group!r} in the frame {series.frame}, {len(series)} epochs, "
            f"elevation {low:.1f} to {high:.1f} degrees. Variance factor {fit.fit.variance_factor:.2f}, "
            f"{fit.fit.degrees_of_freedom} degrees of freedom.",
        ),
        Passage(
            "New each time",
            f"{1e3 * np.linalg.norm(fit.scatter.u_six[:3]):.3f} mm of the group's shift and "
            f"{fit.scatter.u_point * 1e3:.3f} mm of each coordinate are in no function (u).",
        ),
    ]
    if check is not None:
        passages.append(
            Passage(
                "Left out",
                f"epochs not seen by the fit were met to {check.rms * 1e3:.3f} mm rms, {check.ratio:.2f} of what was "
                f"claimed (1 is honest); {int(check.extrapolated.sum())} of them by extrapolation.",
            )
        )
    if found.predicted is not None:
        passages += _prediction_passages(found.predicted, found.request)
    return passages + [Passage("Note", note) for note in found.notes]


def _prediction_passages(predicted: Prediction, request: PredictionRequest) -> list[Passage]:
    """A passage for each predicted point, the elevation before the first."""
    passages = []
    for k, e in enumerate(request.elevation_deg):
        for i, name in enumerate(predicted.names):
            x, y, z = predicted.place[k, i]
            u_x, u_y, u_z = np.sqrt(np.diag(predicted.covariance[k, i])) / MILLIMETRE
            text = f"{name}  x {x:9.4f}  y {y:9.4f}  z {z:9.4f} m   u {u_x:.3f}, {u_y:.3f}, {u_z:.3f} mm"
            passages.append(Passage(f"At {e:g}°" if i == 0 else "", text))
    return passages


def motion_lines(fit: StructureFit) -> list[str]:
    """Two lines for each function: shift and turn of the group, and their u."""
    six, q = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(q), 0.0)).reshape(-1, 6).T
    lines = [f"{'function':<10}{'shift x, y, z, mm':>27}   {'turn x, y, z, arcsec':>27}"]
    for k, name in enumerate(fit.model.functions):
        for head, part in ((name, six[:, k]), ("  u", u[:, k])):
            shift = " ".join(f"{v:8.3f}" for v in part[:3] / MILLIMETRE)
            turn = " ".join(f"{v:8.3f}" for v in part[3:] / ARCSECOND)
            lines.append(f"{head:<10} {shift}    {turn}")
    return lines


def _elevations(fit: StructureFit) -> list[float]:
    return [float(f(fit.series.posture.elevation) / DEGREE) for f in (np.min, np.max)]


def _range(values: Any) -> list[float]:
    return [float(np.min(values)), float(np.max(values))]


def _check(check: LeaveOut) -> dict[str, Any]:
    return {
        "rms": check.rms,
        "ratio": check.ratio,
        "ratio_inside": check.ratio_inside,
        "folds": int(check.fold.max()) + 1,
        "extrapolated_epochs": int(check.extrapolated.sum()),
    }


def _prediction(predicted: Prediction, request: PredictionRequest) -> dict[str, Any]:
    return {
        **asdict(request),
        "points": {
            name: {"place": predicted.place[:, i], "covariance": predicted.covariance[:, i]}
            for i, name in enumerate(predicted.names)
        },
        "six": predicted.six,
        "six_covariance": predicted.six_covariance,
        "outside": predicted.outside,
    }


def structure_samplers(found: StructureFindings) -> dict[str, SamplerTable]:
    """Tables of a fit for FITS: residuals, coefficients, prediction."""
    fit, check, predicted, series = found.fit, found.check, found.predicted, found.fit.series
    words: dict[str, Any] = {"frame": f"{series.frame}, as the rigid telescope carries it", "pivot": _pivot(fit)}
    t, p = np.nonzero(np.isfinite(fit.fit.residual).all(axis=2))
    columns = {
        "EPOCH": SamplerColumn("", np.array([series.labels[i] for i in t]), "label of the epoch"),
        "POINT": SamplerColumn("", np.array([series.names[i] for i in p]), "name"),
        "ELEVATION": SamplerColumn("deg", np.asarray(series.posture.elevation)[t] / DEGREE, "of the telescope"),
        "TEMPERATURE": SamplerColumn("K", np.asarray(series.posture.temperature_c)[t] + ZERO_CELSIUS_K, "structure"),
        "RESIDUAL": SamplerColumn("m", fit.fit.residual[t, p], "x, y, z: measured minus model"),
    }
    if check is not None:
        columns["LEFTOUT"] = SamplerColumn("m", check.residual[t, p], "measured minus predicted, epoch left out")
        u = np.sqrt(np.einsum("tnii->tni", check.covariance))[t, p]
        columns["U_LEFTOUT"] = SamplerColumn("m", u, "claimed standard uncertainty")
    mjd = series.mjd[t] if np.isfinite(series.mjd).all() else None
    tables = {"RESIDUALS": SamplerTable("RESIDUALS", columns, mjd, "Points against the flexible model.", **words)}
    six, covariance = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, 6)
    tables["COEFFICIENTS"] = SamplerTable(
        "COEFFICIENTS",
        {
            "FUNCTION": SamplerColumn("", np.array(fit.model.functions), "of elevation E, temperature t, way up"),
            "SHIFT": SamplerColumn("m", six[:3].T, "x, y, z per unit of the function"),
            "TURN": SamplerColumn("rad", six[3:].T, "about x, y, z per unit of the function"),
            "U_SHIFT": SamplerColumn("m", u[:, :3], "standard uncertainty"),
            "U_TURN": SamplerColumn("rad", u[:, 3:], "standard uncertainty"),
        },
        comment="The group as a body.",
        **words,
    )
    if predicted is not None:
        k, n = np.divmod(np.arange(predicted.place.shape[0] * len(predicted.names)), len(predicted.names))
        tables["PREDICTION"] = SamplerTable(
            "PREDICTION",
            {
                "ELEVATION": SamplerColumn("deg", np.array(found.request.elevation_deg, dtype=float)[k], "requested"),
                "POINT": SamplerColumn("", np.array([predicted.names[i] for i in n]), "name"),
                "PLACE": SamplerColumn("m", predicted.place[k, n], "x, y, z"),
                "COVARIANCE": SamplerColumn("m2", predicted.covariance[k, n], "of x, y, z"),
            },
            comment="Predicted points.",
            **words,
        )
    return tables


def _pivot(fit: StructureFit) -> str:
    return "({:.6f}, {:.6f}, {:.6f}) m".format(*fit.series.pivot)


def vibration_object(vibration: Vibration) -> dict[str, Any]:
    """Object that `catseye structure --vibration --json` prints."""
    names = [s.name for s in vibration.series]
    return {
        "series": {
            s.name: {
                "ranges": len(s.seconds),
                "rate_hz": s.rate_hz,
                "nyquist_hz": 0.5 * s.rate_hz,
                "seconds": float(s.seconds[-1] - s.seconds[0]),
                "window": s.window,
                "u": float(np.median(s.u)),
                "floor_m2_per_hz": float(vibration.floor[a]),
            }
            for a, s in enumerate(vibration.series)
        },
        "degrees_of_freedom": vibration.spectrum.degrees,
        "bandwidth_hz": vibration.spectrum.bandwidth_hz,
        "peaks": [
            {
                "frequency_hz": p.peak.frequency_hz,
                "density_m2_per_hz": p.peak.density,
                "over_background": p.peak.over,
                "may_be_hz": p.may_be_hz,
                "likely_hz": p.likely_hz,
                "decided": p.decided,
                "shape": None
                if p.shape is None
                else {
                    name: {"size": abs(z), "u": u, "phase": float(np.angle(z)), "rms": rms}
                    for name, z, u, rms in zip(names, p.shape.shape, p.shape.u_shape, p.shape.rms, strict=True)
                },
            }
            for p in vibration.peaks
        ],
        "modes": [
            {
                "frequency_hz": m.frequency_hz,
                "u_frequency_hz": m.u_frequency_hz,
                "damping_ratio": m.damping_ratio,
                "u_log_damping": m.u_damping,
                "rms": float(np.sqrt(m.covariance[0, 0])),
            }
            for m in vibration.modes
        ],
        "notes": list(vibration.notes),
    }


def vibration_passages(vibration: Vibration) -> list[Passage]:
    """Passages on the series, the highest peaks, the modes, notes."""
    passages = [
        Passage("Series", f"{s.name}: {len(s.seconds)} ranges, {s.rate_hz:.3f} a second") for s in vibration.series
    ]
    for peak in vibration.peaks[:MOST_PEAKS]:
        where = f"{peak.likely_hz:.4g} Hz" if peak.decided else f"{peak.peak.frequency_hz:.4g} Hz, or an alias of it"
        passages.append(Passage("Peak", f"{where}: {peak.peak.over:.0f} times the background"))
    for mode in vibration.modes:
        passages.append(
            Passage(
                "Mode",
                f"{mode.frequency_hz:.4f} Hz, u {mode.u_frequency_hz:.4f} Hz; damping ratio {mode.damping_ratio:.4f}; "
                f"rms {mode.covariance[0, 0] ** 0.5 * 1e6:.1f} µm",
            )
        )
    return passages + [Passage("Note", note) for note in vibration.notes]


def vibration_samplers(vibration: Vibration, zero_mjd: float) -> dict[str, SamplerTable]:
    """Tables of densities with confidence bands, and of the ranges.

    vibration   vibration
    zero_mjd    MJD of 0 s of the series
    """
    names = np.array([s.name for s in vibration.series])
    count, width = len(vibration.spectrum.frequency_hz), len(names)
    band = vibration.spectrum.interval(0.95)
    spectra = SamplerTable(
        "SPECTRA",
        {
            "SERIES": SamplerColumn("", np.repeat(names, count), "ranger and target"),
            "FREQUENCY": SamplerColumn("Hz", np.tile(vibration.spectrum.frequency_hz, width)),
            "DENSITY": SamplerColumn(
                PSD, vibration.spectrum.density.T.ravel(), "one-sided; its integral is the variance"
            ),
            "LOW": SamplerColumn(PSD, band[..., 0].T.ravel(), "95 percent, chi-square"),
            "HIGH": SamplerColumn(PSD, band[..., 1].T.ravel(), "95 percent, chi-square"),
        },
        comment="Spectra of ranges, not corrected for the mean over each buffer.",
        header={"FREEDOM": vibration.spectrum.degrees},
    )
    ranges = SamplerTable(
        "RANGES",
        {
            "SERIES": SamplerColumn("", np.concatenate([[s.name] * len(s.seconds) for s in vibration.series])),
            "RANGE": SamplerColumn("m", np.concatenate([s.ranges for s in vibration.series])),
            "U_RANGE": SamplerColumn("m", np.concatenate([s.u for s in vibration.series]), "standard uncertainty"),
        },
        mjd=np.concatenate([zero_mjd + s.seconds / SECONDS_PER_DAY for s in vibration.series]),
        comment="Ranges, at the middles of their buffers.",
    )
    return {"SPECTRA": spectra, "RANGES": ranges}
