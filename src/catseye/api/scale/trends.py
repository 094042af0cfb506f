"""`trends`: bodies, instruments and calibrations over the nights of an archive, with alarms."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.trends.alarms import TrendAlarm
    from catseye.reduction.trends.bodies import BodyTrend
    from catseye.reduction.trends.trends import TrendFindings

SUREST = 1e-6  # least false alarm rate: the tails of the noise are not known further


@dataclass(frozen=True, eq=False, repr=False)
class TrendsResult(Result):
    """Trends of an archive.

    found     nights, models, instruments, alarms, notes
    archive   directory that was read
    hashes    SHA-256 of each night's inputs, by night
    """

    found: "TrendFindings"
    archive: Path
    hashes: dict[str, str] = field(default_factory=dict)

    @property
    def alarms(self) -> "tuple[TrendAlarm, ...]":
        """Alarms, the worst first; lengths in m, drifts a year."""
        return self.found.alarms

    def body(self, name: str) -> "BodyTrend":
        """Model of a body; InputError for a name that has none."""
        for body in self.found.bodies:
            if body.name == name:
                return body
        listed = ", ".join(body.name for body in self.found.bodies) or "none"
        raise InputError(f"body {name!r} has no model (expected one of {listed})")

    @with_units
    def predict(
        self,
        body: str,
        *,
        elevation_deg: Annotated[Any, In("deg", one=True)],
        temperature_c: Annotated[Any, In("deg_C", one=True)],
        mjd: Annotated[Any, In("mjd", one=True)],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, 3) m of a body's points in its frame, with covariance (n, 3, 3) m², by its model.

        body            name
        elevation_deg   degrees
        temperature_c   degrees C
        mjd             days
        """
        return self.body(body).predict(np.radians(elevation_deg), temperature_c, mjd)

    def passages(self) -> "Sequence[Passage]":
        """Nights, bodies, alarms, notes."""
        from catseye.gateways.trends.objects import trend_passages

        return trend_passages(self.found)

    def rows(self) -> list[str]:
        """Lines of a terminal: motion of each body by each function, with u."""
        from catseye.gateways.trends.objects import motion_lines

        lines = []
        for body in self.found.bodies:
            if body.motion is not None:
                lines += [f"{body.name}, per unit of", *motion_lines(body.motion, body.functions)]
        return lines

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye trends --json`."""
        from catseye.gateways.trends.objects import trends_object

        return trends_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """`alarms`, `coefficients` by body and function, `points` with their drifts, `instruments`, `series`."""
        return {
            "alarms": self._alarms(),
            "coefficients": self._coefficients(),
            "points": self._points(),
            "instruments": self._instruments(),
        }

    def _alarms(self) -> "QTable":
        from catseye.gateways.trends.objects import alarm_text

        alarms = self.found.alarms
        columns = {
            "severity": ([a.severity.value for a in alarms], ""),
            "kind": ([a.kind.value for a in alarms], ""),
            "quantity": ([a.quantity.value for a in alarms], ""),
            "subject": ([a.subject for a in alarms], ""),
            "part": ([a.part for a in alarms], ""),
            "mjd": (np.array([a.mjd for a in alarms]), "d"),
            "value": (np.array([a.value for a in alarms]), ""),
            "u": (np.array([a.u for a in alarms]), ""),
            "limit": (np.array([a.limit for a in alarms]), ""),
            "probability": (np.array([a.probability for a in alarms]), ""),
            "count": (np.array([a.count for a in alarms], dtype=int), ""),
            "text": ([alarm_text(a) for a in alarms], ""),
        }
        return quantities(columns, note="value, u, limit: m, degrees C or the parameter's unit; drifts a year")

    def _coefficients(self) -> "QTable":
        """A row a body or pose and function."""
        motions = [(b.name, "points", b.functions, b.motion) for b in self.found.bodies if b.motion is not None]
        motions += [(p.poses.body, "pose", p.functions, p.motion) for p in self.found.poses]
        names: list[str] = []
        sources: list[str] = []
        functions: list[str] = []
        values, us = [], []
        for name, source, own, motion in motions:
            names += [name] * len(own.names)
            sources += [source] * len(own.names)
            functions += own.names
            values.append(motion.coefficients)
            us.append(np.sqrt(np.maximum(np.diag(motion.coefficient_covariance), 0.0)).reshape(-1, 6))
        six, u = (np.concatenate(v) if v else np.zeros((0, 6)) for v in (values, us))
        scales = [(f"shift_{axis}", MILLIMETRE, "mm") for axis in "xyz"]
        scales += [(f"turn_{axis}", ARCSECOND, "arcsec") for axis in "xyz"]
        return quantities(
            {
                "body": (names, ""),
                "source": (sources, ""),
                "function": (functions, ""),
                **{name: (six[:, c] / scale, unit) for c, (name, scale, unit) in enumerate(scales)},
                **{f"u_{name}": (u[:, c] / scale, unit) for c, (name, scale, unit) in enumerate(scales)},
            }
        )

    def _points(self) -> "QTable":
        """Points with drifts, a row a point."""
        from catseye.reduction.trends.instruments import drift_probability

        bodies = self.found.bodies
        rates = [drift_probability(body.own.fit, body.functions) for body in bodies]
        rate = np.concatenate([r[0] for r in rates]) if rates else np.zeros((0, 3))
        covariance = np.concatenate([r[1] for r in rates]) if rates else np.zeros((0, 3, 3))
        place = np.concatenate([body.place for body in bodies]) if bodies else np.zeros((0, 3))
        night = np.concatenate([body.night_u for body in bodies]) if bodies else np.zeros((0, 3))
        u = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
        columns: dict[str, tuple[Any, str]] = {
            "body": ([body.name for body in bodies for _ in body.points.names], ""),
            "frame": ([body.frame for body in bodies for _ in body.points.names], ""),
            "point": ([name for body in bodies for name in body.points.names], ""),
        }
        for c, axis in enumerate("xyz"):
            columns[axis] = (place[:, c], "m")
            columns[f"drift_{axis}"] = (rate[:, c] / MILLIMETRE, "mm / yr")
            columns[f"u_drift_{axis}"] = (u[:, c] / MILLIMETRE, "mm / yr")
            columns[f"u_night_{axis}"] = (night[:, c] / MILLIMETRE, "mm")
        return quantities(columns)

    def _instruments(self) -> "QTable":
        """A row an instrument and quantity; SI units, degrees C, drifts a year."""
        from catseye.reduction.trends.instruments import drift_probability

        rows: list[tuple[Any, ...]] = []
        for quantity, trend in self.found.instruments:
            rate, covariance, _ = drift_probability(trend.found.fit, trend.functions)
            for i, subject in enumerate(trend.subjects):
                latest, u = trend.latest(i)
                u_rate = float(np.sqrt(max(covariance[i, 0, 0], 0.0))) if np.isfinite(covariance[i, 0, 0]) else np.nan
                named = (quantity.value, trend.parameter, subject)
                rows.append((*named, latest, u, rate[i, 0], u_rate, trend.prior[i], trend.u_prior[i]))
        heads = ("quantity", "parameter", "instrument", "latest", "u_latest", "drift", "u_drift", "prior", "u_prior")
        values = list(zip(*rows, strict=True)) or [()] * len(heads)
        return quantities(
            {
                h: (np.array(v, dtype=str if k < 3 else float), "")
                for k, (h, v) in enumerate(zip(heads, values, strict=True))
            }
        )

    def figures(self) -> "dict[str, Figure]":
        """Alarms in time, series that changed, motion of each body, uncertainty of a night."""
        from catseye.gateways.trends.figures import alarm_figure, motion_figure, noise_figure, series_figure
        from catseye.reduction.trends.drawn import drawn_series

        series = drawn_series(self.found, self.found.alarms)
        made = {"alarms": alarm_figure(self.found), "noise": noise_figure(self.found)}
        if series:
            made["series"] = series_figure(series)
        for k, body in enumerate(self.found.bodies):
            if body.motion is not None:
                made[f"motion_{k + 1}"] = motion_figure(body)
        return {name: figure for name, figure in made.items() if figure is not None}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.trends.report import trends_report

        return trends_report(self.found, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write report, tables as CSV, figures and JSON into an empty directory."""
        from catseye.gateways.writers.report_page import report_page

        self.write_files(directory, progress, {"report.html": lambda now: report_page(self._report(now))})

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each night's inputs."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Directory of the archive that was read."""
        return (self.archive,)


@with_units
def trends(
    directory: "str | os.PathLike[str]",
    *,
    bodies: str | Sequence[str] | None = None,
    since: Annotated[Any, In("", one=True)] = None,
    until: Annotated[Any, In("", one=True)] = None,
    harmonics: Annotated[Any, In("", whole=True)] = 1,
    annual: bool = True,
    false_alarm: Annotated[Any, In("", one=True)] = 0.01,
    progress: Progress | None = None,
) -> TrendsResult:
    """Trends of an archive: structural models, steps, drifts, calibrations that age, with alarms.

    directory     of the archive, by `archive`
    bodies        kinds of points or bodies with a pose, or patterns such as "dish*"; None for all
    since, until  Modified Julian Dates, UTC, the last excluded; None for no limit
    harmonics     of elevation, 1 or 2
    annual        an annual wave beside temperature, where the nights span a year
    false_alarm   probability that an archive without a change shows a step or drift in any of its series
    progress      called with (what, done, of how many)

    Raises InputError for an archive that has fewer than two nights or is damaged, and without its extra `scale`.
    """
    from catseye.records.archive.reading import open_archive
    from catseye.reduction.trends.trends import TrendRequest, find_trends

    if harmonics not in (1, 2):
        raise ArgumentError(f"harmonics = {harmonics} (expected 1 or 2)", "harmonics")
    if not SUREST <= false_alarm <= 0.5:
        raise ArgumentError(f"false_alarm = {false_alarm:g} (expected {SUREST:g} to 0.5)", "false_alarm")
    if since is not None and until is not None and not since < until:
        raise ArgumentError(f"since {since:g} is not before until {until:g} (expected two times)", "since", "until")
    where = Path(directory)
    folder = open_archive(where)
    request = TrendRequest(
        bodies=[bodies] if isinstance(bodies, str) else bodies,
        since=since,
        until=until,
        harmonics=harmonics,
        annual=annual,
        false_alarm=false_alarm,
    )
    found = find_trends(folder, request, progress=progress)
    hashes = {name: folder.entries[name].inputs_sha256 for name in found.nights.night.tolist()}
    return TrendsResult(verdict=found.verdict, found=found, archive=where, hashes=hashes)
