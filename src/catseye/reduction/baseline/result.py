"""Result of a baseline's calibration: pillars, distances, instrument, tests, verdict."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import PPM
from catseye.estimation.baseline.adjustment import BaselineSolution
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.records.laboratory.baseline import Baseline, BaselineShots
from catseye.reduction.baseline.lengths import Lengths
from catseye.reduction.baseline.settings import BaselineSettings
from catseye.reduction.baseline.statistical_tests import SuspectShot
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.verdict import Verdict


class Span(NamedTuple):
    """Straight-line distance between two pillars with its standard uncertainty, m."""

    start: str
    end: str
    distance: float
    u: float


class Pillar(NamedTuple):
    """Place of a pillar, with standard uncertainties; all m.

    x, y     along the line from the first pillar, and to its left
    height   None: unknown
    """

    x: float
    y: float
    u_x: float
    u_y: float
    height: float | None


class CyclicTerm(NamedTuple):
    """Cyclic term of an order, m, with standard uncertainties."""

    order: int
    cosine: float
    u_cosine: float
    sine: float
    u_sine: float
    amplitude: float


@dataclass(frozen=True, eq=False)
class BaselineCalibration:
    """Result of a baseline's calibration: pillars, instrument, tests.

    observations   as read
    settings       assumptions
    names          of the pillars, by their numbers
    heights        (n,) m, or None
    reference_height   m, or None
    lengths        of all shots
    keep           (m,) the shots used
    solution       of those
    test           the full test procedure with the sets' means, or the reason against it
    all_shots      the same with each shot as a single distance: its s is comparable with other sheets
    against        the known baseline, or None
    decisions      tests
    suspects       shots and sets rejected by the tests
    rejected       (m,) reason that a shot was left out, "" for the others
    cyclic         names of the cyclic terms; empty where left out
    weather        share of the weather's changes in the measured lengths, and its u: 1 expected
    notes          for the user
    """

    observations: BaselineShots
    settings: BaselineSettings
    names: tuple[str, ...]
    heights: np.ndarray | None
    reference_height: float | None
    lengths: Lengths
    keep: np.ndarray
    solution: BaselineSolution
    test: FullTest | str
    all_shots: FullTest | None
    against: Baseline | None
    decisions: tuple[CheckOutcome, ...]
    suspects: tuple[SuspectShot, ...]
    rejected: tuple[str, ...]
    cyclic: tuple[str, ...]
    weather: tuple[float, float]
    notes: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict from the tests of ISO 17123-4, shots and humidities."""
        return self._tests().hearing(humidity_doubts(self.observations.humidity_percent))

    def _tests(self) -> Verdict:
        """Verdict from the tests alone."""
        failed = [d.name for d in self.decisions if d.passed is False]
        if failed:
            return Verdict("failed", f"tests failed: {'; '.join(failed)}")
        if self.suspects:
            first = self.suspects[0]
            shot = f"{first.kind} of row {', '.join(str(r + 1) for r in first.rows[:4])} (w {first.w:.1f})"
            return Verdict("doubtful", f"{len(self.suspects)} suspect shots, first {shot}")
        if not isinstance(self.test, FullTest):
            return Verdict("doubtful", f"ISO 17123-4's full test was not possible: {self.test}")
        passed = sum(d.passed is True for d in self.decisions)
        return Verdict("good", f"every possible test passed ({passed})")

    @property
    def order(self) -> np.ndarray:
        """Numbers (n,) of the pillars along the line."""
        return np.argsort(self.solution.x, kind="stable")

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """Distances of all pairs of pillars along the line, with full covariance."""
        s, n = self.solution, len(self.names)
        rows, covariance = s.places
        spans = []
        for i, j in combinations(self.order.tolist(), 2):
            dx, dy = s.x[j] - s.x[i], s.y[j] - s.y[i]
            d = float(np.hypot(dx, dy))
            slope = np.zeros(2 * n)
            slope[[i, j, n + i, n + j]] = np.array([-dx, dx, -dy, dy]) / d
            g = slope[rows]
            spans.append(Span(self.names[i], self.names[j], d, float(np.sqrt(g @ covariance @ g))))
        return tuple(spans)

    @property
    def pillars(self) -> dict[str, Pillar]:
        """Places of the pillars along the line, by name."""
        s = self.solution
        rows, covariance = s.places
        n = len(self.names)
        u = np.zeros(2 * n)
        u[rows] = np.sqrt(np.diag(covariance))
        return {
            self.names[i]: Pillar(s.x[i], s.y[i], u[i], u[n + i], None if self.heights is None else self.heights[i])
            for i in self.order
        }

    @property
    def shot_residuals(self) -> np.ndarray:
        """Observed minus adjusted of every shot, (m,) m; nan for excluded shots."""
        used = self.solution.used
        residual = np.full(len(self.keep), np.nan)
        residual[self.keep] = self.solution.residual[used.set] + used.within
        return residual

    @property
    def correlation(self) -> float:
        """Correlation coefficient of zero and scale; nan without a scale."""
        s = self.solution
        if "scale" not in s.names:
            return float("nan")
        i, j = s.names.index("zero"), s.names.index("scale")
        return float(s.covariance[i, j] / np.sqrt(s.covariance[i, i] * s.covariance[j, j]))

    @property
    def cyclic_terms(self) -> tuple[CyclicTerm, ...]:
        """Cyclic terms by order; none where they were left out."""
        terms = []
        for order in range(1, len(self.cyclic) // 2 + 1):
            (c, u_c), (s, u_s) = (self.solution.of(f"cyclic {f} {order}") for f in ("cosine", "sine"))
            terms.append(
                CyclicTerm(order=order, cosine=c, u_cosine=u_c, sine=s, u_sine=u_s, amplitude=float(np.hypot(c, s)))
            )
        return tuple(terms)

    @property
    def noise(self) -> dict[str, float | None]:
        """Standard deviations (m; air: ppm) and their standard uncertainties, by first-order propagation."""
        noise, u = self.solution.noise, self.solution.u_noise
        parts: dict[str, float | None] = {}
        for k, (key, variance, unit) in enumerate(
            (("shot", noise.shot, 1.0), ("set", noise.set, 1.0), ("air_ppm", noise.air, PPM))
        ):
            root = float(np.sqrt(variance))
            parts[key] = root / unit
            parts[f"u_{key}"] = float(u[k]) / (2.0 * root) / unit if root > 0.0 else None
        return parts
