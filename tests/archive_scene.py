"""Archives to try: a simulated year of nights, with a truth that is known, and damage done to files."""

from dataclasses import dataclass, field

import numpy as np

from catseye.gateways.archive.content import NightContent
from catseye.gateways.archive.files import create_archive, sole_writer
from catseye.gateways.archive.writer import write_night
from catseye.records.archive.reading import open_archive

NEW_YEAR = 61041.0  # MJD of 2026-01-01 0 h UTC
RANGERS = tuple(f"ZY{100 + k}" for k in range(1, 19))
STATIONS = ("WX1", "WX2", "WX3")
BODIES = {"dish prism": 0.85, "structure": 0.12, "ground ranger": 0.03}  # shares of the points


@dataclass(frozen=True)
class YearTruth:
    """What a simulated year holds beneath its noise; lengths in metres, `per year` of 365.25 days.

    start             MJD of the first night's middle; a night follows each day
    u                 (3,) standard uncertainties of a coordinate
    correlation       of x and y
    expansion         per deg C, of the whole structure about its origin, from 10 deg C
    sag               of a dish prism along z at the horizon less at the zenith, times its x over 50 m
    drift             velocity in m per year by point, (3,)
    steps             (night counted from 0, (3,) m) by point, from that night on
    poses             body -> translation (3,) in m per deg C and in m per cos of elevation, rotation (3,) in rad
                      per cos of elevation
    zero_drift        m per year by ranger
    zero_steps        (night, m) by ranger
    thermometers      deg C per year by station, drift of its error
    missing           nights counted from 0 without an entry
    outliers          (night, point) -> (3,) m, that night alone
    """

    start: float = NEW_YEAR + 0.15
    u: tuple[float, float, float] = (60e-6, 60e-6, 120e-6)
    correlation: float = 0.3
    expansion: float = 11.7e-6
    sag: float = 3e-3
    drift: dict = field(default_factory=dict)
    steps: dict = field(default_factory=dict)
    poses: dict = field(
        default_factory=lambda: {
            "dish": ((0.0, 2e-6, 5e-6), (0.0, 1.5e-3, -2e-3), (4e-5, 0.0, 0.0)),
            "feed arm": ((1e-6, 0.0, 8e-6), (0.0, 4e-3, -1e-3), (9e-5, 1e-5, 0.0)),
        }
    )
    zero_drift: dict = field(default_factory=dict)
    zero_steps: dict = field(default_factory=dict)
    thermometers: dict = field(default_factory=dict)
    missing: tuple = ()
    outliers: dict = field(default_factory=dict)


U_POSE = np.array([40e-6, 40e-6, 60e-6, 1e-6, 1e-6, 2e-6])  # m and rad
U_ZERO, U_THERMOMETER = 30e-6, 0.05  # m, deg C


def point_names(points):
    """Names and bodies of the points."""
    counts = [max(1, round(share * points)) for share in BODIES.values()]
    bodies = [body for body, count in zip(BODIES, counts, strict=True) for _ in range(count)]
    bodies = (bodies + ["dish prism"] * points)[:points]
    return [f"ZP{k:05d}" for k in range(points)], bodies


def written_year(directory, nights=365, points=60, seed=1, truth=None, *, residuals=0):
    """Archive of a simulated year, without raw samples; residuals a night where they are wished for.

    The answer is what `open_archive` gives. Noise has the covariance that the tables claim.
    """
    truth = truth or YearTruth()
    create_archive(directory)
    with sole_writer(directory):
        for content in year_contents(nights, points, seed, truth, residuals=residuals):
            write_night(directory, content)
    return open_archive(directory)


def year_contents(nights, points, seed, truth, *, residuals=0):
    """Content of each night of a simulated year."""
    place = np.random.default_rng((seed, 0)).uniform(-50.0, 50.0, (points, 3))
    names, bodies = point_names(points)
    for k in range(nights):
        if k not in truth.missing:
            rng = np.random.default_rng((seed, 1, k))
            yield _night(k, rng, truth, place, names, bodies, residuals)


def _night(k, rng, truth, place, names, bodies, residuals):
    mjd = truth.start + k
    years = k / 365.25
    temperature = 10.0 + 12.0 * np.sin(2 * np.pi * (k - 110) / 365.25) + rng.normal(0.0, 4.0)
    azimuth, elevation = rng.uniform(0.0, 2 * np.pi), rng.uniform(np.radians(10.0), np.radians(85.0))
    night = f"year-{k:03d}-{rng.integers(2**32):08x}"
    common = {"night": night, "mjd": mjd}
    posture = {"azimuth": azimuth, "elevation": elevation, "temperature_c": temperature}
    tables = {
        "nights": _nights_row(common | posture, mjd, len(names), rng),
        "points": _points(k, rng, truth, place, names, bodies, common | posture),
        "poses": _poses(rng, truth, common | posture),
        "zeros": _zeros(k, rng, truth, common | {"temperature_c": temperature}, years),
        "weather": _weather(rng, truth, common, temperature, years),
        "certificates": _certificates(common, mjd),
    }
    if residuals:
        tables["residuals"] = _residuals(rng, common, elevation, names, residuals)
    return NightContent(
        night=night,
        first=mjd - 0.1,
        last=mjd + 0.1,
        source="campaign",
        inputs_sha256=f"{rng.integers(2**32):064x}",
        provenance={"settings": {"air_model": "ciddor"}},
        tables=tables,
    )


def _broadcast(columns, rows):
    return {name: np.broadcast_to(np.asarray(value), (rows,)) for name, value in columns.items()}


def _nights_row(common, mjd, points, rng):
    row = {
        **common,
        "name": common["night"][:8],
        "source": "campaign",
        "inputs_sha256": "0" * 64,
        "digest": "0" * 64,
        "version": "0.2.0",
        "air_model": "ciddor",
        "points": points,
        "shots": 5 * points,
        "rejected": 0,
        "variance_factor": rng.chisquare(2 * points) / (2 * points),
        "degrees_of_freedom": 2.0 * points,
        "verdict": "good",
        "why": "all fits",
        "refractivity_ppm": 280.0 - common["temperature_c"],
        "pressure_hpa": 930.0 + rng.normal(0.0, 5.0),
        "humidity_percent": 70.0,
        "raw_bytes": 5 * points * 16384,
        "archived_mjd": mjd + 0.3,
    }
    return _broadcast(row, 1)


def _points(k, rng, truth, place, names, bodies, common):
    u = np.array(truth.u)
    covariance = np.diag(u**2)
    covariance[0, 1] = covariance[1, 0] = truth.correlation * u[0] * u[1]
    x = place * (1.0 + truth.expansion * (common["temperature_c"] - 10.0))
    dish = np.array(bodies) == "dish prism"
    x[dish, 2] -= truth.sag * np.cos(common["elevation"]) * place[dish, 0] / 50.0
    rows = {name: row for row, name in enumerate(names)}
    for name, velocity in truth.drift.items():
        x[rows[name]] += np.array(velocity) * k / 365.25
    for name, (first, step) in truth.steps.items():
        x[rows[name]] += np.array(step) * (k >= first)
    for (when, name), step in truth.outliers.items():
        x[rows[name]] += np.array(step) * (k == when)
    x = x + rng.multivariate_normal(np.zeros(3), covariance, len(names))
    columns = {
        "point": names,
        "body": bodies,
        **{axis: x[:, i] for i, axis in enumerate("xyz")},
        **{f"{'xyz'[i]}{'xyz'[j]}": covariance[i, j] for i in range(3) for j in range(i, 3)},
        "shots": rng.integers(3, 9, len(names)),
        **common,
    }
    return _broadcast(columns, len(names))


def _poses(rng, truth, common):
    covariance = np.diag(U_POSE**2)
    rows = []
    for by_temperature, by_elevation, turned in truth.poses.values():
        cos = np.cos(common["elevation"])
        motion = np.concatenate(
            [
                np.array(by_temperature) * (common["temperature_c"] - 10.0) + np.array(by_elevation) * cos,
                np.array(turned) * cos,
            ]
        )
        rows.append(motion + U_POSE * rng.standard_normal(6))
    motions = np.array(rows)
    columns = {
        "body": list(truth.poses),
        "frame": "ground",
        **{f"pivot_{axis}": 0.0 for axis in "xyz"},
        **{f"translation_{axis}": motions[:, i] for i, axis in enumerate("xyz")},
        **{f"rotation_{axis}": motions[:, 3 + i] for i, axis in enumerate("xyz")},
        **{f"c{i + 1}{j + 1}": covariance[i, j] for i in range(6) for j in range(i, 6)},
        **common,
        "unobserved": "",
    }
    return _broadcast(columns, len(truth.poses))


def _zeros(k, rng, truth, common, years):
    value = U_ZERO * rng.standard_normal(len(RANGERS))
    for row, ranger in enumerate(RANGERS):
        value[row] += truth.zero_drift.get(ranger, 0.0) * years
        first, step = truth.zero_steps.get(ranger, (0, 0.0))
        value[row] += step * (k >= first)
    columns = {"ranger": RANGERS, "parameter": "zero", "value": value, "u": U_ZERO, "prior": 0.0, "u_prior": 1e-3}
    return _broadcast({**columns, **common}, len(RANGERS))


def _weather(rng, truth, common, temperature, years):
    """Readings of ten minutes for four hours."""
    times = common["mjd"] + np.arange(-12, 13) / 144.0
    station = np.repeat(STATIONS, len(times))
    error = np.array([truth.thermometers.get(name, 0.0) * years for name in STATIONS])
    estimated = error + U_THERMOMETER * rng.standard_normal(len(STATIONS))
    columns = {
        "station": station,
        "night": common["night"],
        "mjd": np.tile(times, len(STATIONS)),
        "temperature_c": temperature + np.repeat(error, len(times)) + rng.normal(0.0, 0.1, len(station)),
        "pressure_hpa": 930.0 + rng.normal(0.0, 0.1, len(station)),
        "humidity_percent": 70.0 + rng.normal(0.0, 1.0, len(station)),
        "t_error_c": np.repeat(estimated, len(times)),
        "u_t_error_c": U_THERMOMETER,
    }
    return _broadcast(columns, len(station))


def _certificates(common, mjd):
    columns = {
        "instrument": RANGERS,
        **common,
        "kind": "monument",
        "file": [f"monuments/{name}.toml" for name in RANGERS],
        "sha256": "1" * 64,
        "valid_from": NEW_YEAR - 200.0,
        "valid_until": NEW_YEAR + 200.0,
        "value": 0.0,
        "u": 1e-3,
        "unit": "m",
    }
    return _broadcast(columns, len(RANGERS))


def _residuals(rng, common, elevation, names, count):
    w = rng.standard_normal(count)
    columns = {
        "shot": np.arange(count),
        "night": common["night"],
        "mjd": common["mjd"] + np.linspace(-0.08, 0.08, count),
        "ranger": rng.choice(RANGERS, count),
        "target": rng.choice(names, count),
        "elevation": elevation,
        "range": rng.uniform(30.0, 150.0, count),
        "u": 50e-6,
        "residual": 50e-6 * w,
        "w": w,
        "status": "used",
    }
    return _broadcast(columns, count)


def flip(path, where, bit=0):
    """Change one bit of a file; `where` counts from the end if negative."""
    content = bytearray(path.read_bytes())
    content[where] ^= 1 << bit
    path.write_bytes(content)
