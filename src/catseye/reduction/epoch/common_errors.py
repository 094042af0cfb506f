"""Errors that many shots have in common and no parameter of the adjustment stands for: considered in its covariance.

Sheets of one bench, certificates of one laboratory, one batch of glass, a layer of cold air on the ground: beside 700
shots they are nothing, beside 20 000 they are all that is left. No range tells them apart, so the answer keeps to the
records, and its covariance takes them in: an error d of the rows moves all parameters by Q A'P d. What records state
with a u is taken at that u, in common; what a record may say of its own kind is `[in_common]` of site.toml.
`docs/studies/neglected.md` has the size of each beside a whole dish.

Source: consider parameters, [SCHMIDT66].
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import csr_array

from catseye.atmosphere.path.mean import LAPSE_HPA_PER_M, nodes_along
from catseye.atmosphere.weather.humidity import relative_humidity_percent, vapour_pressure_hpa
from catseye.constants import MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Widened
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.geometry.mirror.mirror_path import direction_angles, path_change
from catseye.optics.glass import glass_named, temperature_slopes
from catseye.reduction.epoch.shots import ShotGroup, ShotParts
from catseye.reduction.epoch.unknowns import BENCHMARKS, MONUMENTS, OFFSETS, TRIPLET_BALLS, CampaignNetwork, path_ppm
from catseye.reduction.site.stations import station_in

STEEL_PER_K = 12e-6
U_WAVELENGTH_UM = 2.5e-3  # laser diodes of one type, each its own
U_AMPLITUDE = 1e-4  # rad a factor e, where the sheet says nothing
BATCH = 100  # prisms of one melt and one polishing, by serial order
LAYER_M, LAYER_C = 10.0, 0.5  # cold air on the ground of a clear night, beyond the line through the stations
BOWL_M, BOWL_C = 100.0, 0.1  # air that is warmer all around than in the middle
ALIKE_M = 5.0  # lines of one ranger share their air where their ends are so near: the outer scale close to a dish
NODES = 12  # of a path


@dataclass(frozen=True, eq=False)
class CommonError:
    """Something that rows have in common, at one standard uncertainty.

    shots    ranger: (m,) m, change of its shots' optical lengths
    priors   name of a prior: change of its rows' observed values, one array a prior of that name
    """

    name: str
    shots: dict[str, np.ndarray]
    priors: dict[str, list[np.ndarray]] = field(default_factory=dict)


def considered(
    network: CampaignNetwork, solution: LeastSquaresSolution, shots: list[tuple[ShotGroup, ShotParts]]
) -> LeastSquaresSolution:
    """The solution with all common errors in its covariance; its values stay."""
    errors = list(common_errors(network, solution.x, [part for _, part in shots]))
    return replace(solution, q=Widened(solution.q, reach_of(network, solution, shots, errors)))


def reach_of(
    network: CampaignNetwork,
    solution: LeastSquaresSolution,
    shots: list[tuple[ShotGroup, ShotParts]],
    errors: list[CommonError],
) -> np.ndarray:
    """(n, errors): what all parameters move by, for one standard uncertainty of each."""
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
    """All that is considered, at one standard uncertainty each."""
    sights = [_Sight.of(network, x, part) for part in parts]
    yield from _of_heads(network, parts, sights)
    yield from _of_glass(network, parts, sights)
    yield from _of_surveys(network)
    yield from _of_air(network, parts, sights)


@dataclass(frozen=True, eq=False)
class _Sight:
    """One ranger's shots: ends (m, 3) m, group index (m,), and the weather in the middle of the stations (m,).

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
        return _Sight(part.name, a, b, 1.0 + part.refractivity, mean, gradient, pressure, humidity)


def _of_heads(network: CampaignNetwork, parts: list[ShotParts], sights: list[_Sight]) -> Iterator[CommonError]:
    campaign = network.campaign
    mirrors = {p.name: campaign.mirror_of(p.name) for p in parts}
    bench = float(np.sqrt(np.mean([(m.u_d0_mm * MILLIMETRE) ** 2 for m in mirrors.values()])))
    yield CommonError("D0 of one bench", {s.name: bench * s.index for s in sights})
    if campaign.site.in_common.sheets_at_c is not None:
        warm = {s.name: STEEL_PER_K * (s.temperature - campaign.site.in_common.sheets_at_c) for s in sights}
        mean = float(np.mean(np.concatenate(list(warm.values()))))
        offsets = [mean * prior.observed for prior in network.priors if prior.name == OFFSETS]
        yield CommonError(
            "steel of the heads",
            {s.name: s.index * mirrors[s.name].d0_mm * MILLIMETRE * warm[s.name] for s in sights},
            {OFFSETS: offsets} if offsets else {},
        )
    half = 0.5 * SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz
    for part, sight in zip(parts, sights, strict=True):
        name, mirror = part.name, mirrors[part.name]
        if mirror.u_axis_mm is None:  # axes and beam then miss each other as the mirror's place is known: alike aligned
            for i, slope in enumerate(_axes(network, sight).T):
                size = mirror.u_offset_mm * MILLIMETRE * sight.index
                yield CommonError(f"axes of {name} {i + 1}", {name: size * slope})
        if mirror.u_amplitude_to_phase_rad is None:
            lit = network.phases.phasor[part.electronics.shots]
            strong = np.log(np.abs(lit) / np.abs(part.electronics.reference))
            yield CommonError(f"amplitude of {name}", {name: U_AMPLITUDE * half / TWO_PI * strong})


def _axes(network: CampaignNetwork, sight: _Sight) -> np.ndarray:
    """(m, 4): derivatives of one ranger's ranges by its mirror's four offsets.

    Where no record says how the mount stands, the azimuth axis is taken as level, across the mean sight.
    """
    station, ways = station_in(network.campaign, sight.name), sight.b - sight.a
    if station is not None:
        turn = station.mirror_from_ground
    else:
        mean, up = ways.mean(axis=0), np.array([0.0, 0.0, 1.0])
        z = np.cross(mean, up) if np.hypot(*mean[:2]) > 0.0 else np.array([1.0, 0.0, 0.0])
        z /= np.linalg.norm(z)
        turn = np.stack([np.cross(up, z), up, z])
    theta, phi = direction_angles(ways @ turn.T)
    return path_change(theta, phi, np.linalg.norm(ways, axis=1), np.zeros(4))[1]


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
    prisms = sorted({t for p in parts for t in p.target if places[t].kind == "prism" and places[t].u_constant > 0.0})
    for first in range(0, len(prisms), BATCH):
        batch = set(prisms[first : first + BATCH])
        own = [p for p in parts if not batch.isdisjoint(p.target)]
        yield CommonError(
            f"glass of batch {first // BATCH + 1}",
            {
                p.name: (1.0 + p.refractivity) * [places[t].u_constant if t in batch else 0.0 for t in p.target]
                for p in own
            },
        )


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
    layer, bowl, wet = {}, {}, {}
    heights, middle = air.heights, air.heights.mean()
    line = np.linalg.pinv(np.stack([np.ones(len(heights)), heights - middle], axis=1))
    low = heights.min()
    where = np.mean(np.sum(air.places**2, axis=1)) / BOWL_M**2

    def cold(z: np.ndarray) -> np.ndarray:
        return -LAYER_C * np.exp(-np.maximum(z - low, 0.0) / LAYER_M)

    for part, s in zip(parts, sights, strict=True):
        (east, weight), (north, _), (z, _) = (nodes_along(s.a[:, i], s.b[:, i], NODES) for i in range(3))
        above = z - middle
        per_c, per_percent = _slopes(network, s, 0.5 * (s.a[:, 2] + s.b[:, 2]))
        stations = cold(heights) @ line.T
        level, slope = stations if air.profile != "gradient" else (stations[0], 0.0)
        layer[s.name] = part.distance * per_c * ((cold(z) - level - slope * above) @ weight)
        bowl[s.name] = part.distance * per_c * BOWL_C * (((east**2 + north**2) / BOWL_M**2) @ weight - where)
        temperature = s.temperature[:, None] + s.gradient[:, None] * above
        pressure = s.pressure[:, None] - LAPSE_HPA_PER_M * above
        vapour = vapour_pressure_hpa(s.temperature, s.pressure, s.humidity)
        even = relative_humidity_percent(np.broadcast_to(vapour[:, None], z.shape), temperature, pressure)
        wet[s.name] = part.distance * per_percent * ((even - s.humidity[:, None]) @ weight)
    yield CommonError("cold air on the ground", layer)
    yield CommonError("air warmer all around", bowl)
    yield CommonError("vapour even with height, not relative humidity", wet)
    for part, s in zip(parts, sights, strict=True):
        now, redder = (
            air.refractivity_of(s.temperature, s.pressure, s.humidity, wavelength_um=air.wavelength_um + more)
            for more in (0.0, U_WAVELENGTH_UM)
        )
        yield CommonError(f"wavelength of {part.name}", {part.name: part.distance * (redder - now)})
    ppm = path_ppm(network)
    if ppm > 0.0:
        for part, s in zip(parts, sights, strict=True):
            for i, shape in enumerate(_smooth(s.b).T):
                yield CommonError(
                    f"air of neighbouring lines of {part.name} {i + 1}", {part.name: ppm * PPM * part.distance * shape}
                )


def _slopes(network: CampaignNetwork, s: _Sight, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m,) of the refractivity at heights z by °C and by % of humidity."""
    air = network.field
    above = z - air.heights.mean()
    state = (s.temperature + s.gradient * above, s.pressure - LAPSE_HPA_PER_M * above, s.humidity)
    here, colder, drier = (
        air.refractivity_of(*(v - (i == j) for j, v in enumerate(state)))  # downwards: fog is no wetter
        for i in (None, 0, 2)
    )
    return here - colder, here - drier


def _smooth(ends: np.ndarray) -> np.ndarray:
    """(m, k) smooth shapes over the ends of lines, as large as what lines share with neighbours makes each of them.

    What falls off as exp(-r / L) has, over a surface much larger than L^2, in each smooth shape of mean square 1 the
    variance 2 pi L^2 / area of a line's; all six of second order, or as many as the ends tell apart.
    """
    away = ends - ends.mean(axis=0)
    spread, axes = np.linalg.svd(away, full_matrices=False)[1:]
    u, v = (away @ axes[:2].T / max(float(spread[0]) / np.sqrt(len(ends)), 1e-9)).T
    area = TWO_PI * 2.0 * float(spread[0] * spread[1]) / len(ends)  # of an ellipse of these second moments: 4 pi s1 s2
    if area < ALIKE_M**2:
        return np.zeros((len(ends), 0))  # all ends are one place: such lines are parameters of their own
    shapes = np.stack([np.ones(len(u)), u, v, u * v, u**2, v**2], axis=1)
    basis, size, _ = np.linalg.svd(shapes, full_matrices=False)
    basis = basis[:, size > 1e-6 * size[0]] * np.sqrt(len(ends))
    return basis * np.sqrt(min(TWO_PI * ALIKE_M**2 / area, 1.0))
