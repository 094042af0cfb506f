"""Predicted encoder corrections of a pointing series."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.records.site.pointing_model import NamedSeries
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class PointingPrediction:
    """Corrections of directions (...), on the sky.

    model        name of the series
    azimuth, elevation   (...) rad, on the sky
    correction   (..., 2) rad, azimuth times cos E and elevation: encoders minus sky
    covariance   (..., 2, 2) rad^2; None where the model has none
    encoders     azimuth and elevation (...) rad
    verdict      no better than the model's
    structure    (..., 2) rad, part of the correction by a structural model; None without one
    """

    model: str
    azimuth: np.ndarray
    elevation: np.ndarray
    correction: np.ndarray
    covariance: np.ndarray | None
    encoders: tuple[np.ndarray, np.ndarray]
    verdict: Verdict
    structure: np.ndarray | None = None

    @property
    def u(self) -> np.ndarray | None:
        """Standard uncertainties (..., 2) of the correction, rad."""
        return None if self.covariance is None else np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def predict_pointing(model: NamedSeries, azimuth: ArrayLike, elevation: ArrayLike) -> PointingPrediction:
    """Predict the encoders' corrections for directions on the sky.

    model                series with its origin
    azimuth, elevation   rad, clockwise from north; broadcast

    Raises ValidityError at the zenith.
    """
    series = model.series
    has_covariance = bool(np.any(series.covariance != 0.0))
    a, e = np.broadcast_arrays(np.asarray(azimuth, dtype=float), np.asarray(elevation, dtype=float))
    return PointingPrediction(
        model=model.name,
        azimuth=a,
        elevation=e,
        correction=series.correction(a, e),
        covariance=series.covariance_of_correction(a, e) if has_covariance else None,
        encoders=series.encoders(a, e),
        verdict=Verdict("good", "the series of the model").resting_on({model.name: model.verdict}),
    )


def with_structure(
    prediction: PointingPrediction, correction: np.ndarray, covariance: np.ndarray
) -> PointingPrediction:
    """Prediction with the correction by a structural model added.

    prediction   of directions (...)
    correction   (..., 2) rad, `reduction.structure.beam.BeamOffset.correction` in these postures
    covariance   (..., 2, 2) rad^2; added where the series has a covariance, else u stays unknown
    """
    a, e = prediction.encoders
    return replace(
        prediction,
        correction=prediction.correction + correction,
        covariance=None if prediction.covariance is None else prediction.covariance + covariance,
        encoders=(a + correction[..., 0] / np.cos(prediction.elevation), e + correction[..., 1]),
        structure=correction,
    )
