"""Pointing series with covariance as a TOML file: catseye-pointing-series-1."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import ARCSECOND
from catseye.geometry.antenna.pointing_series import TERMS, PointingSeries, published
from catseye.records.files.reading import Folder, read_record
from catseye.records.files.record import Certificate, Within, broken_rule
from catseye.verdict import Verdict, Word

FORMAT = "catseye-pointing-series-1"
PUBLISHED = "published"  # name of the published series
SYMMETRY = 1e-6  # of two standard uncertainties' product: files carry ten digits
Term = Literal["IA", "IE", "CA", "NPAE", "AW", "AN", "HZCZ", "HZSZ"]
Row = Annotated[tuple[float, ...], Field(strict=False)]
Coefficient = Annotated[float, Within(-36_000, 36_000)]  # arcsec: ten degrees


class PointingModel(Certificate):
    """Complete file of a pointing series.

    terms               unique names of the coefficients
    values_arcsec       values of the terms, in the same order
    covariance_arcsec2  rows in the same order; none if unknown
    sky_rms_arcsec      rms residual of the fit on the sky, if any
    verdict, why        verdict of the fit if not good, and then of predictions
    name                name of the series
    """

    format: Literal["catseye-pointing-series-1"]
    name: str = Field(min_length=1, max_length=200)
    terms: Annotated[tuple[Term, ...], Field(strict=False, min_length=1)]
    values_arcsec: Annotated[tuple[Coefficient, ...], Field(strict=False)]
    covariance_arcsec2: Annotated[tuple[Row, ...], Field(strict=False)] | None = None
    sky_rms_arcsec: Annotated[float, Within(0, 36_000)] | None = None
    verdict: Word | None = None
    why: str = ""

    @model_validator(mode="after")
    def _fits_together(self) -> "PointingModel":
        k = len(self.terms)
        if len(set(self.terms)) != k:
            raise broken_rule(f"terms = {list(self.terms)} names one twice (expected each of {', '.join(TERMS)} once)")
        if len(self.values_arcsec) != k:
            raise broken_rule(f"values_arcsec has {len(self.values_arcsec)} values (expected {k}, as terms)")
        if self.covariance_arcsec2 is not None:
            _refuse_covariance(self.covariance_arcsec2, k)
        return self

    @property
    def judged(self) -> Verdict | None:
        """Verdict of the fit; None if the file has none."""
        return None if self.verdict is None else Verdict(self.verdict, self.why)

    @property
    def series(self) -> PointingSeries:
        """Series in radians; a missing covariance is zero."""
        k, values = len(self.terms), np.array(self.values_arcsec) * ARCSECOND
        stored = self.covariance_arcsec2
        q = np.zeros((k, k)) if stored is None else np.array(stored) * ARCSECOND**2
        return PointingSeries(tuple(self.terms), values, q)


@dataclass(frozen=True, eq=False)
class NamedSeries:
    """Pointing series with its origin.

    name      "published", or the model's file or name
    verdict   verdict of the fit; None where unknown
    hashes    SHA-256 of the file by its name; none without a file
    """

    name: str
    series: PointingSeries
    verdict: Verdict | None = None
    hashes: dict[str, str] = field(default_factory=dict)


def read_series(model: Path | str) -> NamedSeries:
    """Pointing series of a model's TOML file, or "published"."""
    if str(model) == PUBLISHED:
        return NamedSeries(PUBLISHED, published())
    path = Path(model)
    folder = Folder(path.parent)
    record = folder.record(path.name, PointingModel) if path.suffix == ".toml" else read_record(path, PointingModel)
    return NamedSeries(str(model), record.series, record.judged, dict(folder.hashes))


def _refuse_covariance(rows: tuple[tuple[float, ...], ...], k: int) -> None:
    if len(rows) != k or any(len(row) != k for row in rows):
        raise broken_rule(f"covariance_arcsec2 has {len(rows)} rows (expected {k} of {k} numbers, as terms)")
    q = np.array(rows)
    variance = np.diag(q)
    if np.any(variance < 0.0):
        raise broken_rule(f"covariance_arcsec2 has the variance {variance.min()} (expected 0 or more)")
    scale = np.sqrt(np.maximum(np.outer(variance, variance), 1e-300))
    if np.any(np.abs(q - q.T) > SYMMETRY * scale) or np.linalg.eigvalsh(q / scale)[0] < -SYMMETRY * k:
        raise broken_rule("covariance_arcsec2 is not a covariance (expected symmetric, without negative eigenvalues)")
