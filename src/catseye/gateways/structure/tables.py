"""Tables of a structure's model and of its vibration: coefficients, residuals, prediction, spectra."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.columns import Column, Table
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.series import Prediction, StructureFit
from catseye.reduction.structure.vibration import Vibration

PAGE = "structure.md"


@dataclass(frozen=True, eq=False)
class FunctionRows:
    """Source of coefficients.csv: a row per function of the model."""

    fit: StructureFit

    @cached_property
    def six(self) -> tuple[np.ndarray, np.ndarray]:
        """Shifts and rotations (6, k) with their standard uncertainties; m, rad."""
        six, q = self.fit.six_of()
        return six, np.sqrt(np.maximum(np.diag(q), 0.0)).reshape(-1, 6).T


def _shift(k: int) -> Column[FunctionRows]:
    doc = f"shift of the group along {'xyz'[k]} per unit of the function"
    return Column(f"shift_{'xyz'[k]}_mm", "mm", doc, lambda f: f.six[0][k] / MILLIMETRE, ".6f")


def _turn(k: int) -> Column[FunctionRows]:
    doc = f"rotation of the group about {'xyz'[k]} per unit of the function"
    return Column(f"turn_{'xyz'[k]}_arcsec", "arcsec", doc, lambda f: f.six[0][3 + k] / ARCSECOND, ".6f")


def _u_shift(k: int) -> Column[FunctionRows]:
    doc = f"standard uncertainty of the shift along {'xyz'[k]}"
    return Column(f"u_shift_{'xyz'[k]}_mm", "mm", doc, lambda f: f.six[1][k] / MILLIMETRE, ".6f")


def _u_turn(k: int) -> Column[FunctionRows]:
    doc = f"standard uncertainty of the rotation about {'xyz'[k]}"
    return Column(f"u_turn_{'xyz'[k]}_arcsec", "arcsec", doc, lambda f: f.six[1][3 + k] / ARCSECOND, ".6f")


COEFFICIENTS = Table[FunctionRows](
    "coefficients.csv",
    PAGE,
    (
        Column("function", "", "function of the model, such as `sinE`", lambda f: f.fit.model.functions),
        *(column(k) for column in (_shift, _turn, _u_shift, _u_turn) for k in range(3)),
    ),
)


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """Source of residuals.csv: a row per epoch and point."""

    fit: StructureFit
    check: LeaveOut | None

    @cached_property
    def cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Epochs and points of the rows."""
        epochs, points = np.nonzero(np.isfinite(self.fit.fit.residual).all(axis=2))
        return epochs, points

    @property
    def epoch(self) -> np.ndarray:
        return self.cells[0]


def _residual(k: int) -> Column[ResidualRows]:
    doc = f"measured less model along {'xyz'[k]}"
    return Column(f"residual_{'xyz'[k]}_mm", "mm", doc, lambda r: r.fit.fit.residual[r.cells][:, k] / MILLIMETRE, ".4f")


def _left_out(k: int) -> Column[ResidualRows]:
    doc = f"measured less a model fitted without this epoch, along {'xyz'[k]}; with `--folds`"
    return Column(
        f"left_out_{'xyz'[k]}_mm",
        "mm",
        doc,
        lambda r: None if r.check is None else r.check.residual[r.cells][:, k] / MILLIMETRE,
        ".4f",
    )


def _u_left_out(k: int) -> Column[ResidualRows]:
    return Column(
        f"u_left_out_{'xyz'[k]}_mm",
        "mm",
        f"standard uncertainty of `left_out_{'xyz'[k]}_mm`",
        lambda r: None if r.check is None else np.sqrt(r.check.covariance[r.cells][:, k, k]) / MILLIMETRE,
        ".4f",
    )


RESIDUALS = Table[ResidualRows](
    "residuals.csv",
    PAGE,
    (
        Column(
            "epoch",
            "",
            "directory, or label in the list of epochs",
            lambda r: [r.fit.series.labels[t] for t in r.epoch],
        ),
        Column(
            "mjd_utc",
            "d",
            "time, Modified Julian Date",
            lambda r: np.asarray(r.fit.series.mjd, dtype=float)[r.epoch],
            ".8f",
        ),
        Column(
            "elevation_deg",
            "deg",
            "elevation",
            lambda r: np.asarray(r.fit.series.posture.elevation, dtype=float)[r.epoch] / DEGREE,
            ".6f",
        ),
        Column(
            "temperature_c",
            "deg_C",
            "temperature of the structure",
            lambda r: np.asarray(r.fit.series.posture.temperature_c, dtype=float)[r.epoch],
            ".3f",
        ),
        Column(
            "way",
            "",
            "direction of the elevation axis: +1 rising, -1 falling, 0 unknown",
            lambda r: np.asarray(r.fit.series.way, dtype=float)[r.epoch],
            "+.0f",
        ),
        Column("point", "", "point", lambda r: [r.fit.series.names[p] for p in r.cells[1]]),
        *(column(k) for column in (_residual, _left_out, _u_left_out) for k in range(3)),
    ),
)


@dataclass(frozen=True, eq=False)
class PredictedRows:
    """Source of prediction.csv: a row per elevation and point."""

    predicted: Prediction
    request: Mapping[str, Any]

    @property
    def elevations(self) -> list[float]:
        return self.request["elevation_deg"]


def _place(k: int) -> Column[PredictedRows]:
    doc = f"predicted {'xyz'[k]}"
    return Column(f"{'xyz'[k]}_m", "m", doc, lambda r: r.predicted.place[:, :, k].ravel(), ".7f")


def _u_place(k: int) -> Column[PredictedRows]:
    doc = f"standard uncertainty of {'xyz'[k]}"
    return Column(
        f"u_{'xyz'[k]}_mm", "mm", doc, lambda r: np.sqrt(r.predicted.covariance[:, :, k, k]).ravel() / MILLIMETRE, ".4f"
    )


PREDICTION = Table[PredictedRows](
    "prediction.csv",
    PAGE,
    (
        Column(
            "elevation_deg",
            "deg",
            "elevation",
            lambda r: np.repeat(np.asarray(r.elevations, dtype=float), len(r.predicted.names)),
            ".6f",
        ),
        Column(
            "temperature_c",
            "deg_C",
            "temperature of the structure; empty if none was given",
            lambda r: [r.request["temperature_c"]] * (len(r.elevations) * len(r.predicted.names)),
            ".3f",
        ),
        Column("point", "", "point", lambda r: list(r.predicted.names) * len(r.elevations)),
        *(column(k) for column in (_place, _u_place) for k in range(3)),
    ),
)


@dataclass(frozen=True, eq=False)
class SpectrumRows:
    """Source of spectra.csv: a row per series and frequency."""

    vibration: Vibration

    @property
    def frequency_hz(self) -> np.ndarray:
        return np.asarray(self.vibration.spectrum.frequency_hz)

    @cached_property
    def band(self) -> np.ndarray:
        """Limits of the density, (frequency, series, 2)."""
        return self.vibration.spectrum.interval(0.95)


SPECTRA = Table[SpectrumRows](
    "spectra.csv",
    PAGE,
    (
        Column(
            "series",
            "",
            "line: ranger and target",
            lambda r: [s.name for s in r.vibration.series for _ in r.frequency_hz],
        ),
        Column("frequency_hz", "Hz", "frequency", lambda r: np.tile(r.frequency_hz, len(r.vibration.series)), ".6f"),
        Column(
            "density_m2_per_hz",
            "m2 / Hz",
            "one-sided power spectral density of the range",
            lambda r: r.vibration.spectrum.density.T.ravel(),
            ".6e",
        ),
        Column(
            "low_95_m2_per_hz",
            "m2 / Hz",
            "lower limit of its 95 % interval",
            lambda r: r.band[:, :, 0].T.ravel(),
            ".6e",
        ),
        Column(
            "high_95_m2_per_hz",
            "m2 / Hz",
            "upper limit of its 95 % interval",
            lambda r: r.band[:, :, 1].T.ravel(),
            ".6e",
        ),
    ),
)


def coefficients_csv(fit: StructureFit) -> str:
    """Table of the group's shift and rotation per unit of each function."""
    return COEFFICIENTS.csv(FunctionRows(fit))


def residuals_csv(fit: StructureFit, check: LeaveOut | None) -> str:
    """Table of residuals of every point and epoch, with and without the epoch in the fit."""
    return RESIDUALS.csv(ResidualRows(fit, check))


def prediction_csv(predicted: Prediction, request: Mapping[str, Any]) -> str:
    """Table of predicted points."""
    return PREDICTION.csv(PredictedRows(predicted, request))


def spectra_csv(vibration: Vibration) -> str:
    """Table of densities with their confidence bands."""
    return SPECTRA.csv(SpectrumRows(vibration))
