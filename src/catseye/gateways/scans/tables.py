"""Tables of fitted scans."""

from collections.abc import Callable
from typing import Any

import numpy as np

from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.scans.scan import ScanFit

PAGE = "scans.md"
Fits = tuple[ScanFit, ...]


def _value(k: int, scale: float = 1.0) -> Callable[[Fits], list[Any]]:
    """Parameter of each scan; None of an axis that was not scanned."""
    return lambda fits: [scale * fit.values[k] if fit.covariance[k, k] > 0.0 else None for fit in fits]


def _u(k: int, scale: float = 1.0) -> Callable[[Fits], list[Any]]:
    return lambda fits: [scale * fit.u[k] if fit.covariance[k, k] > 0.0 else None for fit in fits]


SCANS = Table[Fits](
    "scans.csv",
    PAGE,
    (
        Column("scan", "", "file of the scan", each(lambda fit: fit.readings.name)),
        Column("axes", "", "axes that it varied: azimuth, elevation, both", each(lambda fit: fit.axes)),
        Column("azimuth_counts", "", "centre of the spot; empty if not scanned", _value(0), ".4f"),
        Column("u_azimuth_counts", "", "its standard uncertainty", _u(0), ".4f"),
        Column("elevation_counts", "", "centre of the spot; empty if not scanned", _value(1), ".4f"),
        Column("u_elevation_counts", "", "its standard uncertainty", _u(1), ".4f"),
        Column("radius_mrad", "mrad", "radius at 1/e² of the peak, on the sky", _value(2, 1e3), ".6f"),
        Column("u_radius_mrad", "mrad", "its standard uncertainty", _u(2, 1e3), ".6f"),
        Column("width_mrad", "mrad", "full width at half of the peak", each(lambda fit: 1e3 * fit.width), ".6f"),
        Column("peak_v", "V", "amplitude of the centre above the background", _value(3), ".5f"),
        Column("u_peak_v", "V", "its standard uncertainty", _u(3), ".5f"),
        Column("background_v", "V", "amplitude beside the spot", _value(4), ".5f"),
        Column("u_background_v", "V", "its standard uncertainty", _u(4), ".5f"),
        Column("flatness", "", "1 a Gaussian, more a flat top", _value(5), ".3f"),
        Column("variance_factor", "", "of the readings that decide", each(lambda fit: fit.variance_factor), ".3f"),
    ),
)


def _joined(value: Callable[[ScanFit], np.ndarray]) -> Callable[[Fits], np.ndarray]:
    return lambda fits: np.concatenate([value(fit) for fit in fits])


READINGS = Table[Fits](
    "readings.csv",
    PAGE,
    (
        Column(
            "scan", "", "file of the scan", lambda fits: [f.readings.name for f in fits for _ in range(len(f.readings))]
        ),
        Column("azimuth_counts", "", "as read", _joined(lambda fit: fit.readings.counts[:, 0]), ".3f"),
        Column("elevation_counts", "", "as read", _joined(lambda fit: fit.readings.counts[:, 1]), ".3f"),
        Column("amplitude_v", "V", "as read", _joined(lambda fit: fit.readings.amplitude), ".5f"),
        Column("predicted_v", "V", "amplitude of the fitted spot", _joined(lambda fit: fit.predicted), ".5f"),
        Column("u_v", "V", "standard uncertainty of the reading", _joined(lambda fit: fit.sigma), ".5f"),
    ),
)
