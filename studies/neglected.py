"""What the reduction of a night neglects, beside 20 000 shots: prints the table of docs/studies/neglected.md, draws it.

python studies/neglected.py [--prisms 2209] [--out DIRECTORY] [--night DIRECTORY] [--span SECONDS]

A night of the whole dish is simulated and adjusted. An effect changes each shot's optical length by d; what that does
to the answer is Q A' P d, with the covariance, derivatives and weights of the network as it settled. Of what all points
share (`Common`) this is given in units of its own u: at these shots, and at ten times as many.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.path.bending import excess_bound, index_gradient
from catseye.atmosphere.path.mean import LAPSE_HPA_PER_M, hydrostatic_pressure_hpa, nodes_along
from catseye.atmosphere.weather.humidity import relative_humidity_percent, vapour_pressure_hpa
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, PPM, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution, SolverSettings, adjust
from catseye.estimation.least_squares.bordered import Border
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, STYLE, Figure, mpl, svg
from catseye.geometry.mirror.mirror_path import direction_angles, path_change
from catseye.optics.glass import glass_named, temperature_slopes
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.records.night.campaign import REFERENCE, read_campaign
from catseye.reduction.epoch import coordinates
from catseye.reduction.epoch.air import field as air_module
from catseye.reduction.epoch.parameter import BEND, Parameter, ParameterKind
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import SettledNetwork
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import CampaignNetwork, path_ppm
from catseye.signal.drift.reference import drift_along
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night

SEED = 2209
MORE = 10.0  # times as many shots, computed
LIMIT = 0.1  # of u: above it an effect must be a parameter or a variance
STEEL_PER_K = 12e-6
PHASE_RATIO = 1.510811  # phase index of BK 7 over that of the air, 0.780 um
UNIFORM = 1.0 / np.sqrt(12.0)  # standard deviation of rounding, in units of the last digit
NODES = 40

Answer = Callable[["Network"], np.ndarray]


@dataclass(frozen=True)
class Common:
    """What all points share: rows of `of` (k, n) take it from the parameters; `place` (k,) bool, of dish and arm."""

    names: list[str]
    of: np.ndarray
    place: np.ndarray

    @staticmethod
    def of_network(network: CampaignNetwork, x: np.ndarray) -> "Common":
        layout, rows, names = network.layout, [], []

        def add(name: str, weights: dict[int, float]) -> None:
            row = np.zeros(len(layout.parameters))
            row[list(weights)] = list(weights.values())
            rows.append(row)
            names.append(name)

        for body, label in (("dish", "dish"), ("arm", "arm")):
            points = [n for n, p in network.places.items() if p.body == body and (body == "dish" or p.kind is None)]
            at = np.array([layout.columns(n) for n in points])
            for i, axis in enumerate(("east", "north", "up")):
                add(f"{label} {axis}", dict.fromkeys(at[:, i].tolist(), 1.0 / len(at)))
            if body == "dish":
                for name, shape in _shapes(x[at]):
                    add(f"dish {name}", dict(zip(at.ravel().tolist(), shape.ravel().tolist(), strict=True)))
        places = len(names)
        for station in network.field.stations:
            add(f"thermometer {station}", {layout.at[Parameter(ParameterKind.THERMOMETER, station)]: 1.0})
            add(f"lag {station}", {layout.at[Parameter(ParameterKind.LAG, station)]: 1.0})
        add("bend", {layout.at[BEND]: 1.0})
        for ranger in network.rangers:
            add(f"zero {ranger}", {layout.at[Parameter(ParameterKind.ZERO, ranger)]: 1.0})
        return Common(names, np.array(rows), np.arange(len(names)) < places)


def _shapes(points: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Turns, scale and depth of points (k, 3) as weights (k, 3) of their coordinates, by least squares."""
    r = points - points.mean(axis=0)
    turns = np.stack([np.cross(e, r).ravel() for e in np.eye(3)], axis=1)
    design = np.hstack([turns, r.reshape(-1, 1), np.tile(np.eye(3), (len(r), 1))])
    own = np.linalg.pinv(design)
    for i, name in enumerate(("tilt east", "tilt north", "turn", "scale")):
        yield name, own[i].reshape(r.shape)
    axes = np.linalg.svd(r, full_matrices=False)[2]
    across, normal = r @ axes[:2].T, axes[2]
    square = np.sum(across**2, axis=1)
    depth = np.linalg.pinv(np.column_stack([square, across, np.ones(len(r))]))[0]
    yield "depth", depth[:, None] * normal


@dataclass(frozen=True, eq=False)
class Network:
    """The settled network with so many times its shots.

    gain   (k, rows) what an error of each row, shots first, does to each common parameter
    u      (k,)
    """

    gain: np.ndarray
    u: np.ndarray
    more: float

    def of(self, d: np.ndarray) -> np.ndarray:
        """(k,) shifts by errors of rows (rows,), or of shots alone."""
        return np.abs(self.gain[:, : len(d)] @ d)

    def at_random(self, sigma: np.ndarray, *, anew: bool = False) -> np.ndarray:
        """Root mean square shift by independent errors of rows; `anew` at each shot, however many there are."""
        return np.sqrt(self.gain[:, : len(sigma)] ** 2 @ sigma**2 / (self.more if anew else 1.0))

    def in_groups(self, d: np.ndarray, labels: np.ndarray) -> np.ndarray:
        """The same by errors that rows of one label share, each times its d; label -1: none."""
        number = np.unique(labels, return_inverse=True)[1]
        sums = np.zeros((len(self.u), number.max() + 1))
        np.add.at(sums.T, number, (self.gain[:, : len(d)] * np.where(labels == -1, 0.0, d)).T)
        return np.sqrt(np.sum(sums**2, axis=1))


class Night:
    """A night as it settled: the network, and every shot in the order of its rows."""

    def __init__(self, settled: SettledNetwork):
        self.network, solution, self.groups_shots = settled
        network, x = self.network, solution.x
        self.x, self.solution, self.campaign = x, solution, network.campaign
        again = [shot_group(network.seen_from(n), n, x) for n in network.rangers]
        self.parts = [p for _, p in again]
        self.groups = [*(g for g, _ in again), *network.priors]
        self.active = [f.active for f in solution.fits]
        self.first = np.cumsum([0, *(len(g.observed) for g in self.groups)])
        join = np.concatenate
        self.k = join([p.electronics.shots for p in self.parts])
        self.ranger = np.array([p.name for p in self.parts for _ in p.target])
        self.target = np.array([t for p in self.parts for t in p.target])
        self.mjd = self.campaign.shots.mjd_utc[self.k]
        self.seconds = network.field.seconds(self.mjd)
        self.hours = (self.mjd - network.middle_mjd) * 24.0
        self.a = np.array([x[network.layout.columns(r)] for r in self.ranger])
        self.b = np.array([x[network.layout.columns(t)] for t in self.target])
        self.distance = join([p.distance for p in self.parts])
        self.towards = (self.a - self.b) / self.distance[:, None]
        self.index = 1.0 + join([p.refractivity for p in self.parts])
        self.incidence = join([p.incidence for p in self.parts])
        self.phase = join([p.phase for p in self.parts])
        self.phasor = network.phases.phasor[self.k]
        self.cube = join([p.electronics.reference for p in self.parts])
        self.noise_volt = network.phases.u_across[self.k]
        self.half = 0.5 * SPEED_OF_LIGHT / self.campaign.site.ranging.modulation_hz
        self.per_radian = -self.half / TWO_PI
        spots = [network.places[t] for t in self.target]
        self.prism = np.array([s.normal is not None for s in spots])
        self.constant = np.array([s.constant for s in spots])
        self.body = np.array([s.body for s in spots])
        self.own_body = np.array([network.places[r].body for r in self.ranger])
        balls = {t.ball.target: (t.ball.r1_mm + t.ball.r2_mm) * MILLIMETRE for t in self.campaign.triplets.values()}
        self.glass = np.array([s.height or balls.get(s.name, 0.0) for s in spots])  # m of glass to corner or mirror

    @cached_property
    def weather(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stations' mean temperature and its gradient (m,), °C/m; pressure and humidity (m, 2)."""
        state, heights = self.network.field.smoothed(self.mjd), self.network.field.heights
        line = np.linalg.pinv(np.stack([np.ones(len(heights)), heights - heights.mean()], axis=1))
        return state[:, :, 0] @ line[0], state[:, :, 0] @ line[1], state[:, :, 1:].mean(axis=1)

    @cached_property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """(m, 40, 3) m, along each path, and the shares (40,)."""
        parts = [nodes_along(self.a[:, i], self.b[:, i], NODES) for i in range(3)]
        return np.stack([p[0] for p in parts], axis=2), parts[0][1]

    def state(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Temperature, pressure and humidity by the stations at heights z (m,) or (m, q)."""
        mean, gradient, (pressure, humidity) = *self.weather[:2], self.weather[2].T
        shape = (-1,) + (1,) * (z.ndim - 1)
        up = z - self.network.field.heights.mean()
        t = mean.reshape(shape) + gradient.reshape(shape) * up
        p = pressure.reshape(shape) - LAPSE_HPA_PER_M * up
        return t, p, np.broadcast_to(humidity.reshape(shape), t.shape)

    @cached_property
    def per_unit(self) -> dict[str, np.ndarray]:
        """Metres of optical length per °C, hPa and % all along the path."""
        middle = self.state(0.5 * (self.a[:, 2] + self.b[:, 2]))
        slopes = {}
        for i, name in enumerate(("c", "hpa", "percent")):
            up, down = ([v + s * (j == i) for j, v in enumerate(middle)] for s in (0.5, -0.5))
            slopes[name] = self.distance * (self.refractivity(*up) - self.refractivity(*down))
        return slopes

    def refractivity(self, *weather: np.ndarray, model: str = "rueger1990", **more: float) -> np.ndarray:
        return np.asarray(group_refractivity(*weather, model=model, **more))

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Of values (m, 40) at the nodes."""
        return values @ self.nodes[1]

    def along(self, mjd: np.ndarray | None = None, **change: object) -> np.ndarray:
        """Mean refractivity of the paths by the reduction's own air, changed."""
        field = replace(self.network.field, _states={}, **change)
        times = self.mjd if mjd is None else mjd
        return field.along(times, self.a, self.b, self.x[self.network.layout.air]).refractivity

    def wave(self, period: float, knots: np.ndarray) -> list[np.ndarray]:
        """What straight lines between knots leave of a sine and of a cosine, at each shot."""
        w = TWO_PI / period
        return [f(w * self.seconds) - np.interp(self.seconds, knots, f(w * knots)) for f in (np.sin, np.cos)]

    def moved(self, here: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Change of the optical lengths where scan points and targets move by (m, 3) m."""
        return self.index * np.sum((here - there) * self.towards, axis=1)

    def by_body(self, motion: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
        """The same by a motion of points (m, 3) on bodies (m,)."""
        return self.moved(motion(self.a, self.own_body), motion(self.b, self.body))

    def rows(self, name: str) -> list[int]:
        """Of the prior groups of that name."""
        return [
            r
            for g, low, high in zip(self.groups, self.first, self.first[1:], strict=False)
            for r in range(low, high)
            if g.name == name
        ]

    def column(self, kind: ParameterKind) -> np.ndarray:
        return np.array([c for c, p in enumerate(self.network.layout.parameters) if p.kind is kind], dtype=int)

    def solved(self, common: Common, more: float) -> tuple[Network, LeastSquaresSolution]:
        """The network with so many times its shots: noise and electronics averaged, what lasts kept."""
        groups = [*self.groups]
        electronics = set(self.column(ParameterKind.ELECTRONICS).tolist())
        ppm = path_ppm(self.network)
        for i, part in enumerate(self.parts):
            g = groups[i]
            lines = [Parameter(ParameterKind.REPEATS, part.name, t) in self.network.layout.at for t in part.target]
            path = np.where(lines, 0.0, (ppm * PPM * part.distance) ** 2)
            walks = np.isin(g.nuisance, list(electronics))
            slopes = np.where(walks, g.coefficient / np.sqrt(more), g.coefficient)
            groups[i] = replace(g, covariance=(g.covariance - path) / more + path, coefficient=slopes)
        border = self.network.border
        solution = adjust(
            self.x,
            groups,
            free=np.array(self.network.layout.free),
            active=self.active,
            solver=SolverSettings(iterations=1, border=border and Border(border.columns, border.fine)),
        )
        moved = solution.q.solve(common.of.T)
        gain = np.zeros((len(common.names), self.first[-1]))
        for g, on, low, high in zip(groups, self.active, self.first, self.first[1:], strict=False):
            rows = ActiveRows.of(g, on)
            design = np.where(on[:, None], rows.spread(g.predict(self.x)[1]), 0.0)
            if rows.columns.ndim == 1:
                reach = design @ moved[rows.columns]
            else:
                at = rows.row_columns()
                held = np.where(at < 0, 0.0, design)
                reach = sum(held[:, j : j + 1] * moved[at[:, j]] for j in range(at.shape[1]))
            gain[:, low:high] = np.where(on[:, None], rows.weigh(reach), 0.0).T
        u = np.sqrt(np.sum(common.of * moved.T, axis=1))
        return Network(gain, u, more), solution


@dataclass(frozen=True)
class Effect:
    """Something that the reduction neglects.

    size   of it, with its unit
    of     what it does to the common parameters
    done   what the reduction does about it, or should
    """

    name: str
    size: str
    of: Answer
    done: str


def fixed(d: np.ndarray) -> Answer:
    return lambda n: n.of(d)


def either(parts: Sequence[np.ndarray]) -> Answer:
    """The worst phase of a wave, from its sine and its cosine."""
    return lambda n: np.hypot(*(n.of(d) for d in parts))


def at_random(sigma: np.ndarray, *, anew: bool = False) -> Answer:
    return lambda n: n.at_random(sigma, anew=anew)


def in_groups(d: np.ndarray, labels: np.ndarray) -> Answer:
    return lambda n: n.in_groups(d, labels)


def air_effects(s: Night) -> Iterator[Effect]:
    c, hpa, percent = s.per_unit["c"], s.per_unit["hpa"], s.per_unit["percent"]
    z = s.nodes[0][..., 2]
    temperature, pressure, humidity = s.state(z)
    heights = s.network.field.heights
    level = "level of the air"

    nodes, air_module.NODES = air_module.NODES, NODES
    fine = s.along()
    air_module.NODES = nodes
    yield Effect("quadrature", "5 nodes for 40", fixed(s.distance * (fine - s.index + 1.0)), "nothing")

    layer = -np.exp(-np.maximum(z, heights.min()) / 10.0)
    at = -np.exp(-np.maximum(heights, heights.min()) / 10.0)
    low, high = np.argmin(heights), np.argmax(heights)
    line = at[low] + (z - heights[low]) * (at[high] - at[low]) / (heights[high] - heights[low])
    yield Effect(
        "cold layer, 10 m",
        "1 °C at the ground",
        fixed(c * s.mean(layer - line)),
        "no, the bend has 0.03 °C: a shape exp(-z/10 m), 0.5 °C",
    )

    yield Effect(
        "pressure by 0.11 hPa/m", "1.5 % at 0 °C", fixed(_lapse(s, temperature, hpa)), "no: `hydrostatic_pressure_hpa`"
    )

    vapour = vapour_pressure_hpa(*s.state(np.full(len(z), heights.mean())))
    wet = relative_humidity_percent(np.broadcast_to(vapour[:, None], z.shape), temperature, pressure)
    yield Effect(
        "humidity even in % upwards",
        "even in hPa",
        fixed(percent * s.mean(wet - humidity)),
        "considered",
    )

    yield Effect("hygrometers, in common", "2 %", fixed(2.0 * percent), "thermometers' offsets")
    yield Effect("humidity of fog", "1 % above 100", fixed(percent), "nothing")
    yield Effect("droplets of fog", "0.05 g/m³", fixed(1.5 * 5e-8 * 0.206 * s.distance), "thermometers' offsets")
    yield Effect("barometers, in common", "0.1 hPa", fixed(0.1 * hpa), "thermometers' offsets")
    yield Effect("stations' heights", "0.1 m", fixed(0.1 * LAPSE_HPA_PER_M * hpa), "nothing")
    yield Effect("formula of the index", "5·10⁻⁸", fixed(5e-8 * s.distance), "thermometers' offsets")
    other = s.along(model="ciddor_hill1999") - s.along()
    yield Effect("Ciddor's air for Rüeger's", _ppm(other), fixed(s.distance * other), "thermometers' offsets")
    redder = s.along(wavelength_um=s.network.field.wavelength_um + 1e-4) - s.along()
    yield Effect("wavelength", "0.1 nm", fixed(s.distance * redder), "thermometers' offsets")
    warmer = s.along(wavelength_um=s.network.field.wavelength_um + 2.5e-3) - s.along()
    yield Effect(
        "wavelength, each head its own",
        f"2.5 nm, {_ppm(warmer)}",
        in_groups(s.distance * warmer, s.ranger),
        "considered",
    )
    middle = s.state(0.5 * (s.a[:, 2] + s.b[:, 2]))
    more, less = (s.refractivity(*middle, model="ciddor_hill1999", co2_ppm=v) for v in (500.0, 450.0))
    yield Effect("carbon dioxide", "50 ppm", fixed(s.distance * (more - less)), "thermometers' offsets")
    uneven = 0.5 * 0.5**2 * s.distance * sum(s.refractivity(middle[0] + t, *middle[1:]) * f for t, f in _SECOND)
    yield Effect("index of the mean for the mean", "0.5 °C along the path", fixed(uneven), "nothing")

    knots = s.network.field.knots.level
    yield Effect(
        "air between the knots", "0.1 °C, 10 min", either([0.1 * c * w for w in s.wave(600.0, knots)]), "eddies"
    )
    times = s.network.field.seconds(np.unique(s.campaign.weather.mjd_utc))
    grid = np.arange(times.min(), times.max() + 60.0, 60.0)
    yield Effect(
        "record between its states", "0.1 °C, 10 min, 60 s", either([0.1 * c * w for w in s.wave(600.0, grid)]), level
    )
    w = TWO_PI / 600.0
    rate = 60.0 * w * 0.1 * (1.0 - np.sin(w * 60.0) / (w * 60.0))
    slow = [rate * c * f(w * s.seconds) for f in (np.cos, np.sin)]
    yield Effect("rate of a lagging thermometer", "60 s, wave of 10 min", either(slow), level)
    reading = np.searchsorted(times, s.seconds)
    rounding = np.sqrt((0.01 * c) ** 2 + (0.01 * hpa) ** 2 + (0.1 * percent) ** 2) * UNIFORM / np.sqrt(len(heights))
    yield Effect("weather as rounded", "0.01 °C, 0.01 hPa, 0.1 %", in_groups(rounding, reading), level)

    square = np.sum(s.nodes[0][..., :2] ** 2, axis=2) / 100.0**2
    where = np.sum(s.network.field.places**2, axis=1) / 100.0**2
    bowl = s.mean(square) - where.mean()
    yield Effect("air warmer all around", "0.1 °C at 100 m", fixed(0.1 * c * bowl), "thermometers' offsets")
    plate = np.isin(s.body, ["dish"]) * 5.0 / s.distance * (1.0 - np.exp(-s.distance / 5.0))
    yield Effect("air cold on the dish", "0.3 °C, within 5 m", fixed(-0.3 * c * plate), "no")
    within = (s.own_body == "arm") & np.isin(s.body, ["dish", "arm"])
    yield Effect(
        "air within the dish another", "0.05 °C", fixed(0.05 * c * within), "no: a level of the air within the dish"
    )
    yield Effect("eddies that last", "0.03 ppm for 60 s", lambda n: _lasting(n, s), "independent at each shot")
    yield Effect("lines that are neighbours", "5 m", lambda n: _neighbours(n, s), "considered, six shapes a ranger")
    yield Effect("strength of the lines' fluctuation", "20 %", lambda n: _lines(n, s, 0.2), "u itself: 5 % larger")
    bent = excess_bound(index_gradient(0.1), s.distance)
    yield Effect("bending of the ray", "0.1 °C/m", fixed(-bent), "nothing")
    curved = np.sum(s.nodes[0][..., :2] ** 2, axis=2) / (2.0 * 6.371e6)
    yield Effect(
        "level surfaces are curved", "1 mm at 120 m", fixed((s.weather[1] * c - 0.11 * hpa) * s.mean(curved)), "nothing"
    )
    plumb = 5.0 * ARCSECOND * s.mean(s.nodes[0][..., 0])
    yield Effect("plumb line", "5″", fixed((s.weather[1] * c - 0.11 * hpa) * plumb), "east, north")


_SECOND = ((1.0, 1.0), (0.0, -2.0), (-1.0, 1.0))  # °C and weights of a second difference


def _signed(value: float, unit: str, digits: int = 2) -> str:
    return f"{value:+.{digits}f} {unit}".replace("-", "−")


def _ppm(change: np.ndarray) -> str:
    return _signed(float(np.mean(change)) / PPM, "ppm")


def _lapse(s: Night, temperature: np.ndarray, hpa: np.ndarray) -> np.ndarray:
    """Pressure by weight of the night's air, less that of the constant lapse."""
    heights, z = s.network.field.heights, s.nodes[0][..., 2]
    warm, _, (p, h) = *s.weather[:2], s.weather[2].T
    vapour = vapour_pressure_hpa(warm, p, h)
    own = hydrostatic_pressure_hpa(
        p[:, None], 0.5 * (temperature + warm[:, None]), heights.mean(), z_to=z, vapour_pressure_hpa=vapour[:, None]
    )
    at = [
        hydrostatic_pressure_hpa(p, warm, heights.mean(), z_to=e, vapour_pressure_hpa=vapour) for e in heights
    ]  # the mean of the barometers is not the pressure at their mean height
    return hpa * s.mean(own - s.state(z)[1] - (np.mean(at, axis=0) - p)[:, None])


def _lasting(n: Network, s: Night) -> np.ndarray:
    """Eddies that each ranger's shots share for a minute: what the neighbours' correlation adds."""
    more = np.zeros(len(n.u))
    for name in np.unique(s.ranger):
        mine = np.flatnonzero(s.ranger == name)
        own = n.gain[:, mine] * 0.03 * PPM * s.distance[mine]
        apart = np.abs(s.seconds[mine][:, None] - s.seconds[mine])
        more += np.sum(own @ (np.exp(-apart / 60.0) - np.eye(len(mine))) * own, axis=1)
    return np.sqrt(np.abs(more))


def _line_gain(n: Network, s: Night) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a ppm of each line does (k, lines); the lines' rangers and ends."""
    line, first, number = np.unique(np.stack([s.ranger, s.target]), axis=1, return_index=True, return_inverse=True)
    gain = np.zeros((len(n.u), line.shape[1]))
    np.add.at(gain.T, np.ravel(number), (n.gain[:, : len(s.k)] * PPM * s.distance).T)
    return path_ppm(s.network) * gain, line[0], s.b[first]


def _neighbours(n: Network, s: Night) -> np.ndarray:
    """Fluctuations that lines of one ranger share where their ends are near: what that correlation adds."""
    gain, ranger, ends = _line_gain(n, s)
    more = np.zeros(len(n.u))
    for name in np.unique(ranger):
        own, at = gain[:, ranger == name], ends[ranger == name]
        square = np.sum(at**2, axis=1)
        apart = np.sqrt(np.maximum(square[:, None] + square - 2.0 * at @ at.T, 0.0))
        alike = np.exp(-apart / 5.0)
        np.fill_diagonal(alike, 0.0)
        more += np.sum(own @ alike * own, axis=1)
    return np.sqrt(np.abs(more))


def _lines(n: Network, s: Night, more: float) -> np.ndarray:
    """A fluctuation of all lines that is so much stronger."""
    return np.sqrt(((1.0 + more) ** 2 - 1.0) * np.sum(_line_gain(n, s)[0] ** 2, axis=1))


def time_effects(s: Night) -> Iterator[Effect]:
    long = 64.0 / 500.0  # s, 128 cycles of 1 kHz
    later = s.along(s.mjd + 0.5 * long / SECONDS_PER_DAY) - s.along()
    yield Effect("middle of a buffer, the air", "64 ms", fixed(s.distance * later), "nothing")
    walk = s.campaign.site.ranging.electronic_drift_mrad_per_sqrt_hour * 1e-3 / 60.0
    within = np.full(len(s.k), abs(s.per_radian) * walk * np.sqrt(2.0 * long / 3.0))
    yield Effect("walk within a buffer", f"{within[0] * 1e6:.2f} µm a shot", at_random(within, anew=True), "nothing")
    cooling = np.full(len(s.k), 1e-9 * SECONDS_PER_DAY * UNIFORM) * np.abs(s.per_unit["c"]) / 3600.0
    yield Effect("times of shots as rounded", "10⁻⁹ d", at_random(cooling, anew=True), "nothing")
    yield Effect("clock of the stations", "2 s, 1 °C/h", fixed(2.0 / 3600.0 * s.per_unit["c"]), "lag of a thermometer")


def telescope_effects(s: Night) -> Iterator[Effect]:
    steel = STEEL_PER_K * s.hours[:, None]  # an hour of a clear night: 1 °C
    yield Effect(
        "arm expands 10 % more",
        "1 °C/h",
        fixed(s.by_body(lambda p, b: 0.1 * steel * p * (b == "arm")[:, None])),
        "arm scale, a part of the telescope's motion",
    )
    turn = 0.05 * ARCSECOND * s.hours[:, None]
    on = ("dish", "arm", "alidade")
    about = np.array([0.0, 0.0, 1.0])
    yield Effect(
        "telescope turns",
        "0.05″/h",
        fixed(s.by_body(lambda p, b: turn * np.cross(about, p) * np.isin(b, on)[:, None])),
        "turn and tilts, parts of the telescope's motion",
    )
    azimuth = s.campaign.site.campaign.azimuth_deg * DEGREE
    axis, height = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0]), np.array([0.0, 0.0, 48.26])
    yield Effect(
        "telescope sinks in elevation",
        "0.05″/h",
        fixed(s.by_body(lambda p, b: turn * np.cross(axis, p - height) * np.isin(b, on[:2])[:, None])),
        "turn and tilts, parts of the telescope's motion",
    )
    dish = s.b[s.body == "dish"]
    axes = np.linalg.svd(dish - dish.mean(axis=0), full_matrices=False)[2]

    def bends(p: np.ndarray, b: np.ndarray) -> np.ndarray:
        u, v = ((p - dish.mean(axis=0)) @ axes[:2].T / 50.0).T
        return (20e-6 * s.hours * (u**2 - v**2) * (b == "dish"))[:, None] * axes[2]

    yield Effect("dish bends", "20 µm/h at the rim", fixed(s.by_body(bends)), "bends, parts of the telescope's motion")
    knots = s.network.processes.telescope
    if knots is not None:
        at = np.sort(np.append(knots.knots, 0.0)) + s.network.field.seconds(np.array([s.network.middle_mjd]))
        waves = [
            s.by_body(lambda p, b, w=w: 0.04 * STEEL_PER_K * w[:, None] * p * np.isin(b, on)[:, None])
            for w in s.wave(2400.0, at)
        ]
        yield Effect(
            "expansion between its knots",
            "0.04 °C of steel, 40 min",
            either(waves),
            "no: knots of 600 s, or what is between as a variance",
        )
    sway = np.where(s.body != s.own_body, 20e-6, 0.0)
    yield Effect("sway of the arm", "20 µm", at_random(sway, anew=True), "eddies' strength takes it, in ppm")


def signal_effects(s: Night) -> Iterator[Effect]:
    layout = s.network.layout
    at = [layout.columns(Parameter(ParameterKind.LEAKAGE, r), 2) for r in s.ranger]
    rest = s.x[np.array(at)] @ np.array([1.0, 1j])
    second = sum(sign * (np.angle(1.0 - rest / p) + np.imag(rest / p)) for sign, p in ((1.0, s.phasor), (-1.0, s.cube)))
    yield Effect("leakage to second order", "0.8 mV", fixed(s.per_radian * second), "nothing")
    weak = -0.5e-3 * (s.noise_volt / np.abs(s.phasor)) ** 2
    yield Effect("noise of the amplitude", "1 mrad a factor e", fixed(s.per_radian * weak), "nothing")
    strong = np.log(np.abs(s.phasor) / np.abs(s.cube))
    yield Effect(
        "amplitude to phase, no sheet",
        "0.1 mrad a factor e",
        in_groups(1e-4 * s.per_radian * strong, s.ranger),
        "a parameter where u_amplitude_to_phase_rad is given; else none",
    )
    yield Effect(
        "cyclic, no sheet",
        "1 µm",
        lambda n: np.hypot(*(n.in_groups(1e-6 * f(s.phase), s.ranger) for f in (np.cos, np.sin))),
        "no, unless u_cyclic_mm is given",
    )
    slopes = _axes(s)
    for size, name, done in (
        (1e-6 * UNIFORM, "axes that do not meet, as rounded", "nothing"),
        (10e-6, "axes that do not meet, no sheet", "a parameter where u_axis_mm is given; else they meet"),
    ):
        yield Effect(
            name,
            "1 µm" if size < 1e-6 else "10 µm",
            lambda n, size=size: np.sqrt(sum(n.in_groups(size * d, s.ranger) ** 2 for d in slopes.T)),
            done,
        )
    yield Effect(
        "electronics' weak modes",
        f"{_weakest(s):.2f} of the noise",
        lambda n: _modes(n, s),
        "u itself: 1 % larger",
    )
    yield Effect("strength of the electronics' walk", "20 %", lambda n: _walk(n, s, 0.2), "u itself: 4 % larger")
    yield Effect("warm-up between references", "20 mrad, 300 s, 1 in 3", fixed(_warming(s)), "nothing")
    yield Effect(
        "each shot weighed by its own scatter",
        "127 degrees",
        lambda n: _weights(n, s),
        "u itself: 1 % larger",
    )
    bow = 2.0 * 2.0 ** -(s.campaign.site.adc.bits - 1) * 0.002 * np.abs(s.phasor) / s.campaign.site.adc.full_scale_volt
    step = s.campaign.site.adc.full_scale_volt / 2.0 ** (s.campaign.site.adc.bits - 1)
    spread = s.noise_volt * np.sqrt(128 * 64 / 2.0)  # of single samples
    steps = step / np.abs(s.phasor) * np.exp(-2.0 * (np.pi * spread / step) ** 2)  # noise smears the staircase
    yield Effect("converter's steps", "0.3 mV", fixed(s.per_radian * steps), "nothing")
    yield Effect("converter's bow", "2 steps", fixed(s.per_radian * bow), "nothing")
    yield Effect("modulation frequency", "10⁻⁹", fixed(1e-9 * s.index * s.distance), "thermometers' offsets")
    stray = 0.01 * np.concatenate([f.sigma for f in s.solution.fits[: len(s.parts)]])
    yield Effect("stray light below the limit", "2 % of shots, +0.5 σ", fixed(stray), "self_check")


def _axes(s: Night) -> np.ndarray:
    """Derivatives (m, 4) of optical lengths by a mirror's offsets; the reference cube's own are constant.

    The azimuth axis is taken as level, across the mean sight: how the arm's mounts are turned is on no sheet.
    """
    slopes = np.zeros((len(s.k), 4))
    for name in np.unique(s.ranger):
        mine = np.flatnonzero(s.ranger == name)
        sight = -s.towards[mine]
        mean = sight.mean(axis=0)
        up = np.array([0.0, 0.0, 1.0])
        z = np.cross(mean, up) / np.linalg.norm(np.cross(mean, up))
        theta, phi = direction_angles(sight @ np.stack([np.cross(up, z), up, z]).T)
        by = path_change(theta, phi, s.distance[mine], np.zeros(4))[1]
        slopes[mine] = s.index[mine, None] * by
    return slopes


def _weakest(s: Night) -> float:
    return max((states.neglected for states in s.network.states.values()), default=0.0)


def _modes(n: Network, s: Night) -> np.ndarray:
    """What the correlation within modes adds that each shot's own variance does not have."""
    more = np.zeros(len(n.u))
    for name, states in s.network.states.items():
        electronics = s.network.electronics[name]
        mine = np.flatnonzero(s.ranger == name)
        path = path_ppm(s.network) * PPM * s.distance[mine] / s.per_radian
        every = electronics.walk.states(s.network.phases.u_phase[electronics.shots] ** 2 + path**2)
        first = every.count - len(every.strength)
        weak = np.flatnonzero(every.strength <= states.neglected)
        loads = s.per_radian * np.where(np.isin(every.columns, first + weak), every.slopes, 0.0)
        both = np.zeros((len(n.u), every.count))
        for j in range(loads.shape[1]):
            np.add.at(both.T, every.columns[:, j], (n.gain[:, mine] * loads[:, j]).T)
        more += np.sum(both**2, axis=1) - n.gain[:, mine] ** 2 @ (s.per_radian**2 * states.own)
    return np.sqrt(np.abs(more) / n.more)


def _walk(n: Network, s: Night, more: float) -> np.ndarray:
    """A walk that is so much stronger, between the reference shots."""
    own = np.concatenate([s.network.states[p.name].own for p in s.parts]) * s.per_radian**2
    variance = n.gain[:, : len(own)] ** 2 @ own / n.more
    variance += np.sum(n.gain[:, s.rows("electronics between references")] ** 2, axis=1)
    return np.sqrt(((1.0 + more) ** 2 - 1.0) * variance)


def _warming(s: Night) -> np.ndarray:
    """A transient of every third head, less what its references say of it."""
    d = np.zeros(len(s.k))
    shots = s.campaign.shots
    target, ranger = np.array(shots.target), np.array(shots.ranger)
    for name in s.network.rangers[::3]:
        mine = np.flatnonzero(s.ranger == name)
        walk = s.network.electronics[name].walk
        start = s.network.field.seconds(shots.mjd_utc[(ranger == name) & (target == REFERENCE)]).min()
        origin = s.seconds[mine][0] - walk.seconds[0]

        def rise(seconds: np.ndarray, start: float = start) -> np.ndarray:
            return 0.02 * np.exp(-(seconds - start) / 300.0)

        told = drift_along(
            walk.reference_seconds,
            rise(walk.reference_seconds + origin),
            walk.reference_variance,
            time=walk.seconds,
            random_walk=walk.random_walk,
        )[0]
        d[mine] = s.per_radian * (rise(s.seconds[mine]) - told)
    return d


def _weights(n: Network, s: Night) -> np.ndarray:
    """Noise of each ranger as its shots have it together, less what each shot says of itself."""
    more = np.zeros(len(s.k))
    for name in np.unique(s.ranger):
        mine = s.ranger == name
        more[mine] = np.mean(s.noise_volt[mine] ** 2) - s.noise_volt[mine] ** 2
    more *= (s.per_radian / np.abs(s.phasor)) ** 2
    return np.sqrt(np.abs(n.gain[:, : len(more)] ** 2 @ more) / n.more)


def target_effects(s: Night) -> Iterator[Effect]:
    ranging = s.campaign.site.ranging
    ratio, height = ranging.bk7_to_air_group_index_ratio, np.where(s.prism, s.glass, 0.0)
    glass = glass_named("BK7-old")
    per_k = s.glass * (float(temperature_slopes(ranging.wavelength_um).group) + ratio * glass.expansion)
    warm = s.weather[0] - glass.reference_c
    yield Effect(
        "glass colder than its sheet's",
        _signed(np.mean(warm), "K", 0),
        fixed(per_k * warm),
        "considered, where site.toml says sheets_at_c; else u of the constants covers it",
    )
    standard = s.refractivity(np.array(20.0), np.array(933.0), np.array(50.0))
    thin = s.index - 1.0 - standard
    yield Effect("glass over air of 20 °C, 933 hPa", _ppm(thin), fixed(-ratio * s.glass * thin), "no")
    yield Effect(
        "index ratio of the memo",
        "4.3·10⁻⁴ too low",
        fixed(4.3e-4 * s.glass),
        "considered, where site.toml says glass_index_ratio",
    )
    at = [s.refractivity(*s.state(p[:, 2])) for p in (s.a, s.b)]
    path = s.mean(s.refractivity(*s.state(s.nodes[0][..., 2])))
    d0 = np.array([s.campaign.mirror_of(r).d0_mm for r in s.ranger]) * MILLIMETRE
    yield Effect("D0 in the path's air", _ppm(path - at[0]), fixed(d0 * (path - at[0])), "zeros")
    yield Effect("glass in the path's air", _ppm(path - at[1]), fixed(s.constant * (path - at[1])), "nothing")
    cosine = np.cos(np.minimum(s.incidence, 0.5 * np.pi))
    two, one = (obliquity_correction(height, ratio, cosine, phase=phase) for phase in (PHASE_RATIO, None))
    given = ranging.bk7_to_air_phase_index_ratio is not None
    yield Effect(
        "refraction by the group index",
        "appendix B",
        fixed(np.where(s.prism, -s.index * (two - one), 0.0) * (not given)),
        "if bk7_to_air_phase_index_ratio is given",
    )
    tilts = s.column(ParameterKind.NORMAL)
    first, bend = _tilted(s, tilts)
    rounding = 1e-5 * UNIFORM * first
    label = np.where(s.prism, np.unique(s.target, return_inverse=True)[1], -1)
    yield Effect(
        "normals as rounded", "10⁻⁵", lambda n: np.sqrt(sum(n.in_groups(d, label) ** 2 for d in rounding)), "nothing"
    )
    across = np.array(
        [s.network.places[t].across if on else np.zeros((2, 3)) for t, on in zip(s.target, s.prism, strict=True)]
    )
    up = 0.1 * DEGREE * np.sum(first * across[:, :, 2].T, axis=0)
    yield Effect("normals higher, in common", "0.1°", fixed(up), "each its own")
    yield Effect("tilts to second order", "0.1°", fixed(bend), "nothing")
    yield Effect(
        "heights of glass, 100 prisms in common",
        "2 µm",
        in_groups(*_batches(s, ratio)),
        "considered, 100 by serial order",
    )
    each = np.unique(s.target, return_inverse=True)[1]
    yield Effect(
        "constants of glass as rounded", "0.1 µm", in_groups(s.index * 1e-7 * UNIFORM * (s.glass > 0.0), each), "glass"
    )
    radius = s.index * 3e-6 * np.hypot(ratio - 1.0, ratio) * (~s.prism & (s.glass > 0.0))
    yield Effect("radii of balls, in common", "3 µm", fixed(radius), "no: each its own")
    yield Effect("heights of all glass, in common", "2 µm", fixed(s.index * ratio * 2e-6 * s.prism), "no: each its own")
    yield Effect("D0 of one bench, in common", "10 µm", fixed(s.index * 1e-5), "considered")
    yield Effect(
        "D0 colder than calibrated",
        _signed(np.mean(warm), "K", 0),
        fixed(s.index * d0 * STEEL_PER_K * warm),
        "considered, where site.toml says sheets_at_c; else u_d0 covers it",
    )
    yield Effect("D0 as rounded", "1 µm", in_groups(s.index * 1e-6 * UNIFORM, s.ranger), "zeros")
    yield Effect(
        "D0 expands with its head",
        "1 °C/h",
        fixed(s.index * d0 * STEEL_PER_K * s.hours),
        "considered, where site.toml says sheets_at_c; else u_d0 covers it",
    )


def _tilted(s: Night, tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (2, m) of optical lengths by two tilts of the faces, and E[second order] at what is known of them."""
    variance = s.solution.q.diagonal()
    step = 1e-3
    first, bend = [], np.zeros(len(s.k))

    def obliquity(x: np.ndarray) -> np.ndarray:
        return np.concatenate([shot_group(s.network, n, x)[1].obliquity for n in s.network.rangers])

    here = obliquity(s.x)
    groups = [Parameter(ParameterKind.NORMAL, s.network.places[t].group) for t in s.target]
    own = np.array([s.network.layout.at.get(g, -1) for g in groups])
    for part in range(2):
        up, down = (s.x.copy() for _ in range(2))
        up[tilts[part::2]] += step
        down[tilts[part::2]] -= step
        above, below = obliquity(up), obliquity(down)
        first.append(-s.index * (above - below) / (2.0 * step))
        u2 = np.where(own < 0, 0.0, variance[own + part])
        bend -= s.index * 0.5 * u2 * (above - 2.0 * here + below) / step**2
    return np.array(first), bend


def _batches(s: Night, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """What 2 um of glass do, and the batch of each prism, a hundred by serial order."""
    names = sorted({t for t, p in zip(s.target, s.prism, strict=True) if p})
    lot = {name: i // 100 for i, name in enumerate(names)}
    return s.index * ratio * 2e-6 * s.prism, np.array([lot.get(t, -1) for t in s.target])


def survey_effects(s: Night) -> Iterator[Effect]:
    every = np.zeros(s.first[-1])

    def on(rows: Sequence[int], value: float | np.ndarray) -> np.ndarray:
        d = every.copy()
        d[rows] = value
        return d

    survey, offsets, marks = (s.rows(name) for name in ("monuments", "mirror offsets", "benchmarks"))
    micron = 1e-6 * UNIFORM
    yield Effect("monuments as rounded", "1 µm", at_random(on(survey, micron)), "monuments' u")
    yield Effect("mirror offsets as rounded", "1 µm", at_random(on(offsets, micron)), "offsets' u")
    yield Effect("angles of mounts as rounded", "10⁻⁷ rad", at_random(on(offsets, 0.25e-7 * UNIFORM)), "offsets' u")
    yield Effect("angles of mounts", "2″", at_random(on(offsets, 0.25 * 2.0 * ARCSECOND)), "offsets' u, 5 µm")
    cold = s.weather[0].mean() - 20.0
    arm = on(offsets[2::3], 0.25 * STEEL_PER_K * cold)
    yield Effect(
        "mirror offsets colder than measured",
        _signed(cold, "K", 0),
        fixed(arm),
        "considered, where site.toml says sheets_at_c; else u_offset covers it",
    )
    yield Effect("certificates as rounded", "1 µm", at_random(on(marks, micron)), "benchmarks' u")
    lengths = np.array([g.observed[0] for g in s.groups if g.name == "benchmarks"])
    yield Effect(
        "certificates, in common",
        "10⁻⁷",
        fixed(on(marks, 1e-7 * lengths)),
        "considered, where site.toml says certificate_scale_ppm",
    )
    lengths = on(survey, 0.5e-6 * np.concatenate([g.observed for g in s.groups if g.name == "monuments"]))
    yield Effect(
        "survey's scale",
        "0.5 ppm",
        fixed(lengths),
        "considered, where site.toml says survey_scale_ppm; else each errs by itself",
    )
    units = [s.network.places[t.left_prism.target] for t in s.campaign.triplets.values()]
    along = on(s.rows("triplet balls"), 2e-5 * np.concatenate([p.normal for p in units]))
    yield Effect("triplets' heights, in common", "20 µm", fixed(along), "considered")
    typed = s.rows("approximate positions")
    yield Effect("positions as typed", "0.1 mm", at_random(on(typed, 1e-4 * UNIFORM)), "positions' u")


@dataclass(frozen=True)
class Row:
    """An effect as the table has it: shares of u, of all that is common and of places alone."""

    effect: Effect
    worst: tuple[float, float]
    which: tuple[str, str]
    place: tuple[float, float]

    @property
    def open(self) -> bool:
        """Above the limit, and neither a parameter nor a variance."""
        return self.worst[0] > LIMIT and self.effect.done.startswith("no")


def rows_of(effects: Sequence[Effect], networks: Sequence[Network], common: Common) -> list[Row]:
    table = []
    for effect in effects:
        shares = [effect.of(n) / n.u for n in networks]
        best = [int(np.argmax(share)) for share in shares]
        table.append(
            Row(
                effect,
                (float(shares[0].max()), float(shares[1].max())),
                (common.names[best[0]], common.names[best[1]]),
                (float(shares[0][common.place].max()), float(shares[1][common.place].max())),
            )
        )
    return sorted(table, key=lambda r: -r.worst[0])


def settled_night(prisms: int, directory: str, span: float) -> SettledNetwork:
    """A simulated night, calm, as the reduction settles it."""
    where = Path(directory) / f"night-{prisms}-{span:.0f}"
    if not where.exists():
        night = simulate_night(
            SEED,
            telescope=SimulatedTelescope(dish_prisms=prisms),
            schedule=Schedule(interval_s=8.0, again=0.43, span_s=span),
        )
        write_night(night, where)
        del night
    campaign, settings = read_campaign(where), ReductionSettings()
    phases = measure_phases(campaign, settings)
    caught: list[SettledNetwork] = []
    told, coordinates.coordinates_of = coordinates.coordinates_of, lambda settled, resolved: caught.append(settled)
    with threadpool_limits(limits=1, user_api="blas"):
        electronics, _ = follow_electronics(campaign, phases, settings.dense_shots)
        coordinates.adjust_coordinates(campaign, phases, electronics, settings=settings)
    coordinates.coordinates_of = told
    return caught[-1]


def table_of(rows: Sequence[Row]) -> str:
    """As the page has it."""
    lines = [
        "| effect | size | run | of | computed | of | places alone | what is done |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        name = f"**{r.effect.name}**" if r.open else r.effect.name
        run, computed, place = (_share(v) for v in (*r.worst, r.place[0]))
        cells = (name, r.effect.size, run, r.which[0], computed, r.which[1], place, r.effect.done)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _share(value: float) -> str:
    """Two digits, and not more than four decimals."""
    if value < 1e-4:
        return "0"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(value))))}f}" if value >= 1e-2 else f"{value:.1g}"


def figure(rows: Sequence[Row]) -> str:
    """A dot chart as SVG text."""
    shown = list(reversed(rows))
    y = np.arange(len(shown))
    values = np.maximum([r.worst for r in shown], 1e-5)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(9.6, 0.19 * len(shown) + 1.2), layout="constrained")
        ax = drawn.subplots()
        ax.hlines(y, values[:, 0], values[:, 1], color=FAINT, lw=0.7)
        for i, (label, colour) in enumerate((("20 000 shots, run", SERIES[0]), ("200 000, computed", SERIES[1]))):
            ax.plot(values[:, i], y, "o", ms=4.0, color=colour, label=label)
        ax.axvline(LIMIT, color=BAD, lw=0.9, ls="--")
        ax.set_xscale("log")
        ax.set_xlim(0.7e-5, 2.0 * values.max())
        ax.set_ylim(-1.0, len(shown))
        ax.set_yticks(y, [f"{r.effect.name}: {r.effect.size}" for r in shown])
        ax.tick_params(axis="y", length=0, labelcolor=INK, labelsize=7.5)
        for label, r in zip(ax.get_yticklabels(), shown, strict=True):
            label.set_color(BAD if r.open else INK)
        ax.set_xlabel("largest change of a common parameter, in its u (at the left: 0.000 01 and less)")
        ax.set_title("What the reduction of a night neglects\ndashed: a tenth of u; red: above it, and not modelled")
        ax.legend(loc="lower right")
        return svg(drawn)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--prisms", type=int, default=2209)
    asked.add_argument("--out", default=str(Path(__file__).parents[1] / "docs" / "studies"))
    asked.add_argument("--night", help="where to keep the simulated night, or where it is")
    asked.add_argument("--span", type=float, default=3300.0, help="s, within which the ground's rangers begin")
    options = asked.parse_args()
    with tempfile.TemporaryDirectory() as own:
        study(settled_night(options.prisms, options.night or own, options.span), options.out)


def study(settled: SettledNetwork, out: str) -> list[Row]:
    """The table printed, the figure drawn."""
    if not settled.network.states:
        sys.exit("errors that shots share are no parameters of so few shots: take 200 prisms or more")
    night = Night(settled)
    common = Common.of_network(night.network, night.x)
    networks, moved = [], np.zeros(len(common.names))
    for more in (1.0, MORE):
        network, again = night.solved(common, more)
        networks.append(network)
        moved = moved if more > 1.0 else np.abs(common.of @ (again.x - night.x))
    effects = [
        *air_effects(night),
        *time_effects(night),
        *telescope_effects(night),
        *signal_effects(night),
        *target_effects(night),
        *survey_effects(night),
        Effect("one more pass", "settled to 0.1 u", lambda n: moved if n.more == 1.0 else moved * np.sqrt(n.more), "-"),
    ]
    rows = rows_of(effects, networks, common)
    say = sys.stdout.write
    say(f"{len(night.k)} shots used or tried, {int(sum(a.sum() for a in night.active[: len(night.parts)]))} used\n")
    for name, u, v in zip(common.names, networks[0].u, networks[1].u, strict=True):
        say(f"  u {name:18s} {u:.3g}  {v:.3g}\n")
    say(table_of(rows) + "\n")
    Path(out, "neglected.svg").write_text(figure(rows), encoding="utf-8")
    return rows


if __name__ == "__main__":
    main()
