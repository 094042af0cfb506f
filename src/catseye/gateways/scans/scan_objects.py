"""Fitted scans as JSON and text."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from catseye.gateways.writers.passage import Passage
from catseye.reduction.scans.scan import NAMES, ScanFit, ScanPointing
from catseye.verdict import Verdict


def fit_object(fit: ScanFit) -> dict[str, Any]:
    """One scan: parameters by name with u, their covariance in that order."""
    return {
        "verdict": fit.verdict.to_object(),
        "file": fit.readings.name,
        "axes": fit.axes,
        **{name: float(value) for name, value in zip(NAMES, fit.values, strict=True)},
        **{f"u_{name}": float(value) for name, value in zip(NAMES, fit.u, strict=True)},
        "width": fit.width,
        "covariance": fit.covariance,
        "variance_factor": fit.variance_factor,
        "readings": len(fit.readings),
    }


def scans_object(fits: Sequence[ScanFit], pointing: ScanPointing, verdict: Verdict) -> dict[str, Any]:
    """Object that `catseye scan fit --json` prints."""
    return {
        "verdict": verdict.to_object(),
        "azimuth_counts": pointing.counts[0],
        "elevation_counts": pointing.counts[1],
        "u_azimuth_counts": pointing.u[0],
        "u_elevation_counts": pointing.u[1],
        "pointing_covariance": pointing.covariance,
        "parameters": list(NAMES),
        "scans": [fit_object(fit) for fit in fits],
    }


def scans_passages(fits: Sequence[ScanFit], pointing: ScanPointing) -> list[Passage]:
    """Where the retroreflector is, and each scan."""
    places = [
        f"{axis} {n:.3f} ± {u:.3f}"
        for axis, n, u in zip(("azimuth", "elevation"), pointing.counts, pointing.u, strict=True)
        if np.isfinite(n)
    ]
    return [
        Passage("Retroreflector", f"{', '.join(places)} counts"),
        *(Passage(fit.readings.name, _scan_text(fit)) for fit in fits),
    ]


def _scan_text(fit: ScanFit) -> str:
    radius, peak, background, flatness = fit.values[2:]
    what = "raster of both axes" if fit.axes == "both" else f"{fit.axes} scan"
    return (
        f"{what}, {len(fit.readings)} readings: peak {peak:.3f} ± {fit.u[3]:.3f} V above {background:.3f} ± "
        f"{fit.u[4]:.3f} V, radius at 1/e² {1e3 * radius:.4f} ± {1e3 * fit.u[2]:.4f} mrad, "
        f"{1e3 * fit.width:.4f} mrad wide at half, flatness {flatness:.2f}"
    )


def scan_rows(fits: Sequence[ScanFit]) -> Iterator[str]:
    """Lines of the terminal: a row a scan."""
    yield f"{'':<14}{'scan':<20}{'azimuth':>12}{'u':>8}{'elevation':>12}{'u':>8}{'peak V':>9}{'mrad':>8}"
    for fit in fits:
        scanned = fit.covariance.diagonal()[:2] > 0.0
        cells = "".join(
            f"{n:12.3f}{u:8.3f}" if on else f"{n:12.3f}{'-':>8}"
            for n, u, on in zip(fit.values[:2], fit.u[:2], scanned, strict=True)
        )
        yield f"{'':<14}{fit.readings.name:<20}{cells}{fit.values[3]:9.3f}{1e3 * fit.values[2]:8.4f}"
