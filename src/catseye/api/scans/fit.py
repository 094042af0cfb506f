"""`fit_scan`: measured scans over a retroreflector to its spot."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.scans.tabled import TabledResult
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from catseye.gateways.scans.files import Sources
    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.reduction.scans.scan import ScanFit, ScanPointing


@dataclass(frozen=True, eq=False, repr=False)
class ScanResult(TabledResult):
    """Spots of one or several scans over a retroreflector.

    counts       (2,) azimuth and elevation of its centre; nan for an axis that no scan varied
    covariance   (2, 2) counts²
    fits         each scan: parameters, covariance, residuals
    pointing     what `counts` comes from
    """

    COMMAND = "scan fit"
    counts: np.ndarray
    covariance: np.ndarray
    fits: "tuple[ScanFit, ...]"
    pointing: "ScanPointing"

    def passages(self) -> "Sequence[Passage]":
        """Where the retroreflector is, and each scan."""
        from catseye.gateways.scans.scan_objects import scans_passages

        return scans_passages(self.fits, self.pointing)

    def rows(self) -> Iterator[str]:
        """Lines of the terminal: a row a scan."""
        from catseye.gateways.scans.scan_objects import scan_rows

        return scan_rows(self.fits)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye scan fit --json`."""
        from catseye.gateways.scans.scan_objects import scans_object

        return scans_object(self.fits, self.pointing, self.verdict)

    def _sources(self) -> "Sources":
        from catseye.gateways.scans.tables import READINGS, SCANS

        return {SCANS: self.fits, READINGS: self.fits}

    def figures(self) -> "dict[str, Figure]":
        """Each scan with its spot, under the stem of its file."""
        from catseye.gateways.scans.scan_figures import scan_figures

        return scan_figures(self.fits)


@with_units
def fit_scan(
    scans: "str | os.PathLike[str] | Sequence[str | os.PathLike[str]]",
    *,
    mirror: "str | os.PathLike[str] | MirrorGeometry",
    noise_volt: Annotated[Any, In("V", one=True)] = 0.02,
    scintillation_percent: Annotated[Any, In("percent", one=True)] = 2.0,
    full_scale_volt: Annotated[Any, In("V", one=True)] = 10.0,
) -> ScanResult:
    """Spots of measured scans over one retroreflector: centre, radius, peak, background.

    scans                   SCAN.csv, or several: azimuth scan, elevation scan, rasters
    mirror                  record of the ranger's mirror, for na0 and ne0
    noise_volt              standard uncertainty of one amplitude without light, V
    scintillation_percent   relative standard uncertainty of one amplitude, of air and laser
    full_scale_volt         of the converter; a scan with an amplitude at it is refused

    Raises InputError for an unusable file, ArgumentError for invalid arguments, EstimationError for a scan at full
    scale, without light, or with its spot at the edge.

    >>> result = fit_scan(["scans/azimuth.csv", "scans/elevation.csv"], mirror="night-01/mirrors/ZP103.toml")
    >>> result.verdict.word, result.counts.round(1).tolist()
    ('good', [20000.3, 9000.5])
    """
    from catseye.api.result import digest_of
    from catseye.records.files.reading import read_record
    from catseye.records.laboratory.scan_table import read_scan
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.reduction.scans.scan import fit_scan_readings, pointing_of, pointing_verdict
    from catseye.reduction.steering.spot_fit import SearchHead

    for name, value in (("noise_volt", noise_volt), ("full_scale_volt", full_scale_volt)):
        if not 0.0 < value < np.inf:
            raise ArgumentError(f"{name} = {value:g} V is not above 0", name)
    if not 0.0 <= scintillation_percent <= 100.0:
        problem = f"scintillation_percent = {scintillation_percent:g} is not 0 to 100"
        raise ArgumentError(problem, "scintillation_percent")
    listed = [scans] if isinstance(scans, str | os.PathLike) else list(scans)
    if not listed:
        raise ArgumentError("scans has no file (expected one or more)", "scans")
    read = [place_of(item) for item in listed]
    readings = [read_scan(path) for path in read]
    hashes = {str(path): item.digest for path, item in zip(read, readings, strict=True)}
    if not isinstance(mirror, MirrorGeometry):
        read.append(place_of(mirror))
        hashes[str(read[-1])] = digest_of(read[-1])
        mirror = read_record(read[-1], MirrorGeometry)
    head = SearchHead(
        (float(mirror.na0), float(mirror.ne0)),
        (float(mirror.az_low_limit), float(mirror.az_high_limit)),
        radius=1e-4,  # replaced by the scan's own
        threshold_volt=0.5 * full_scale_volt,
        noise_volt=noise_volt,
        full_scale_volt=full_scale_volt,
        scintillation=0.01 * scintillation_percent,
    )
    fits = tuple(fit_scan_readings(item, head) for item in readings)
    pointing = pointing_of(fits)
    return ScanResult(
        verdict=pointing_verdict(fits, pointing),
        counts=pointing.counts,
        covariance=pointing.covariance,
        fits=fits,
        pointing=pointing,
        hashes=hashes,
        read=tuple(read),
    )
