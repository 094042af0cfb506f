"""The index along paths with its covariance, against atmospheres that are not made of the profile's own formulas."""

import numpy as np
import pytest

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.path.air_profile import AirProfile, WeatherReadings, shared_air
from catseye.atmosphere.path.mean import hydrostatic_pressure_hpa, nodes_along
from catseye.atmosphere.path.profile import HUMIDITY
from catseye.errors import EstimationError, ValidityError

KAPPA, ROUGHNESS, GROUND = 0.4, 0.05, -2.0


class BoundaryLayer:
    """Surface-layer similarity: log-linear on stable nights, Businger and Dyer's on unstable days, a daily wave,
    and frozen turbulence of exponential correlation carried by a wind. Drawn anew with each seed."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        self.night = bool(rng.integers(2))
        self.scale = abs(rng.normal(0, 0.08)) if self.night else -abs(rng.normal(0, 0.12))  # T*, K
        self.length = rng.uniform(40, 200) * (1 if self.night else -1)  # Obukhov's
        self.base, self.pressure, self.damp = rng.uniform(-5, 25), rng.uniform(900, 1000), rng.uniform(35, 75)
        self.waves = rng.normal(0, 2.0), rng.uniform(10_000, 30_000), rng.uniform(0, 2 * np.pi)
        self.grow = rng.uniform(-0.3, 0.3), rng.uniform(0, 2 * np.pi)
        k = rng.normal(size=(250, 3)) / np.abs(rng.normal(size=(250, 1))) / 20.0  # spectrum of exp(-r/20 m)
        self.k, self.phases, self.wind = k, rng.uniform(0, 2 * np.pi, 250), np.array([0.3, 0.1, 0.0])

    def turbulence(self, point, t):
        """0.15 °C of it; past a fixed place its correlation time is 20 m / 0.32 m/s = 63 s."""
        drifted = point - np.asarray(t)[..., None] * self.wind
        return 0.15 * np.sqrt(2.0 / len(self.k)) * np.cos(drifted @ self.k.T + self.phases).sum(axis=-1)

    def temperature(self, z, t):
        h = z - GROUND + ROUGHNESS
        if self.night:
            shape = np.log(h / ROUGHNESS) + 5.0 * np.minimum(h, self.length) / self.length
        else:
            x, x0 = np.sqrt(1 - 16 * h / self.length), np.sqrt(1 - 16 * ROUGHNESS / self.length)
            shape = np.log(h / ROUGHNESS) - 2.0 * np.log((1 + x) / (1 + x0))
        growth = 1.0 + self.grow[0] * np.sin(2 * np.pi * t / 9000.0 + self.grow[1])
        size, period, phase = self.waves
        wave = size * np.sin(2 * np.pi * t / period + phase)
        return self.base + wave + growth * self.scale / KAPPA * shape - 0.0098 * z

    def state(self, point, t):
        z = point[..., 2]
        warmth = self.temperature(z, t)
        column = 0.5 * (self.temperature(np.zeros(z.shape), t) + warmth)
        return (
            warmth + self.turbulence(point, t),
            hydrostatic_pressure_hpa(self.pressure, column, 0.0, z_to=z),
            self.damp,
        )

    def mean_index(self, a, b, t):
        share = (np.arange(60) + 0.5) / 60
        points = a[:, None] + share[:, None] * (b - a)[:, None]
        return group_refractivity(*self.state(points, np.broadcast_to(t[:, None], points.shape[:-1]))).mean(axis=1)


STATIONS = np.array([[90.0, 60.0, 0.0], [-120.0, 30.0, 8.0], [40.0, -90.0, 45.0]])


def weather(world, stations=STATIONS, every=120.0, until=3601.0):
    """Readings of stations at (s, 3) points, with offsets and noise as the priors say."""
    rng = world.rng
    t, s = np.meshgrid(np.arange(0.0, until, every), np.arange(len(stations)), indexing="ij")
    t, s = t.ravel(), s.ravel()
    warmth, pressure, damp = world.state(stations[s], t)
    offset = rng.normal(size=(3, len(stations)))
    noise = rng.normal(size=(3, t.size))
    return WeatherReadings(
        t,
        stations[s, 2],
        s,
        warmth + 0.3 * offset[0, s] + 0.05 * noise[0],
        pressure + 0.2 * offset[1, s] + 0.05 * noise[1],
        damp + 2.0 * offset[2, s] + 0.5 * noise[2],
        np.ones(t.size, dtype=int),
    )


def ways(rng, m):
    """Paths as rangers': from near the ground to a structure."""
    angle = rng.uniform(0, 2 * np.pi, m)
    a = np.stack([110 * np.cos(angle), 110 * np.sin(angle), rng.uniform(-1, 1, m)], axis=1)
    return a, np.stack([*rng.uniform(-40, 40, (2, m)), rng.uniform(0, 100, m)], axis=1)


def squares(seeds, stations=STATIONS, until=3601.0):
    """Squared departures over claimed variances: of each path's mean, of differences between paths, jointly."""
    one, apart, joint = [], [], []
    for seed in seeds:
        world = BoundaryLayer(seed)
        profile = AirProfile.of(weather(world, stations, until=until), ground=GROUND)
        a, b = ways(world.rng, 8)
        t = world.rng.uniform(0.0, 3600.0, 8)
        t[4:] = t[:4]  # some at the same time
        found = profile.along(t, a, b)
        wrong = found.refractivity - world.mean_index(a, b, t)
        one.append(np.mean(wrong**2 / np.diag(found.covariance)))
        joint.append(wrong @ np.linalg.solve(found.covariance, wrong) / 8)
        gap = np.eye(8)[:4] - np.eye(8)[4:]
        apart.append(np.mean((gap @ wrong) ** 2 / np.diag(gap @ found.covariance @ gap.T)))
    return np.mean(one), np.mean(apart), np.mean(joint)


def test_the_claimed_covariance_is_the_scatter_in_boundary_layers_that_it_does_not_know():
    one, apart, joint = squares(range(40))
    # expectation 1 if the priors were these atmospheres' own; 40 draws of mostly common error scatter by 0.2
    assert 0.5 < one < 1.6
    assert 0.5 < apart < 1.6
    assert 0.6 < joint < 1.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stations", "until"),
    [(STATIONS, 3601.0), (STATIONS[:2], 3601.0), (STATIONS[:1], 3601.0), (STATIONS, 1801.0)],
    ids=["three stations", "two low ones", "one", "half of the time only"],
)
def test_the_claimed_covariance_is_the_scatter_in_a_long_run(stations, until):
    one, apart, joint = squares(range(100, 400), stations, until)
    assert 0.4 < one < 1.3  # these worlds are a little kinder than the priors
    assert 0.4 < apart < 1.3
    assert 0.6 < joint < 1.3


def still_weather(temperature=15.0, pressure=930.0, humidity=50.0, heights=(0.0, 45.0)):
    """Two stations that agree, an hour; values (stations,) or one."""
    t, s = np.meshgrid(np.arange(0.0, 3601.0, 300.0), np.arange(len(heights)), indexing="ij")
    t, s = t.ravel(), s.ravel()
    columns = (np.broadcast_to(v, len(heights))[s].astype(float) for v in (temperature, pressure, humidity))
    return WeatherReadings(t, np.array(heights)[s], s, *columns, np.ones(t.size, dtype=int))


UP = np.array([[0.0, 0.0, 0.0]]), np.array([[30.0, 0.0, 100.0]])


def test_in_air_at_rest_of_one_temperature_the_mean_is_that_of_the_exponential():
    upper = hydrostatic_pressure_hpa(930.0, 15.0, 0.0, z_to=45.0)
    profile = AirProfile.of(still_weather(pressure=(930.0, upper), humidity=0.0), ground=GROUND)
    found = profile.along([1800.0], *UP)
    z = (np.arange(2000) + 0.5) / 20.0
    exact = group_refractivity(15.0, hydrostatic_pressure_hpa(930.0, 15.0, 0.0, z_to=z), 0.0).mean()
    assert found.refractivity[0] == pytest.approx(exact, abs=2e-12)
    assert found.temperature_c[0] == pytest.approx(15.0, abs=1e-6)


def test_warmer_air_has_a_smaller_index_by_a_ppm_a_degree_and_a_higher_path_thinner_air():
    cold, warm = (AirProfile.of(still_weather(t), ground=GROUND) for t in (15.0, 16.0))
    change = warm.along([1800.0], *UP).refractivity - cold.along([1800.0], *UP).refractivity
    assert change[0] * 1e6 == pytest.approx(-0.93, abs=0.04)
    low = cold.along([1800.0], UP[0], UP[0] + [30.0, 0.0, 0.0]).refractivity
    assert low[0] - cold.along([1800.0], *UP).refractivity[0] > 1e-6  # 50 m of 0.11 hPa/m, 0.27 ppm/hPa


def test_covariance_is_positive_and_a_path_is_itself_from_either_end():
    world = BoundaryLayer(9)
    profile = AirProfile.of(weather(world), ground=GROUND)
    a, b = ways(world.rng, 20)
    t = world.rng.uniform(-600.0, 4200.0, 20)
    there, back = profile.along(t, a, b), profile.along(t, b, a)
    assert np.linalg.eigvalsh(there.covariance).min() > 0.0
    np.testing.assert_allclose(there.covariance, there.covariance.T, rtol=1e-9, atol=1e-24)
    np.testing.assert_allclose(there.refractivity, back.refractivity, rtol=1e-14)
    np.testing.assert_allclose(there.covariance, back.covariance, rtol=1e-6)
    same = profile.along([600.0, 600.0], np.tile(a[0], (2, 1)), np.stack([b[0], b[0]])).covariance
    assert same[0, 1] == pytest.approx(same[0, 0], rel=1e-12)


def test_a_sensor_without_readings_is_ignored():
    world = BoundaryLayer(10)
    whole = weather(world)
    gone = whole.station == 2
    broken = WeatherReadings(
        whole.seconds, whole.z, whole.station, whole.temperature_c,
        whole.pressure_hpa, np.where(gone, np.nan, whole.humidity_percent), whole.count,
    )  # fmt: skip
    a, b = ways(world.rng, 3)
    t = np.array([100.0, 1800.0, 3500.0])
    less, more = AirProfile.of(broken, ground=GROUND).along(t, a, b), AirProfile.of(whole, ground=GROUND).along(t, a, b)
    assert np.all(np.diag(less.covariance) > np.diag(more.covariance))
    assert np.all(np.abs(less.refractivity - more.refractivity) < 1e-7)  # humidity is worth 0.008 ppm a per cent
    none = WeatherReadings(*(getattr(broken, f) for f in ("seconds", "z", "station", "temperature_c", "pressure_hpa")),
                           np.full(whole.z.shape, np.nan), whole.count)  # fmt: skip
    with pytest.raises(EstimationError, match="humidity_percent was not read by any station"):
        AirProfile.of(none, ground=GROUND)


@pytest.mark.parametrize("humidity", [0.0, 100.0])
def test_fog_and_dry_air_are_humidities_too(humidity):
    found = AirProfile.of(still_weather(humidity=humidity), ground=GROUND).along([5000.0], *UP)
    assert np.isfinite(found.refractivity[0])


def test_local_air_along_a_path_is_the_closed_form_and_far_paths_share_none():
    length, d = 20.0, np.array([1.0, 20.0, 60.0, 100.0])
    a = np.array([[0.0, 1e4 * k, 0.0] for k in range(4)])
    b = a + d[:, None] * [0.6, 0.0, 0.8]
    shared = shared_air(a, b, length)
    exact = 2 * (length / d) ** 2 * (d / length - 1 + np.exp(-d / length))
    np.testing.assert_allclose(np.diag(shared), exact, rtol=0.04)
    assert np.all(np.diag(shared) >= exact)  # never less than is
    assert np.all(shared[~np.eye(4, dtype=bool)] < 1e-12)


def test_local_air_adds_its_own_share_and_no_more():
    """Two stations at rest, with and without local air on the paths; the readings weigh it the same."""
    profile = AirProfile.of(still_weather(), ground=GROUND)
    a, b = np.repeat(UP[0], 2, axis=0), np.repeat(UP[1], 2, axis=0)
    t, d = np.array([1800.0, 1860.0]), np.hypot(30.0, 100.0)
    found = profile.along(t, a, b)
    z, share = nodes_along(a[:, 2], b[:, 2], 8)
    smooth = profile.temperature.covariance(t, np.einsum("mkj,k->mj", profile.temperature.basis(z), share))
    one = 2 * (20.0 / d) ** 2 * (d / 20.0 - 1 + np.exp(-d / 20.0)) * 0.15**2
    local = found.covariance_c2 - smooth
    assert local[0, 0] == pytest.approx(one, rel=0.04)  # twelve nodes
    assert local[0, 1] == pytest.approx(local[0, 0] * np.exp(-1.0), rel=1e-6)  # a minute later
    # what differs between the two times is local air alone but for 2 %; slopes by differences at the middle of the path
    warmth, pressure, damp = (float(v[0, 0]) for v in profile.state([1800.0], [[50.0]]))
    per_c = group_refractivity(warmth + 0.5, pressure, damp) - group_refractivity(warmth - 0.5, pressure, damp)
    per_percent = (group_refractivity(warmth, pressure, damp + 5) - group_refractivity(warmth, pressure, damp - 5)) / 10
    together = local[0, 0] / 0.15**2 * (1.0 - np.exp(-1.0))
    expected = together * ((0.15 * per_c) ** 2 + (HUMIDITY.local * per_percent) ** 2)
    assert found.covariance[0, 0] - found.covariance[0, 1] == pytest.approx(float(expected), rel=0.02)


def test_a_path_below_the_ground_is_refused():
    profile = AirProfile.of(still_weather(), ground=GROUND)
    with pytest.raises(ValidityError, match="height above the ground"):
        profile.along([0.0], [[0.0, 0.0, -3.0]], [[10.0, 0.0, 5.0]])
