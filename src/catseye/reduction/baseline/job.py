"""Adjustments of one baseline.

With and without suspects, cyclic terms, the weather, against known pillars.
"""

from dataclasses import replace

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE, PPM, TWO_PI
from catseye.errors import EstimationError
from catseye.estimation.baseline.adjustment import (
    SEPARABLE,
    BaselineNoise,
    BaselineSolution,
    adjust_baseline,
    places_in_line,
    separation,
)
from catseye.estimation.baseline.iso17123 import FullTest, full_test
from catseye.estimation.baseline.model import BaselineSights, Claim, Extra, KnownPlaces
from catseye.records.laboratory.baseline import BaselineShots
from catseye.reduction.baseline.lengths import Lengths
from catseye.reduction.baseline.settings import BaselineSettings
from catseye.reduction.baseline.statistical_tests import SuspectShot, suspects_of


class BaselineJob:
    """Adjustments of one calibration, with variants."""

    def __init__(
        self,
        shots: BaselineShots,
        lengths: Lengths,
        settings: BaselineSettings,
        known: KnownPlaces | None,
        notes: list[str],
    ) -> None:
        """Set up sights and approximate places of the pillars.

        shots      renumbered along the line
        lengths    their horizontal distances
        settings   assumptions
        known      pillars of a known baseline
        notes      for the user; each rejection adds a line
        """
        self.shots, self.lengths, self.settings, self.known, self.notes = shots, lengths, settings, known, notes
        count = len(shots.names)
        u_direction = np.hypot(shots.u_rounding, settings.u_direction_arcsec * ARCSECOND)
        self.sights = BaselineSights(
            start=shots.start,
            end=shots.end,
            set=shots.set,
            setup=shots.setup,
            distance=lengths.distance,
            stretch=lengths.stretch,
            systematic=lengths.systematic,
            effects=lengths.effects,
            direction=shots.direction,
            u_direction=u_direction,
            pillars=shots.names,
        )
        if known is None:
            ends = shots.start.tolist(), shots.end.tolist()
            self.x = places_in_line(*ends, lengths.distance, count=count, names=shots.names)
            self.y = np.zeros(count)
        else:
            self.x, self.y = known.x, known.y

    def solved(self, keep: np.ndarray, *, extra: Extra | None = None, noise: Claim | None = None) -> BaselineSolution:
        """Adjustment of the selected shots (m,).

        With further unknowns, the noise estimated or as an argument.
        """
        part = None if extra is None else Extra(extra.names, extra.columns[keep])
        centring = self.settings.u_centring_mm * MILLIMETRE
        return adjust_baseline(
            self.sights.only(keep),
            self.x,
            self.y,
            known=self.known,
            scale=self.known is not None,
            extra=part,
            before=BaselineNoise(u_centring=centring, noise=noise, claim=self._specified(keep)),
        )

    def _specified(self, keep: np.ndarray) -> Claim:
        """Maker's claim as variances.

        Repeats from their own scatter, or a tenth of the claim.
        """
        sights = self.sights.only(keep)
        a = (self.settings.specified_mm * MILLIMETRE) ** 2
        repeats = len(sights) - len(sights.shots)
        shot = float(np.sum(sights.within**2)) / repeats if repeats else 0.0
        return Claim(max(shot, 0.01 * a), a, (self.settings.specified_ppm * PPM) ** 2)

    def claimed(self, distance: np.ndarray) -> np.ndarray:
        """Standard deviation by the maker's claim, linear in the distance, m."""
        return self.settings.specified_mm * MILLIMETRE + self.settings.specified_ppm * PPM * distance

    def agreement(self, solution: BaselineSolution, cyclic: tuple[str, ...], keep: np.ndarray) -> BaselineSolution:
        """Adjustment of sets to the known pillars.

        A set's variance is the maker's claim; without directions.
        """
        used = solution.used
        shot = max(solution.noise.shot, 1e-16)
        sets = np.maximum(self.claimed(used.mean(used.distance)) ** 2 - shot / used.shots, 1e-16)
        blind = replace(self.sights, direction=np.full(len(self.sights), np.nan))
        terms = self.cyclic_terms(cyclic)
        return adjust_baseline(
            blind.only(keep),
            self.x,
            self.y,
            known=self.known,
            scale=True,
            extra=None if terms is None else Extra(terms.names, terms.columns[keep]),
            before=BaselineNoise(noise=Claim(shot, sets, 0.0)),
        )

    def cleaned(
        self, progress: Progress | None
    ) -> tuple[np.ndarray, tuple[str, ...], tuple[SuspectShot, ...], BaselineSolution]:
        """Used shots (m,), rejection reasons, suspects, and the solution.

        One rejection a step.
        """
        keep = np.ones(len(self.shots), bool)
        rejected = [""] * len(self.shots)
        most = max(1, len(self.shots) // 10)
        for step in range(len(self.shots)):
            if progress is not None:
                progress("adjusting", step, 0)
            solution = self.solved(keep)
            suspects = suspects_of(solution, np.flatnonzero(keep), self.settings.level)
            if not (self.settings.reject and suspects):
                break
            worst = suspects[0]
            if worst.twins:
                rows_text, twins_text = (", ".join(str(r + 1) for r in part) for part in (worst.rows, worst.twins))
                self.notes.append(
                    f"row {rows_text} and row {twins_text} contradict each other, undecided which is wrong: none is "
                    "left out; measure them again"
                )
                break
            if np.sum(~keep) + len(worst.rows) > most:
                self.notes.append(
                    f"no more than {most} of {len(keep)} shots are left out; the other suspects stay: check them"
                )
                break
            for row in worst.rows:
                keep[row] = False
                rejected[row] = f"{worst.kind} rejected: w = {worst.w:+.1f}, p = {worst.p:.2g}"
        return keep, tuple(rejected), suspects, solution

    def cyclic_terms(self, names: tuple[str, ...]) -> Extra | None:
        """Cyclic terms: cos and sin of the displayed length, in unit lengths.

        The effect of a coefficient of 1 m.
        """
        if not names or self.settings.unit_length is None:
            return None
        phase = TWO_PI * self.shots.slope / self.settings.unit_length
        columns = [self.lengths.stretch * f((k + 1) * phase) for k in range(len(names) // 2) for f in (np.cos, np.sin)]
        return Extra(names, np.stack(columns, axis=1))

    def with_cyclic(self, keep: np.ndarray, solution: BaselineSolution) -> tuple[BaselineSolution, tuple[str, ...]]:
        """Solution with cyclic terms and their names.

        Without them where they are inseparable.
        """
        if self.settings.unit_length is None:
            return solution, ()
        names = tuple(f"cyclic {f} {k + 1}" for k in range(self.settings.orders) for f in ("cosine", "sine"))
        terms = self.cyclic_terms(names)
        assert terms is not None
        if solution.freedom_sets < len(names) + 2:
            self.notes.append(
                f"cyclic terms left out: {solution.freedom_sets} redundant sets for {len(names)} further unknowns"
            )
            return solution, ()
        part = Extra(names, terms.columns[keep])
        try:
            apart = separation(solution.used, solution, part, known=self.known, scale=self.known is not None)
        except EstimationError:
            apart = 0.0
        if apart < SEPARABLE:
            self.notes.append(
                f"cyclic terms left out: lengths in units of {self.settings.unit_length:g} m do not separate them from "
                f"the zero and the pillars (separation {apart:.1g}, needed {SEPARABLE:g})"
            )
            return solution, ()
        return self.solved(keep, extra=terms), names

    def full_tests(self, solution: BaselineSolution) -> tuple[FullTest | str, FullTest | None, FullTest | None]:
        """Tests of the standard along the line.

        Offsets of pillars from it are removed first: of the sets' means with equal weights, with the maker's as
        weights, and of all shots.
        """
        used, y = solution.used, solution.y
        touched = np.unique(np.concatenate([used.start, used.end]))
        order = [int(i) for i in np.argsort(solution.x, kind="stable") if i in touched]
        number = np.full(len(y), -1)
        number[touched] = np.arange(len(touched))

        def of(distance: np.ndarray, start: np.ndarray, end: np.ndarray, sigma: np.ndarray | None = None) -> FullTest:
            line = np.sqrt(distance**2 - (y[end] - y[start]) ** 2)
            test = full_test(number[start], number[end], line, order=number[order], sigma=sigma)
            places = np.full(len(y), np.nan)
            places[touched] = test.x
            return replace(test, x=places)

        steep = used.distance - (used.stretch - 1.0) * solution.of("zero")[0]  # its part along the slope
        start, end, mean = used.start[used.first], used.end[used.first], used.mean(steep)
        try:
            all_sights = of(steep, used.start, used.end)
            return of(mean, start, end), of(mean, start, end, self.claimed(mean)), all_sights
        except EstimationError as problem:
            return str(problem), None, None

    def weather(self, keep: np.ndarray, solution: BaselineSolution, cyclic: tuple[str, ...]) -> tuple[float, float]:
        """Share of the correction's changes in the measured lengths.

        1 - b, where b of them remains in the distances.

        The correction makes -D (n - mean n) of a change of n; lengths corrected in the field get it twice, b = 1.
        """
        index = self.lengths.index
        column = -(self.lengths.stretch**2) * self.lengths.distance * (index - index[keep].mean())
        terms = self.cyclic_terms(cyclic)
        names = (*(terms.names if terms is not None else ()), "weather")
        columns = column[:, None] if terms is None else np.concatenate([terms.columns, column[:, None]], axis=1)
        if solution.freedom_sets < 6 or np.ptp(index[keep]) < 0.2 * PPM:
            return float("nan"), float("nan")
        try:
            extended = self.solved(keep, extra=Extra(names, columns))
        except EstimationError:
            return float("nan"), float("nan")
        b, u = extended.of("weather")
        return 1.0 - b, u
