"""An archived night reduced again, with today's calibrations or its own, and what changes point by point."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.names import counted
from catseye.records.archive.layout import AXES, PRODUCTS
from catseye.records.archive.reading import ArchiveFolder
from catseye.records.night.campaign import Campaign, ObservedSite
from catseye.records.query.rows import select_rows
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.coordinates import AdjustedCoordinates, coordinates_of, settled_network
from catseye.reduction.epoch.epoch import Reduction, reduce_epoch
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import SettledNetwork
from catseye.reduction.query.renewed import calibrated_anew, changed_records, with_records
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class ArchivedPoints:
    """Points of a night as the archive has them, n of them.

    x   (n, 3) m
    u   (n, 3) m
    """

    night: str
    mjd: float
    version: str
    air_model: str
    point: np.ndarray
    body: np.ndarray
    x: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, eq=False)
class ReReduction:
    """Night reduced again: n points that both results have.

    archived     the night, and the version of catseye that reduced it
    records      folder of today's records; "" for the night's own
    point, body  (n,)
    change       (n, 3) m, today's coordinates less the archived ones
    covariance   (n, 3, 3) m^2 of the change, from calibrations that changed and are independent of the old ones; the
                 shots' own noise is in both results and cancels
    x, u         (n, 3) m, today's
    archived_u   (n, 3) m
    changed      records that differ: "mirror of ZY101", ...
    selection    shots that only one of both used; what they add is not in the covariance
    lost, new    points that only the archive has, or only today's result
    result       verdict of today's reduction
    """

    archived: ArchivedPoints
    records: str
    point: np.ndarray
    body: np.ndarray
    change: np.ndarray
    covariance: np.ndarray
    x: np.ndarray
    u: np.ndarray
    archived_u: np.ndarray
    changed: tuple[str, ...]
    selection: int
    lost: tuple[str, ...]
    new: tuple[str, ...]
    result: Verdict

    @property
    def u_change(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m of the change."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    @property
    def over_u(self) -> np.ndarray:
        """Largest change of an axis over its archived standard uncertainty, (n,); nan for a point held fixed."""
        with np.errstate(invalid="ignore", divide="ignore"):
            ratios = np.abs(self.change) / np.where(self.archived_u > 0.0, self.archived_u, np.nan)
        finite = np.isfinite(ratios).any(axis=1)
        return np.where(finite, np.nanmax(np.where(finite[:, None], ratios, 0.0), axis=1), np.nan)

    @property
    def largest(self) -> float:
        """Largest change of a point, m."""
        return float(np.linalg.norm(self.change, axis=1).max(initial=0.0))

    @property
    def verdict(self) -> Verdict:
        """Verdict: the same, or how far it moved, no better than today's reduction."""
        if not len(self.point):
            return Verdict("failed", "no point is in both results")
        exact = self.largest == 0.0 and not self.lost and not self.new
        if exact:
            own = Verdict("good", "every coordinate is the same to the last bit")
        elif self.records:
            moved = f"points move by up to {self.largest * 1e3:.3f} mm"
            own = Verdict("good", f"{counted(len(self.changed), 'record')} changed, {moved}")
        else:
            own = Verdict(
                "doubtful",
                f"the same samples and records move points by up to {self.largest * 1e6:.3g} um: "
                f"catseye {self.archived.version} reduced the night",
            )
        return own.resting_on({"today's reduction": self.result})


def archived_points(archive: ArchiveFolder, night: str) -> ArchivedPoints:
    """Points of a night, by its identifier or a beginning that only one has.

    Raises InputError: an unknown night, a damaged file.
    """
    name = archive.entry(night).night
    [mjd], [version], [air_model] = select_rows(
        archive, "nights", ("mjd", "version", "air_model"), {"night": name}
    ).values()
    rows = select_rows(archive, "points", ("point", "body", *AXES, *PRODUCTS), {"night": name})
    variances = np.column_stack([rows[item] for item in ("xx", "yy", "zz")])
    return ArchivedPoints(
        night=name,
        mjd=float(mjd),
        version=str(version),
        air_model=str(air_model),
        point=rows["point"],
        body=rows["body"],
        x=np.column_stack([rows[axis] for axis in AXES]),
        u=np.sqrt(np.maximum(variances, 0.0)),
    )


def reduced_again(
    archived: ArchivedPoints, campaign: Campaign, site: SiteFolder | None, progress: Progress | None = None
) -> ReReduction:
    """Archived night reduced again.

    archived   its points
    campaign   the night as it was restored
    site       today's records; None for the night's own

    Raises InputError for records that do not fit the night, EstimationError where there is no answer.
    """
    renewed = campaign if site is None else with_records(campaign, site)
    settings = ReductionSettings(air_model=archived.air_model)
    changed = changed_records(campaign, renewed)
    now, network = _reduced(renewed, settings, progress)
    names = np.array(now.coordinates.points)
    at = {name: row for row, name in enumerate(names.tolist())}
    common = np.array([k for k, name in enumerate(archived.point.tolist()) if name in at], dtype=int)
    rows = np.array([at[name] for name in archived.point[common].tolist()], dtype=int)
    covariance, selection = np.zeros((len(common), 3, 3)), 0
    if changed:
        before, old = _reduced(campaign, settings, progress)
        covariance = change_covariance(
            old, network, archived.point[common].tolist(), calibrated_anew(campaign, renewed)
        )
        selection = sum(a != b for a, b in _used_of_both(before, now))
    x = now.coordinates.x[rows]
    return ReReduction(
        archived=archived,
        records="" if site is None else str(site.directory),
        point=archived.point[common],
        body=archived.body[common],
        change=x - archived.x[common],
        covariance=covariance,
        x=x,
        u=now.coordinates.u[rows],
        archived_u=archived.u[common],
        changed=changed,
        selection=selection,
        lost=tuple(sorted(set(archived.point.tolist()) - set(at))),
        new=tuple(sorted(set(at) - set(archived.point.tolist()))),
        result=now.verdict,
    )


def _reduced(
    campaign: Campaign, settings: ReductionSettings, progress: Progress | None
) -> tuple[Reduction, SettledNetwork]:
    """Reduction, and the network behind it."""
    networks: list[SettledNetwork] = []

    def adjusted(
        site: ObservedSite,
        phases: Phases,
        electronics: dict[str, ElectronicsPhase],
        *,
        settings: ReductionSettings,
        progress: Progress | None = None,
    ) -> AdjustedCoordinates:
        settled, resolved = settled_network(site, phases, electronics, settings=settings, progress=progress)
        networks.append(settled)
        return coordinates_of(settled, resolved=resolved)

    return reduce_epoch(campaign, settings, progress, adjusted=adjusted), networks[-1]


def _used_of_both(before: Reduction, now: Reduction) -> Iterator[tuple[bool, bool]]:
    """Use of each shot in both reductions, which have the same shots."""
    for first, second in zip(before.status, now.status, strict=True):
        yield first == first.USED, second == second.USED


def change_covariance(
    old: SettledNetwork, new: SettledNetwork, names: list[str], owners: Mapping[str, set[str]]
) -> np.ndarray:
    """Covariance (n, 3, 3) m^2 of how points move from one adjustment of the same shots to another.

    old, new   adjustments whose priors differ
    names      n points of both
    owners     name of a prior: owners of its parameters that were calibrated anew

    With normal matrices N = M + C of what is common (M) and what was calibrated anew (C), independently,
    cov(x_new - x_old) = Q_old C_old Q_new + Q_new C_new Q_old: from M = N - C, as cov(x_old, x_new) = Q_old M Q_new.
    Only the columns of calibrated parameters are needed.

    Source: [RAO73] section 4a, two estimates with common observations.
    """
    total = np.zeros((len(names), 3, 3))
    for own, other in ((old, new), (new, old)):
        design, weight = _rows_of(own, owners)
        if not len(design):
            continue
        here = _moved_by(own, design, names)
        there = _moved_by(other, _translated(design, own, other), names)
        part = np.einsum("nir,rs,njs->nij", here, weight, there, optimize=True)
        total += 0.5 * (part + part.transpose(0, 2, 1))  # symmetric but for the second order
    return total


def _rows_of(settled: SettledNetwork, owners: Mapping[str, set[str]]) -> tuple[np.ndarray, np.ndarray]:
    """Design (r, n) and weight (r, r) of the prior rows that were calibrated anew."""
    network, solution, shots = settled
    designs, weights = [], []
    for group, fit in zip(network.priors, solution.fits[len(shots) :], strict=True):
        names = owners.get(group.name, set())
        if not names:
            continue
        jacobian = full_jacobian(group, solution.x)
        of = [{network.layout.parameters[c].of for c in np.flatnonzero(row)} for row in jacobian]
        chosen = np.flatnonzero([bool(item & names) and active for item, active in zip(of, fit.active, strict=True)])
        if len(chosen):
            designs.append(jacobian[chosen])
            weights.append(_weight(group, chosen))
    if not designs:
        return np.zeros((0, len(solution.x))), np.zeros((0, 0))
    size = sum(len(item) for item in weights)
    weight, at = np.zeros((size, size)), 0
    for item in weights:
        weight[at : at + len(item), at : at + len(item)] = item
        at += len(item)
    return np.vstack(designs), weight


def _weight(group: ObservationGroup, rows: np.ndarray) -> np.ndarray:
    """Weight (r, r) of some rows of a group."""
    covariance = group.covariance
    if covariance.ndim == 1:
        return np.diag(1.0 / covariance[rows])
    if covariance.ndim == 2:
        return np.linalg.inv(covariance[np.ix_(rows, rows)])
    raise InputError(f"{group.name}: a prior in blocks was calibrated anew (expected independent rows or one matrix)")


def _translated(design: np.ndarray, own: SettledNetwork, other: SettledNetwork) -> np.ndarray:
    """Design by the parameters of another adjustment; what it has not is known exactly there."""
    columns = {parameter: k for k, parameter in enumerate(other.network.layout.parameters)}
    translated = np.zeros((len(design), len(columns)))
    for k, parameter in enumerate(own.network.layout.parameters):
        if parameter in columns:
            translated[:, columns[parameter]] = design[:, k]
    return translated


def _moved_by(settled: SettledNetwork, design: np.ndarray, names: list[str]) -> np.ndarray:
    """Products (n, 3, r) of the points' rows of the covariance with the transposed design."""
    moved = settled.solution.q.solve(np.ascontiguousarray(design.T))
    layout = settled.network.layout
    return np.array([moved[layout.columns(name)] for name in names])
