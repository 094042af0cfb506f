"""Air between two points: the ray beside scipy's integrator, the arc beside the textbook, u beside scatter."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from catseye.atmosphere.index.air import air
from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ArgumentError, ValidityError
from catseye.records.laboratory.station_heights import StationHeights, read_station_heights
from catseye.reduction.air.ray_path import air_path, campaign_air, stations_air
from catseye.reduction.air.routes import IndexFormula
from repository import ROOT

STATIONS = ROOT / "examples" / "weather" / "stations.csv"
Z = np.array([2.0, 10.0, 25.0, 45.0])


def stations(temperature, z=Z, pressure=None, humidity=60.0):
    """Stations at one time."""
    return StationHeights(
        station=tuple(f"S{k}" for k in range(len(z))),
        z=z,
        mjd_utc=np.zeros(len(z)),
        temperature_c=np.asarray(temperature, float),
        pressure_hpa=930.0 - 0.113 * (z - 2.0) if pressure is None else pressure,
        humidity_percent=np.full(len(z), humidity),
        digest="",
    )


def between(temperature, start, end, **more):
    site = stations_air(stations(temperature, **more), IndexFormula(), None)
    return air_path(site, np.array(start, float), np.array(end, float), hashes={})


def traced(site, start, end):
    """Ray by scipy: d(n t)/ds = grad n in the vertical plane; angles, height above the chord, optical excess."""
    start, end = np.array(start, float), np.array(end, float)
    horizontal = float(np.hypot(*(end - start)[:2]))

    def index(z):
        weather = [column[0] for column in site.profile.state(np.array([0.0]), np.atleast_1d(z)[None])]
        state = air(*weather)
        return state.phase_refractivity, state.group_refractivity

    def rates(_, y):
        x, z, px, pz, *_ = y
        n = 1.0 + float(index(z)[0][0])
        size = np.hypot(px, pz)
        upper, lower = (float(index(z + h)[0][0]) for h in (0.005, -0.005))
        on_chord = start[2] + (end[2] - start[2]) * x / horizontal
        group, straight = float(index(z)[1][0]), float(index(on_chord)[1][0])
        cosine = np.cos(chord_angle)
        # dx is cos(ray) ds, and a step of the chord is dx/cos(chord)
        return [px / size, pz / size, 0.0, (upper - lower) / 0.01, (1 + group) - (1 + straight) * px / size / cosine, n]

    chord_angle = np.arctan2(end[2] - start[2], horizontal)

    def shot(off):
        n = 1.0 + float(index(start[2])[0][0])
        first = [0.0, start[2], n * np.cos(chord_angle + off), n * np.sin(chord_angle + off), 0.0, 0.0]
        reached = lambda s, y: y[0] - horizontal  # noqa: E731 - an event of solve_ivp
        reached.terminal = True
        length = np.linalg.norm(end - start)
        return solve_ivp(
            rates, (0.0, 1.01 * length), first, events=reached, rtol=1e-11, atol=1e-13, max_step=length / 50
        )

    off = brentq(lambda angle: shot(angle).y_events[0][0][1] - end[2], -2e-4, 2e-4, xtol=1e-13)
    last = shot(off).y_events[0][0]
    return off, np.arctan2(last[3], last[2]) - chord_angle, last[4]


@pytest.mark.parametrize(
    ("temperature", "start", "end"),
    [
        ((7.1, 8.0, 8.7, 9.2), (0, 0, 3), (100, 0, 40)),  # inversion
        ((24.0, 22.6, 22.0, 21.5), (0, 0, 2), (90, 80, 2.5)),  # sun on the ground, level path near it
        ((10.0, 10.0, 10.0, 10.0), (0, 0, 40), (30, 40, 3)),  # downwards
    ],
)
def test_the_ray_is_scipys(temperature, start, end):
    found = between(temperature, start, end)
    leaving, arriving, excess = traced(found.site, start, end)
    # 1e-9 rad is 0.2 mas, a ten thousandth of these angles
    assert found.angles == pytest.approx((leaving, arriving), abs=1e-9)
    assert float(found.ray.optical_excess[0]) == pytest.approx(excess, abs=2e-10)
    assert abs(found.ray.optical_excess[0]) <= found.bound * 1.05  # the group index: 4 %
    assert found.delay_difference_s == float(found.ray.optical_excess[0]) / SPEED_OF_LIGHT
    assert found.verdict.word == "good"


def test_an_even_lapse_bends_as_the_textbook_says():
    """dn/dz = -(n - 1)(0.0342 + dT/dz)/T, arc angle d/2 of it: 0.0065 °C/m at 120 m is 0.29 arcsec, k = 0.15."""
    found = between(15.0 - 0.0065 * Z, (0, 0, 20), (120, 0, 20))
    n = float(air(14.87, 927.97, 60.0).phase_refractivity)
    # the profile's prior takes an eighth of the lapse for a layer; vapour falls with the temperature
    lapse = found.site.profile.temperature
    slope = float(np.diff(lapse.at(np.zeros(1), np.array([[19.5, 20.5]])))[0, 0])
    expected = n * (0.0342 + slope) / (273.15 + 14.87)
    assert found.arc_curvature == pytest.approx(expected, rel=0.03)
    assert slope == pytest.approx(-0.0065, abs=0.004)
    assert found.arc_angle == pytest.approx(60.0 * found.arc_curvature, rel=1e-12)
    assert found.angles[0] == pytest.approx(found.arc_angle, rel=0.02)
    assert found.angles[1] == pytest.approx(-found.arc_angle, rel=0.02)
    assert found.ray_sag == pytest.approx(found.arc_sag, rel=0.02)
    assert found.arc_sag == pytest.approx(found.arc_angle * 30.0, rel=1e-12)


def test_the_u_of_the_angle_and_of_the_mean_are_their_scatter():
    """Air of the prior's kind, stations with its offsets, noise and local air: both claims, seeded."""
    rng, start, end = np.random.default_rng(46), (0.0, 0.0, 10.0), (100.0, 0.0, 40.0)
    angles, means = [], []
    for _ in range(150):
        gradient, layer = rng.normal(0.0, np.hypot(0.02, 0.01)), rng.normal(0.0, np.hypot(0.2, 0.1))

        def truth(z, gradient=gradient, layer=layer):
            return 10.0 + gradient * z + layer * np.log1p(z)

        error = rng.normal(0.0, 0.3, 4) + rng.normal(0.0, np.hypot(0.05, 0.15), 4)
        found = between(truth(Z) + error, start, end)
        kappa = float(air(10.0, 927.4, 60.0).phase_refractivity) / 283.15 * (gradient + layer / 26.0)
        own = -found.gradient - float(air(10.0, 927.4, 60.0).phase_refractivity) / 283.15 * 0.0342
        angles.append((own - kappa) / found.u_gradient)
        z = np.linspace(10.0, 40.0, 201)
        mean_u = np.sqrt(found.mean.covariance_c2[0, 0])
        means.append((float(found.mean.temperature_c[0]) - truth(z).mean()) / mean_u)
    # 150 draws know a scatter to 6 %; the mean's u includes local air along the path, which this truth has not
    assert np.std(angles) == pytest.approx(1.0, abs=0.2)
    assert 0.75 < np.std(means) < 1.15


def test_a_steep_arc_bends_by_the_gradient_across_it_and_so_does_its_u():
    """Chord of 3 in 5 upwards: its cosine is 4/5, of curvature and u alike."""
    found = between(20.0 - 0.02 * Z, [0.0, 0.0, 5.0], [40.0, 0.0, 35.0])
    assert found.u_gradient > 0.0
    assert found.u_curvature == pytest.approx(0.8 * found.u_gradient, rel=1e-12)
    assert found.arc_curvature == pytest.approx(-0.8 * found.gradient, rel=1e-3)  # the index, 1.0003


def test_a_vertical_path_is_straight():
    found = between((7.0, 8.0, 9.0, 9.5), (0, 0, 2), (0, 0, 45))
    assert (found.angles, found.ray_sag, found.arc_curvature) == ((0.0, 0.0), 0.0, pytest.approx(0.0, abs=1e-20))


def test_the_campaigns_mean_is_its_site_airs(night_01):
    site = campaign_air(night_01, IndexFormula(), None)
    start, end = np.array([0.0, -39.0, 1.5]), np.array([10.0, 60.0, 40.0])
    found = air_path(site, start, end, hashes={})
    again = site.along(np.array([found.mjd_utc]), start[None], end[None])
    assert float(found.mean.refractivity[0]) == float(again.refractivity[0])
    assert "2 stations" in found.verdict.why


def test_what_cannot_be_is_refused():
    for start, end, words in (
        ((0, 0, 3), (0, 0, 3), "one point"),
        ((0, 0, 3), (3000, 0, 3), "3000 m apart"),
    ):
        with pytest.raises(ArgumentError, match=words):
            between(10.0 + 0.0 * Z, start, end)
    with pytest.raises(ValidityError, match="height above the ground"):
        between(10.0 + 0.0 * Z, (0, 0, -5), (50, 0, 3))
    site = stations_air(stations(10.0 + 0.0 * Z), IndexFormula(), None)
    with pytest.raises(ArgumentError, match="more than an hour outside"):
        air_path(site, np.zeros(3) + 3.0, np.ones(3) * 9.0, mjd_utc=60000.0, hashes={})


def test_the_table_of_the_example_is_read():
    found = read_station_heights(STATIONS)
    assert found.station == ("field", "tower-10", "tower-25", "tower-45")
    assert found.z.tolist() == [2.0, 10.0, 25.0, 45.0]
