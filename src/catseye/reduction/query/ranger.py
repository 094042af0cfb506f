"""Zero of a ranger and its other parameters over the nights, and their drift."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from catseye.estimation.series.line import LineFit, fit_line, without_prior
from catseye.reduction.query.span import ArchiveSpan, several
from catseye.verdict import Verdict

ZERO = "zero"
DAYS_PER_YEAR = 365.25  # Julian year
CLEAR = 3.0  # standard uncertainties beyond which a drift is real: 99.7 %


class Drift(NamedTuple):
    """Drift of one parameter by the nights' own observations, without the calibration that they share.

    parameter   as in the archive
    nights      that took part
    line        through them, times in years since `epoch`
    epoch       MJD
    """

    parameter: str
    nights: int
    line: LineFit | None
    epoch: float

    @property
    def rate(self) -> float:
        """Rate a year; nan where the nights show none."""
        return self.line.rate if self.line is not None and np.isfinite(self.line.u_rate) else float("nan")

    @property
    def u_rate(self) -> float:
        """Standard uncertainty of the rate, widened where the nights scatter more than they claim."""
        return self.line.u_rate * self.line.expansion if self.line is not None else float("nan")

    @property
    def is_clear(self) -> bool:
        """True for a rate that stands out from its uncertainty."""
        return bool(abs(self.rate) > CLEAR * self.u_rate)


@dataclass(frozen=True, eq=False)
class RangerSeries:
    """Parameters of a ranger, a row a night and parameter, n rows.

    parameter         (n,) "zero" (m), and others in their own units
    night, mjd        (n,)
    value, u          (n,) estimate of the night, its calibration included
    prior, u_prior    (n,) calibration
    temperature_c     (n,) of the air
    """

    ranger: str
    verdict: Verdict
    parameter: np.ndarray
    night: np.ndarray
    mjd: np.ndarray
    value: np.ndarray
    u: np.ndarray
    prior: np.ndarray
    u_prior: np.ndarray
    temperature_c: np.ndarray

    @cached_property
    def own(self) -> tuple[np.ndarray, np.ndarray]:
        """Value and standard uncertainty (n,) by the night's observations alone; nan where they say nothing."""
        return without_prior(self.value, self.u, self.prior, self.u_prior)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names, the zero first."""
        return tuple(sorted(set(self.parameter.tolist()), key=lambda name: (name != ZERO, name)))

    @cached_property
    def drifts(self) -> tuple[Drift, ...]:
        """Drift of each parameter."""
        return tuple(self._drift(name) for name in self.parameters)

    def rows_of(self, parameter: str) -> np.ndarray:
        """Rows of a parameter, in order of time."""
        return np.flatnonzero(self.parameter == parameter)

    def _drift(self, parameter: str) -> Drift:
        rows = self.rows_of(parameter)
        values, u = self.own[0][rows], self.own[1][rows]
        known = np.isfinite(values)
        if not known.any():
            return Drift(parameter, 0, None, float("nan"))
        epoch = float(self.mjd[rows][known][0])
        years = (self.mjd[rows][known] - epoch) / DAYS_PER_YEAR
        return Drift(parameter, int(known.sum()), fit_line(years, values[known], u[known]), epoch)


def ranger_series(span: ArchiveSpan, ranger: str) -> RangerSeries:
    """Zero and other parameters of a ranger over the nights.

    Raises InputError: an unknown ranger, a span without a night.
    """
    columns = ("parameter", "night", "mjd", "value", "u", "prior", "u_prior", "temperature_c")
    rows = span.table("zeros", *columns, ranger=ranger)
    if not len(rows["night"]):
        span.refuse_empty("zeros", "ranger", ranger)
    nights = set(rows["night"].tolist())
    good = f"{several(len(nights), 'night')}, all of them good"
    return RangerSeries(ranger=ranger, verdict=span.verdict(nights, good), **rows)
