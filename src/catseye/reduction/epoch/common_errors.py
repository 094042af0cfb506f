"""Errors common to many shots that the adjustment does not estimate.

They are considered in its covariance. Sheets of one bench, one batch of glass, air that lines share with their
neighbours: beside 700 shots they are negligible, beside 20 000 nothing else remains. No range separates them, so the
answer keeps to the records, and its covariance includes them: an error d of the rows moves all parameters by Q A'P d.
What records state with a u is taken at that u, in common; what records of one kind share beyond that is given in
`[in_common]` of site.toml, and the errors of axes and amplitudes of a head on its mirror's sheet.
`docs/studies/neglected.md` has the size of each for a whole dish.

Source: consider parameters, [SCHMIDT66].
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_array

from catseye.atmosphere.path.mean import LAPSE_HPA_PER_M, nodes_along
from catseye.atmosphere.weather.humidity import relative_humidity_percent, vapour_pressure_hpa
from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Widened
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.optics.glass import glass_named, temperature_slopes
from catseye.reduction.epoch.contradictions.hypotheses import owners_of
from catseye.reduction.epoch.prior_names import BENCHMARKS, GLASS, MONUMENTS, OFFSETS, TRIPLET_BALLS, ZEROS
from catseye.reduction.epoch.shots import ShotGroup, ShotParts
from catseye.reduction.epoch.unknowns import CampaignNetwork, path_ppm

STEEL_PER_K = 12e-6
U_WAVELENGTH_UM = 1e-3  # of each head: site.toml gives one for all, 0.780, to its last digit
OF_BENCH = np.sqrt(0.5)  # of the u of a D0: half of its variance is from the bench that calibrated them all
OF_NEIGHBOURS = np.sqrt(0.5)  # of a line's residual: half of its variance is shared with neighbours; no record exists
BATCH = 100  # prisms of one melt and one polishing, by serial order
ALIKE_M = 5.0  # lines of one ranger share their air where their ends are so near: the outer scale close to a dish
NODES = 12  # of a path


@dataclass(frozen=True, eq=False)
class CommonError:
    """An error common to rows, at one standard uncertainty.

    shots    ranger: (m,) m, change of its shots' optical lengths
    priors   name of a prior: change of its rows' observed values, one array a prior of that name
    """

    name: str
    shots: dict[str, np.ndarray]
    priors: dict[str, list[np.ndarray]] = field(default_factory=dict)


def considered(
    network: CampaignNetwork, solution: LeastSquaresSolution, shots: list[tuple[ShotGroup, ShotParts]]
) -> LeastSquaresSolution:
    """Solution with all common errors in its covariance.

    Its values stay.
    """
    errors = list(common_errors(network, solution.x, [part for _, part in shots]))
    return replace(solution, q=Widened(solution.q, reach_of(network, solution, shots, errors)))


def reach_of(
    network: CampaignNetwork,
    solution: LeastSquaresSolution,
    shots: list[tuple[ShotGroup, ShotParts]],
    errors: list[CommonError],
) -> np.ndarray:
    """Shift of all parameters by one standard uncertainty of each error.

    (n, errors).
    """
    pushed = np.zeros((len(solution.x), len(errors)))
    groups = [*(group for group, _ in shots), *network.priors]
    used: dict[str, int] = {}
    for k, (group, fit) in enumerate(zip(groups, solution.fits, strict=True)):
        if k < len(shots):
            change = {i: e.shots[group.name] for i, e in enumerate(errors) if group.name in e.shots}
        else:
            nth = used.get(group.name, 0)
            used[group.name] = nth + 1
            change = {i: e.priors[group.name][nth] for i, e in enumerate(errors) if group.name in e.priors}
        if not change:
            continue
        rows = ActiveRows.of(group, fit.active)
        on = fit.active[:, None]
        weighed = rows.weigh(np.where(on, np.stack(list(change.values()), axis=1), 0.0))
        slopes = rows.spread(np.where(on, group.predict(solution.x)[1], 0.0))
        at = rows.row_columns()
        slopes = np.where(at < 0, 0.0, slopes)
        m, w = slopes.shape
        design = csr_array(
            (slopes.ravel(), np.maximum(at, 0).ravel(), np.arange(m + 1) * w), shape=(m, len(solution.x))
        )
        pushed[:, list(change)] += design.T @ weighed
    return solution.q.solve(pushed)


def common_errors(network: CampaignNetwork, x: np.ndarray, parts: list[ShotParts]) -> Iterator[CommonError]:
    """All considered errors, at one standard uncertainty each."""
    sights = [_Sight.of(network, x, part) for part in parts]
    yield from _of_heads(network, parts, sights)
    yield from _of_glass(network, parts, sights)
    yield from _of_surveys(network)
    yield from _of_air(network, parts, sights)


@dataclass(frozen=True, eq=False)
class _Sight:
    """One ranger's shots.

    Ends (m, 3) m, group index (m,), and the weather in the middle of the stations (m,).

    gradient   (m,) °C/m, of the stations
    """

    name: str
    a: np.ndarray
    b: np.ndarray
    index: np.ndarray
    temperature: np.ndarray
    gradient: np.ndarray
    pressure: np.ndarray
    humidity: np.ndarray

    @staticmethod
    def of(network: CampaignNetwork, x: np.ndarray, part: ShotParts) -> "_Sight":
        layout, heights = network.layout, network.field.heights
        b = x[np.array([layout.points[t] for t in part.target])[:, None] + np.arange(3)]
        a = np.broadcast_to(x[layout.columns(part.name)], b.shape)
        state = network.field.smoothed(network.campaign.shots.mjd_utc[part.electronics.shots])
        line = np.linalg.pinv(np.stack([np.ones(len(heights)), heights - heights.mean()], axis=1))
        mean, gradient = (state[:, :, 0] @ row for row in line)
        pressure, humidity = state[:, :, 1:].mean(axis=1).T
        return _Sight(
            name=part.name,
            a=a,
            b=b,
            index=1.0 + part.refractivity,
            temperature=mean,
            gradient=gradient,
            pressure=pressure,
            humidity=humidity,
        )


def _of_heads(network: CampaignNetwork, parts: list[ShotParts], sights: list[_Sight]) -> Iterator[CommonError]:
    campaign = network.campaign
    mirrors = {p.name: campaign.mirror_of(p.name) for p in parts}
    stated = np.array([campaign.mirror_of(n).u_d0_mm for n in network.rangers]) * MILLIMETRE
    u_bench = OF_BENCH * float(np.sqrt(np.mean(stated**2)))
    bench = [np.full(len(z.observed), u_bench) for z in network.priors if z.name == ZEROS]
    yield CommonError("D0 of one bench", {}, {ZEROS: bench})
    if campaign.site.in_common.sheets_at_c is not None:
        warm = {s.name: STEEL_PER_K * (s.temperature - campaign.site.in_common.sheets_at_c) for s in sights}
        mean = float(np.mean(np.concatenate(list(warm.values()))))
        offsets = [mean * prior.observed for prior in network.priors if prior.name == OFFSETS]
        yield CommonError(
            "steel of the heads",
            {s.name: s.index * mirrors[s.name].d0_mm * MILLIMETRE * warm[s.name] for s in sights},
            {OFFSETS: offsets} if offsets else {},
        )


def _of_glass(network: CampaignNetwork, parts: list[ShotParts], sights: list[_Sight]) -> Iterator[CommonError]:
    ranging, places = network.campaign.site.ranging, network.places
    ratio = ranging.bk7_to_air_group_index_ratio
    balls = {t.ball.target: (t.ball.r1_mm + t.ball.r2_mm) * MILLIMETRE for t in network.campaign.triplets.values()}
    length = {t: places[t].height or balls.get(t, 0.0) for p in parts for t in p.target}
    if not any(length.values()):
        return
    glass = {p.name: np.array([length[t] for t in p.target]) for p in parts}
    common = network.campaign.site.in_common
    if common.glass_index_ratio > 0.0:
        yield CommonError("group index of the glass", {n: common.glass_index_ratio * g for n, g in glass.items()})
    if common.sheets_at_c is not None:
        per_k = float(temperature_slopes(ranging.wavelength_um).group) + ratio * glass_named("BK7-old").expansion
        yield CommonError(
            "temperature of the glass",
            {s.name: per_k * glass[s.name] * (s.temperature - common.sheets_at_c) for s in sights},
        )
    (prior,) = [prior for prior in network.priors if prior.name == GLASS] or (None,)
    if prior is None:
        return
    owners = [owner.of for owner in owners_of(prior, network.layout.parameters)]
    prisms = [name for name in owners if places[name].normal is not None]
    for first in range(0, len(prisms), BATCH):
        batch = np.isin(owners, prisms[first : first + BATCH])
        error = np.where(batch, [places[name].u_constant for name in owners], 0.0)
        yield CommonError(f"glass of batch {first // BATCH + 1}", {}, {GLASS: [error]})


def _of_surveys(network: CampaignNetwork) -> Iterator[CommonError]:
    """Scales of certificates and survey; heights of triplets."""
    by_name: dict[str, list[np.ndarray]] = {}
    for prior in network.priors:
        by_name.setdefault(prior.name, []).append(prior.observed)
    common = network.campaign.site.in_common
    for label, name, ppm in (
        ("certificates of one laboratory", BENCHMARKS, common.certificate_scale_ppm),
        ("scale of the survey", MONUMENTS, common.survey_scale_ppm),
    ):
        if name in by_name and ppm > 0.0:
            yield CommonError(label, {}, {name: [ppm * PPM * observed for observed in by_name[name]]})
    if TRIPLET_BALLS in by_name:
        units = [t for t in network.campaign.triplets.values() if t.ball.target in network.places]
        u = float(np.sqrt(np.mean([(t.u_h_corr_mm * MILLIMETRE) ** 2 for t in units])))
        normals = [np.array(network.places[t.left_prism.target].normal) for t in units]
        yield CommonError("heights of triplets", {}, {TRIPLET_BALLS: [u * normal for normal in normals]})


def _of_air(network: CampaignNetwork, parts: list[ShotParts], sights: list[_Sight]) -> Iterator[CommonError]:
    air = network.field
    wet = {}
    middle = air.heights.mean()
    for part, s in zip(parts, sights, strict=True):
        z, weight = nodes_along(s.a[:, 2], s.b[:, 2], NODES)
        above = z - middle
        per_percent = _per_percent(network, s, 0.5 * (s.a[:, 2] + s.b[:, 2]))
        temperature = s.temperature[:, None] + s.gradient[:, None] * above
        pressure = s.pressure[:, None] - LAPSE_HPA_PER_M * above
        vapour = vapour_pressure_hpa(s.temperature, s.pressure, s.humidity)
        even = relative_humidity_percent(np.broadcast_to(vapour[:, None], z.shape), temperature, pressure)
        wet[s.name] = part.distance * per_percent * ((even - s.humidity[:, None]) @ weight)
    yield CommonError("vapour even with height, not relative humidity", wet)
    for part, s in zip(parts, sights, strict=True):
        error, redder = (
            air.refractivity_of(s.temperature, s.pressure, s.humidity, wavelength_um=air.wavelength_um + more)
            for more in (0.0, U_WAVELENGTH_UM)
        )
        yield CommonError(f"wavelength of {part.name}", {part.name: part.distance * (redder - error)})
    ppm = OF_NEIGHBOURS * path_ppm(network)
    if ppm > 0.0:
        for part, s in zip(parts, sights, strict=True):
            for i, shape in enumerate(_smooth(s.b).T):
                yield CommonError(
                    f"air of neighbouring lines of {part.name} {i + 1}", {part.name: ppm * PPM * part.distance * shape}
                )


def _per_percent(network: CampaignNetwork, s: _Sight, z: np.ndarray) -> np.ndarray:
    """Change (m,) of the refractivity at heights z by % of humidity.

    Downwards, as fog is no wetter, but not below 0.
    """
    air = network.field
    above = z - air.heights.mean()
    dry = (s.temperature + s.gradient * above, s.pressure - LAPSE_HPA_PER_M * above)
    step = np.where(s.humidity > 1.0, -1.0, 1.0)
    return (air.refractivity_of(*dry, s.humidity + step) - air.refractivity_of(*dry, s.humidity)) / step


def _smooth(ends: np.ndarray) -> np.ndarray:
    """Smooth shapes (m, k) over the ends of lines.

    As large as the air that lines share with their neighbours makes each of them.

    What falls off as exp(-r / L) has, over a surface much larger than L^2, in each smooth shape of mean square 1 the
    variance 2 pi L^2 / area of a line's; all six of second order, or as many as the ends resolve.
    """
    if len(ends) < 3:
        return np.zeros((len(ends), 0))
    away = ends - ends.mean(axis=0)
    spread, axes = np.linalg.svd(away, full_matrices=False)[1:]
    u, v = (away @ axes[:2].T / max(float(spread[0]) / np.sqrt(len(ends)), 1e-9)).T
    area = TWO_PI * 2.0 * float(spread[0] * spread[1]) / len(ends)  # of an ellipse of these second moments: 4 pi s1 s2
    if area < ALIKE_M**2:
        return np.zeros((len(ends), 0))  # all ends are one place: such lines have parameters of their own
    shapes = np.stack([np.ones(len(u)), u, v, u * v, u**2, v**2], axis=1)
    basis, size, _ = np.linalg.svd(shapes, full_matrices=False)
    basis = basis[:, size > 1e-6 * size[0]] * np.sqrt(len(ends))
    return basis * np.sqrt(min(TWO_PI * ALIKE_M**2 / area, 1.0))
