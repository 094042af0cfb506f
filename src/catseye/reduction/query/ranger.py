"""Zero of a ranger and its other parameters over the nights, and their drift."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from catseye.estimation.series.line import LineFit, fit_line, without_prior
from catseye.names import counted
from catseye.reduction.query.span import ArchiveSpan
from catseye.verdict import Verdict

ZERO = "zero"
SHEET = ("night", "mjd", "instrument", "value")  # columns of certificates
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
    head              (n,) mirror and head that the ranger had; "" where the archive does not say
    night, mjd        (n,)
    value, u          (n,) estimate of the night, its calibration included; zeros count from the D0 of the last night's
                      sheet, so that a new sheet is a step of the prior and none of the head
    u_adjusted        (n,) u without the errors common to all heads; nan where it is not known
    prior, u_prior    (n,) calibration
    temperature_c     (n,) of the air
    """

    ranger: str
    verdict: Verdict
    parameter: np.ndarray
    head: np.ndarray
    night: np.ndarray
    mjd: np.ndarray
    value: np.ndarray
    u: np.ndarray
    u_adjusted: np.ndarray
    prior: np.ndarray
    u_prior: np.ndarray
    temperature_c: np.ndarray

    @cached_property
    def own(self) -> tuple[np.ndarray, np.ndarray]:
        """Value and standard uncertainty (n,) by the night's observations alone; nan where they say nothing."""
        u = np.where(np.isfinite(self.u_adjusted), self.u_adjusted, self.u)
        return without_prior(self.value, u, self.prior, self.u_prior)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, the zero first."""
        return tuple(sorted(set(self.parameter.tolist()), key=lambda name: (name != ZERO, name)))

    @cached_property
    def drifts(self) -> tuple[Drift, ...]:
        """Drift of each parameter."""
        return tuple(self._drift(name) for name in self.parameters)

    def rows_of(self, parameter: str) -> np.ndarray:
        """Rows of a parameter, in order of time."""
        return np.flatnonzero(self.parameter == parameter)

    def _drift(self, parameter: str) -> Drift:
        """Drift by the nights with the head of the last one: another head is another instrument."""
        rows = self.rows_of(parameter)
        rows = rows[self.head[rows] == self.head[rows[-1]]]
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
    columns = ("parameter", "night", "mjd", "value", "u", "u_adjusted", "prior", "u_prior", "temperature_c")
    rows = span.table("zeros", *columns, ranger=ranger)
    if not len(rows["night"]):
        span.refuse_empty("zeros", "ranger", ranger)
    heads, d0 = _sheets(span, ranger, rows["night"])
    for name in ("value", "prior"):
        rows[name] = np.where(rows["parameter"] == ZERO, rows[name] + d0, rows[name])
    nights = set(rows["night"].tolist())
    good = f"{counted(len(nights), 'night')}, all of them good"
    return RangerSeries(ranger=ranger, verdict=span.verdict(nights, good), head=heads, **rows)


def _sheets(span: ArchiveSpan, ranger: str, nights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Head of each row's night, and its D0 less that of the last night, m; 0 where no sheet states one."""
    return sheet_steps(span.table("certificates", *SHEET, ranger=ranger, kind="mirror"), nights)


def sheet_steps(sheets: Mapping[str, np.ndarray], nights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Head of each row's night, and its D0 less that of the last night, m; 0 where no sheet states one.

    sheets   columns `SHEET` of the mirrors that one ranger had
    nights   (n,)
    """
    if not len(sheets["night"]):
        return np.full(len(nights), ""), np.zeros(len(nights))
    last = int(np.argmax(sheets["mjd"]))
    of = dict(
        zip(
            sheets["night"].tolist(),
            zip(sheets["instrument"].tolist(), sheets["value"].tolist(), strict=True),
            strict=True,
        )
    )
    named = [of.get(night, ("", float("nan"))) for night in nights.tolist()]
    steps = np.array([d0 for _, d0 in named]) - sheets["value"][last]
    return np.array([head for head, _ in named]), steps if np.isfinite(sheets["value"]).all() else np.zeros(len(nights))
