"""Air of an array: fields drawn by random waves, sound by the simulator's own formula, truth within u in scatter."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.records.laboratory.sound_array import read_sound_array
from catseye.reduction.air.acoustic import NO_TIME
from catseye.reduction.air.array_air import SUSPECT, array_air
from catseye.simulator.laboratory.acoustic import SoundPath
from repository import ROOT

EXAMPLE = ROOT / "examples" / "acoustic"
SHARES = (np.arange(200) + 0.5) / 200.0
WAVES = 200


@pytest.fixture(scope="module")
def shipped():
    return read_sound_array(EXAMPLE / "array-stations.csv", EXAMPLE / "array-times.csv", EXAMPLE / "array-times.toml")


def waves(rng, sigma, lengths):
    """Random field of covariance sigma² exp(-d²/2): a sum of cosines, none of the estimate's integrals."""
    k = rng.standard_normal((WAVES, 3)) / np.asarray(lengths)
    phase = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    return lambda p: sigma * np.sqrt(2.0 / WAVES) * np.sum(np.cos(p @ k.T + phase), axis=-1)


def drawn(shipped, rng):
    """The array with times of a field, a wind, places, weather and delay drawn as the sheet has them."""
    sheet = shipped.sheet
    field = waves(rng, sheet.variation_c, (sheet.variation_m, sheet.variation_m, sheet.variation_z_m))
    mean = rng.normal(sheet.temperature_c, sheet.u_temperature_c)
    gusts = [waves(rng, sheet.wind_variation_m_per_s, (sheet.wind_m, sheet.wind_m, sheet.wind_z_m)) for _ in range(3)]
    steady = sheet.u_wind_m_per_s * rng.standard_normal(3)

    def warm(p):
        return mean + field(p)

    def blowing(p):
        return steady + np.stack([gust(p) for gust in gusts], axis=-1)

    places = shipped.places + 1e-3 * sheet.u_position_mm * rng.standard_normal(shipped.places.shape)
    pressure, humidity = rng.normal(sheet.pressure_hpa, 0.3), rng.normal(sheet.humidity_percent, 3.0)
    delay = 1e-6 * rng.normal(sheet.delay_us, sheet.u_delay_us)
    times = []
    for a, b in zip(places[shipped.source], places[shipped.receiver], strict=True):
        way = b - a
        length = float(np.linalg.norm(way))
        along = way / length

        def across(share, a=a, way=way, along=along):
            w = blowing(a + share[:, None] * way)
            return np.sqrt(np.maximum(np.sum(w**2, axis=-1) - (w @ along) ** 2, 0.0))

        path = SoundPath(
            length,
            lambda share, a=a, way=way: warm(a + share[:, None] * way),
            lambda share, a=a, way=way, along=along: blowing(a + share[:, None] * way) @ along,
            across,
            pressure_hpa=pressure,
            humidity_percent=humidity,
            dispersion_ppm=40.0,
        )
        times.append(path.travel_times()[0])
    noise = shipped.u_time * rng.standard_normal(len(times))
    return replace(shipped, time=np.array(times) + delay + noise), warm, blowing


def scatter(shipped, runs, seed):
    """Line mean, map and wind against the truth in standard uncertainties, and chi-square a time, of each run."""
    rng = np.random.default_rng(seed)
    line, points, wind, chi = [], [], [], []
    for _ in range(runs):
        array, warm, blowing = drawn(shipped, rng)
        found = array_air(array)
        chosen = shipped.sheet.lines[0]
        start, end = np.array(chosen.start), np.array(chosen.end)
        true = float(np.mean(warm(start + SHARES[:, None] * (end - start))))
        line.append((found.lines.temperature_c[0] - true) / found.lines.u_temperature_c[0])
        points.append(np.mean(((found.map.temperature_c - warm(found.grid)) / found.map.u_temperature_c) ** 2))
        wind.append(np.mean(((found.map.wind - blowing(found.grid)) / found.map.u_wind)[:, :2] ** 2))
        chi.append(found.field.tomogram.chi_square / len(found.field.used))
    return np.array(line), np.array(points), np.array(wind), np.array(chi)


def test_a_drawn_field_is_within_its_u_in_scatter(shipped):
    """30 draws: 1 ± 0.26 for a mean square of one number; neighbours on the map are correlated."""
    line, points, wind, chi = scatter(shipped, 30, 61)
    assert 0.3 < np.mean(line**2) < 1.8
    assert np.abs(line).max() < 3.5
    assert 0.6 < points.mean() < 1.4
    assert 0.6 < wind.mean() < 1.4
    assert chi.mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 56.0 / 30.0))


def test_a_gross_error_is_named_and_makes_the_verdict_doubtful(shipped):
    time = shipped.time.copy()
    time[7] += 1e-3
    found = array_air(replace(shipped, time=time))
    assert found.status[7] == SUSPECT
    assert found.verdict.word == "doubtful"
    assert array_air(shipped).verdict.word == "good"


def test_one_direction_leaves_the_wind_in_the_temperature_and_says_so(shipped):
    one = shipped.source < shipped.receiver
    time = np.where(one, shipped.time, np.nan)
    found, both = array_air(replace(shipped, time=time)), array_air(shipped)
    assert found.array.both_ways == 0
    assert not found.windy
    assert both.windy
    assert both.array.both_ways == 28
    assert found.status[int(np.argmin(one))] == NO_TIME
    assert found.verdict.word == "doubtful"
    assert np.isnan(found.residual_c[~one]).all()


def test_a_line_that_the_sound_does_not_reach_is_named(shipped):
    away = shipped.sheet.lines[0].model_copy(
        update={"name": "far", "start": (900.0, 0.0, 3.0), "end": (930.0, 0.0, 3.0)}
    )
    sheet = shipped.sheet.model_copy(update={"lines": (away,), "u_temperature_c": 0.1})
    found = array_air(replace(shipped, sheet=sheet))
    assert "the line far rests on its prior" in found.verdict.why
    assert found.lines.u_temperature_c[0] > 0.2  # the field's own, averaged over a correlation length
