"""Structural model and vibration as JSON and sampler tables; SI unless a key says otherwise."""

from typing import Any

import numpy as np

from catseye.constants import DEGREE, SECONDS_PER_DAY, ZERO_CELSIUS_K
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable
from catseye.geometry.antenna.deformation import COMPONENTS
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.series import Prediction, StructureFit
from catseye.reduction.structure.vibration import Vibration
from catseye.verdict import Verdict

FORMAT = "catseye-structure-1"
PSD = "m2 / Hz"


def structure_object(
    fit: StructureFit,
    check: LeaveOut | None,
    predicted: Prediction | None,
    *,
    asked: dict[str, Any],
    notes: tuple[str, ...],
    verdict: Verdict,
) -> dict[str, Any]:
    """Object that `catseye structure --json` prints.

    fit         the model
    check       cross-validation, if requested
    predicted   prediction, if requested
    asked       elevation_deg, temperature_c and way of the prediction
    notes       for the reader
    verdict     from `reduction.structure.verdict.structure_verdict`
    """
    six, covariance = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, 6).T
    series, motion = fit.series, fit.fit
    rms = np.sqrt(np.nanmean(motion.residual**2, axis=(0, 2)))
    return {
        "verdict": verdict.to_object(),
        "group": series.group,
        "frame": series.frame,
        "pivot": series.pivot,
        "epochs": len(series),
        "elevation_deg": [float(f(series.posture.elevation) / DEGREE) for f in (np.min, np.max)],
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
        "prediction": None if predicted is None else _prediction(predicted, asked),
        "notes": list(notes),
    }


def _range(values: Any) -> list[float]:
    return [float(np.min(values)), float(np.max(values))]


def _check(check: LeaveOut) -> dict[str, Any]:
    inside = ~check.extrapolated
    ratios = check.normalised
    return {
        "rms": check.rms,
        "ratio": check.ratio,
        "ratio_inside": float(np.sqrt(np.nanmean(ratios[inside]) / 3.0)) if inside.any() else float("nan"),
        "folds": int(check.fold.max()) + 1,
        "extrapolated_epochs": int(check.extrapolated.sum()),
    }


def _prediction(predicted: Prediction, request: dict[str, Any]) -> dict[str, Any]:
    return {
        **request,
        "points": {
            name: {"place": predicted.place[:, i], "covariance": predicted.covariance[:, i]}
            for i, name in enumerate(predicted.names)
        },
        "six": predicted.six,
        "six_covariance": predicted.six_covariance,
        "outside": predicted.outside,
    }


def structure_samplers(
    fit: StructureFit, check: LeaveOut | None, predicted: Prediction | None, *, request: dict[str, Any]
) -> dict[str, SamplerTable]:
    """Tables of a fit for FITS: residuals, coefficients, prediction."""
    series = fit.series
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
                "ELEVATION": SamplerColumn("deg", np.array(request["elevation_deg"], dtype=float)[k], "requested"),
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
