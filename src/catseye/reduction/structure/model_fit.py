"""Recipe of a structural model's fit: coefficients refined by measured epochs, their change, and the verdict.

[PARKER04] section 2.6: the finite element model bends the telescope, ranges refine it. What `fit.fit_model` estimates
is judged here by the chi-square of its residuals, and by the verdicts of the epochs.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import COMPONENTS, KnotTable, PostureMotion, PostureTerms, TelescopePosture
from catseye.records.site.structural_model import KEYS, StructuralModel
from catseye.reduction.structure.antenna import Antenna
from catseye.reduction.structure.corrections import MeasuredPosture
from catseye.reduction.structure.epochs import ReadEpochs
from catseye.reduction.structure.fit import ModelFit, fit_model, updated_model
from catseye.verdict import Verdict

LEAST_P = 0.01  # of the chi-square test: below it the epochs contradict the model
MJD_ZERO = date(1858, 11, 17)


@dataclass(frozen=True)
class FittedCoefficient:
    """Coefficient of the model before and after the fit, m or rad.

    owner       frame or group that moves
    component   shift_x, ..., turn_z
    function    term, or knot of a table
    before      value of the model
    after       fitted value
    u           standard uncertainty of the fitted value
    """

    owner: str
    component: str
    function: str
    before: float
    after: float
    u: float

    @property
    def turns(self) -> bool:
        """True for a component of the rotation, rad."""
        return self.component.startswith("turn")


@dataclass(frozen=True, eq=False)
class ModelFindings:
    """Structural model fitted to epochs.

    antenna    the model at the start
    epochs     measured targets of each epoch
    labels     of the epochs
    last_mjd   of the last epoch, UTC; NaN where unknown
    fit        coefficients, covariance, residuals
    sources    verdict of each epoch, by its label
    ignored    names of points that the model does not have
    doubts     of the epochs
    """

    antenna: Antenna
    epochs: tuple[MeasuredPosture, ...]
    labels: tuple[str, ...]
    last_mjd: float
    fit: ModelFit
    sources: Mapping[str, Verdict | None]
    ignored: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def coefficients(self) -> tuple[FittedCoefficient, ...]:
        """Free coefficients in the order of the covariance."""
        u = np.sqrt(np.diag(self.fit.covariance))
        rows: list[FittedCoefficient] = []
        for owner, component in self.fit.free:
            motion, c = self.antenna.motions[owner], COMPONENTS.index(component)
            for k, function in enumerate(functions_of(motion)):
                rows.append(
                    FittedCoefficient(
                        owner=owner,
                        component=component,
                        function=function,
                        before=float(motion.coefficients[c, k]),
                        after=float(self.fit.coefficients[owner][c, k]),
                        u=float(u[len(rows)]),
                    )
                )
        return tuple(rows)

    @property
    def p(self) -> float:
        """Probability of a chi-square at least as large, if the model and all uncertainties are right."""
        from scipy.stats import chi2

        return float(chi2.sf(self.fit.pvv, self.fit.degrees_of_freedom))

    @property
    def residuals(self) -> np.ndarray:
        """Residuals (m, 3) m of all targets of all epochs, ground axes."""
        return np.concatenate(self.fit.residuals)

    @property
    def notes(self) -> tuple[str, ...]:
        """Doubts, and points that were not used."""
        notes = list(self.doubts)
        if self.ignored:
            some = ", ".join(self.ignored[:4]) + (", ..." if len(self.ignored) > 4 else "")
            notes.append(f"{len(self.ignored)} points of the epochs are not in the model ({some}).")
        return tuple(notes)

    @property
    def verdict(self) -> Verdict:
        """Verdict by the chi-square, the epochs' doubts and their verdicts."""
        factor = f"variance factor {self.fit.variance_factor:.2f}, {self.fit.degrees_of_freedom} degrees of freedom"
        judgement = Verdict("good", f"the epochs agree with the fitted model ({factor})")
        if self.p < LEAST_P:
            judgement = Verdict(
                "doubtful", f"the epochs depart from the fitted model by more than is claimed ({factor})"
            )
        return judgement.hearing(self.doubts).resting_on(self.sources)

    def updated(self, today: date) -> StructuralModel:
        """Model with the fitted coefficients and their covariance.

        today   date of measurement where no epoch says its time
        """
        day = MJD_ZERO + timedelta(days=int(self.last_mjd)) if np.isfinite(self.last_mjd) else today
        report = f"fitted to {len(self.epochs)} epochs by catseye model fit"
        return updated_model(
            self.antenna.record,
            self.antenna,
            self.fit,
            by=self.antenna.record.by or "catseye",
            measured_on=day,
            report=report,
        )


def functions_of(motion: PostureMotion) -> tuple[str, ...]:
    """Names of a motion's functions: terms, or knots such as `E=15,t=40`."""
    if isinstance(motion.basis, PostureTerms):
        return motion.basis.names
    e, t = motion.basis.elevation / DEGREE, motion.basis.temperature_c
    return tuple(f"E={x:g},t={y:g}" if len(t) > 1 else f"E={x:g}" for x in e for y in t)


def model_fit(
    antenna: Antenna,
    read: ReadEpochs,
    *,
    free: Mapping[str, Sequence[str]] | None = None,
    temperature_c: float | None = None,
) -> ModelFindings:
    """Fit a structural model to epochs, and judge the fit.

    antenna         the model to begin with
    read            epochs, of which the model's points count
    free            frame or group: components to be estimated; without, those that the file gives of every motion by
                    terms whose own points were measured
    temperature_c   of the structure in epochs that do not say it

    Raises InputError for epochs without targets of the model or without a temperature that it needs, EstimationError
    for coefficients that float, ValidityError outside its range.
    """
    modelled = {name for group in antenna.groups.values() for name in group.names}
    epochs, labels, observed = [], [], set()
    for epoch in sorted(read.epochs, key=lambda each: (np.isnan(each.mjd), each.mjd)):
        rows = [i for i, name in enumerate(epoch.names) if name in modelled]
        observed |= set(epoch.names)
        if not rows:
            continue
        at = (3 * np.array(rows)[:, None] + np.arange(3)).ravel()
        warm = epoch.temperature_c if np.isfinite(epoch.temperature_c) else temperature_c
        if warm is None and _needs_temperature(antenna):
            raise InputError(
                f"epoch {epoch.label}: its temperature is unknown (expected temperature_c in the list of "
                "epochs, or one for all)"
            )
        posture = TelescopePosture(
            epoch.azimuth, epoch.elevation, antenna.record.reference_temperature_c if warm is None else warm
        )
        names = tuple(epoch.names[i] for i in rows)
        covariance = np.asarray(epoch.covariance)[np.ix_(at, at)]
        epochs.append(MeasuredPosture(names, np.asarray(epoch.coordinates)[rows], covariance, posture))
        labels.append(epoch.label)
    if not epochs:
        some = ", ".join(sorted(observed)[:4])
        raise InputError(f"no epoch has a point of the model's groups (they have {some}, ...)")
    measured = {name for epoch in epochs for name in epoch.names}
    groups = [group for group in antenna.groups.values() if measured & set(group.names)]
    chosen = free or default_free(antenna, {group.frame for group in groups} | {group.group for group in groups})
    if not chosen:
        raise InputError("no motion of the model is free by itself: name a frame and its components")
    fit = fit_model(antenna, epochs, free=chosen)
    mjd = [epoch.mjd for epoch in read.epochs if np.isfinite(epoch.mjd)]
    return ModelFindings(
        antenna=antenna,
        epochs=tuple(epochs),
        labels=tuple(labels),
        last_mjd=max(mjd) if mjd else float("nan"),
        fit=fit,
        sources=read.sources,
        ignored=tuple(sorted(observed - modelled)),
        doubts=read.doubts,
    )


def _needs_temperature(antenna: Antenna) -> bool:
    """True if any motion or table of points depends on temperature."""
    bases = [motion.basis for motion in antenna.motions.values()]
    if any(isinstance(basis, KnotTable) and len(basis.temperature_c) > 1 for basis in bases):
        return True
    terms = [name for basis in bases if isinstance(basis, PostureTerms) for name in basis.names]
    for group in antenna.record.group:
        if group.shifts is not None:
            terms += list(group.shifts.terms or ())
            if len(group.shifts.temperature_c or ()) > 1:
                return True
    return any(factor.startswith("t") for term in terms for factor in term.replace(" ", "").split("*"))


def default_free(antenna: Antenna, carriers: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Components other than zero of motions by terms, of some frames and groups.

    carriers   names of the frames and groups
    """
    free: dict[str, tuple[str, ...]] = {}
    for entry in antenna.record.moving:
        if entry.name in carriers and entry.motion is not None and entry.motion.terms is not None:
            components = [c for c, key in zip(COMPONENTS, KEYS, strict=True) if any(getattr(entry.motion, key) or ())]
            if components:
                free[entry.name] = tuple(components)
    return free
