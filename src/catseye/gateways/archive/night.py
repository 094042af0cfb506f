"""A reduced night as tables of an archive."""

from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.archive.content import Columns, NightContent, NightInputs, broadcast, mjd_of
from catseye.gateways.epoch.objects import certificates
from catseye.gateways.epoch.tables import kinds_of
from catseye.records.files.record import Certificate
from catseye.records.night.campaign import Campaign
from catseye.records.site.folder import SiteFolder, mounts
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.head import head_unknowns
from catseye.reduction.epoch.parameter import Parameter
from catseye.reduction.night.digest import digest
from catseye.verdict import Verdict
from catseye.version import __version__

FRAMES = "frames.npy"
ZERO = "zero"  # name of the parameter that is a ranger's zero
LEAKAGE = ("leakage real", "leakage imaginary")
NAN = float("nan")


def night_content(
    campaign: Campaign,
    reduction: Reduction | str,
    *,
    inputs: NightInputs,
    air_model: str,
) -> NightContent:
    """Content of a night for an archive.

    reduction   of the campaign, or the reason that there is none
    inputs      of the night: all files of the campaign
    """
    mjd = campaign.shots.mjd_utc
    times = np.concatenate([mjd, campaign.weather.mjd_utc])
    common = {"night": inputs.night, "mjd": 0.5 * float(mjd.min() + mjd.max())}
    conditions = _conditions(campaign if isinstance(reduction, str) else reduction.campaign)
    posture = {name: conditions[name] for name in ("azimuth", "elevation", "temperature_c")}
    row = {
        **inputs.row,
        **common,
        "name": campaign.site.campaign.name,
        "source": "campaign",
        "version": __version__,
        "air_model": air_model,
        "shots": len(mjd),
        **conditions,
    }
    tables: dict[str, Columns] = {"certificates": certificate_rows(campaign, common)}
    provenance: dict[str, Any] = {"certificates": certificates(campaign)}
    if isinstance(reduction, str):
        verdict = Verdict("failed", reduction)
        tables["weather"] = _weather(campaign, inputs.night, {})
    else:
        verdict, coordinates = reduction.verdict, reduction.coordinates
        row |= {
            "digest": digest(reduction),
            "points": len(coordinates.points),
            "rejected": len(reduction.rejected),
            "variance_factor": coordinates.variance_factor,
            "degrees_of_freedom": coordinates.degrees_of_freedom,
            "refractivity_ppm": coordinates.refractivity_ppm,
        }
        tables |= _result_tables(reduction, common, posture)
        provenance |= {"settings": asdict(reduction.settings), "notes": list(reduction.notes)}
    tables["nights"] = broadcast({**row, "verdict": verdict.word, "why": verdict.why}, 1)
    return NightContent(
        night=inputs.night,
        first=float(times.min()),
        last=float(times.max()),
        source="campaign",
        inputs_sha256=inputs.sha256,
        provenance=provenance,
        tables=tables,
        directory=inputs.directory,
        inputs=inputs.files,
        **sample_cycles(campaign),
    )


def sample_cycles(campaign: Campaign) -> dict[str, Any]:
    """File of the samples; samples of a cycle and cycles of each of its rows, the usual ones where no shot has it."""
    shots, (rows, width) = campaign.shots, campaign.frames.shape
    usual = campaign.site.adc
    period = min(usual.samples_per_cycle, width)
    periods = np.full(rows, period)
    cycles = np.full(rows, max(1, min(usual.cycles, width // period)))
    periods[shots.frame], cycles[shots.frame] = shots.samples_per_cycle, shots.cycles
    return {"samples": FRAMES, "periods": periods, "cycles": cycles}


def _conditions(campaign: Campaign) -> dict[str, float]:
    """Posture and mean weather of a campaign."""
    posture, weather = campaign.site.campaign, campaign.weather
    return {
        "azimuth": posture.azimuth_deg * DEGREE,
        "elevation": posture.elevation_deg * DEGREE,
        "temperature_c": float(weather.temperature_c.mean()),
        "pressure_hpa": float(weather.pressure_hpa.mean()),
        "humidity_percent": float(weather.humidity_percent.mean()),
    }


def _result_tables(reduction: Reduction, common: dict[str, Any], posture: dict[str, Any]) -> dict[str, Columns]:
    """Tables of a reduction: points, pose, zeros, weather with the thermometers' errors, residuals."""
    coordinates = reduction.coordinates
    points = {
        "point": coordinates.points,
        "body": list(kinds_of(reduction).values()),
        **coordinate_columns(coordinates.x, coordinates.joint.blocks),
        "shots": coordinates.shots,
        **common,
        **posture,
    }
    tables = {
        "points": broadcast(points, len(coordinates.points)),
        "zeros": _zeros(reduction, common, posture["temperature_c"]),
        "weather": _weather(reduction.campaign, common["night"], coordinates.air),
        "residuals": _residuals(reduction, common["night"], posture["elevation"]),
    }
    if reduction.surface is not None:
        pose = reduction.surface.pose()
        columns = pose_columns(pose["pivot"], pose["translation"], pose["rotation"], np.array(pose["covariance"]))
        row = {"body": "dish", "frame": pose["frame"], "unobserved": "; ".join(pose["unobserved"])}
        tables["poses"] = broadcast({**row, **columns, **common, **posture}, 1)
    return tables


def coordinate_columns(x: np.ndarray, blocks: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of coordinates (n, 3) m and their covariances (n, 3, 3) m2."""
    products = {f"{'xyz'[i]}{'xyz'[j]}": blocks[:, i, j] for i in range(3) for j in range(i, 3)}
    return {**{axis: x[:, k] for k, axis in enumerate("xyz")}, **products}


def pose_columns(pivot: Any, translation: Any, rotation: Any, covariance: np.ndarray) -> dict[str, Any]:
    """Columns of a rigid motion; covariance (6, 6) of translation and rotation."""
    vectors = {"pivot": pivot, "translation": translation, "rotation": rotation}
    columns = {f"{name}_{'xyz'[k]}": vector[k] for name, vector in vectors.items() for k in range(3)}
    return columns | {f"c{i + 1}{j + 1}": covariance[i, j] for i in range(6) for j in range(i, 6)}


def zero_priors(site: SiteFolder, rangers: list[str]) -> dict[str, float]:
    """Standard uncertainty of each ranger's zero by its sheet, m; NaN where it is not stated."""
    sheets = {ranger: site.mirror_of(ranger).u_d0_mm for ranger in rangers}
    return {ranger: NAN if u is None else u * MILLIMETRE for ranger, u in sheets.items()}


def _zeros(reduction: Reduction, common: dict[str, Any], temperature_c: float) -> Columns:
    """Zeros, effects of heads and leakages; all of them are departures from the sheet, with expectation zero."""
    coordinates, campaign = reduction.coordinates, reduction.campaign
    u_zero = zero_priors(campaign, list(coordinates.zeros))
    rows = [(name, ZERO, value, u, u_zero[name]) for name, (value, u) in coordinates.zeros.items()]
    for name in coordinates.zeros:
        for unknown in head_unknowns(campaign, name):
            kind = unknown.quantity.kind
            for part in unknown.parts:
                value, u = coordinates.heads[str(Parameter(kind, name, part))]
                rows.append((name, f"{kind.name.lower()} {part}".strip(), value, u, unknown.u))
    for name, parts in coordinates.leakage.items():
        u_volt = campaign.mirror_of(name).u_leakage_volt
        prior = NAN if u_volt is None else u_volt
        rows += [(name, LEAKAGE[k], parts[k], NAN, prior) for k in range(2)]
    names = ("ranger", "parameter", "value", "u", "u_prior")
    columns = {column: [row[k] for row in rows] for k, column in enumerate(names)}
    return broadcast({**columns, "prior": 0.0, **common, "temperature_c": temperature_c}, len(rows))


def _weather(campaign: Campaign, night: str, errors: Any) -> Columns:
    """Readings, each with the error of its thermometer."""
    weather = campaign.weather
    estimates = np.array([errors.get(station, (NAN, NAN)) for station in weather.station])
    columns = {
        "station": weather.station,
        "night": night,
        "mjd": weather.mjd_utc,
        "temperature_c": weather.temperature_c,
        "pressure_hpa": weather.pressure_hpa,
        "humidity_percent": weather.humidity_percent,
        "t_error_c": estimates[:, 0],
        "u_t_error_c": estimates[:, 1],
    }
    return broadcast(columns, len(weather.station))


def _residuals(reduction: Reduction, night: str, elevation: float) -> Columns:
    """A row a shot, without range where it has no phase."""
    shots, ranges = reduction.campaign.shots, reduction.coordinates.ranges

    def spread(values: np.ndarray) -> np.ndarray:
        every = np.full(len(shots), np.nan)
        every[ranges.shot] = values
        return every

    columns = {
        "shot": shots.shot,
        "night": night,
        "mjd": shots.mjd_utc,
        "ranger": shots.ranger,
        "target": shots.target,
        "elevation": elevation,
        "range": spread(ranges.range_),
        "u": spread(ranges.u_range),
        "residual": spread(ranges.residual),
        "w": spread(ranges.standardised),
        "status": [str(status) for status in reduction.status],
    }
    return broadcast(columns, len(shots))


class RecordRow(NamedTuple):
    """Record that a result stands on.

    value, u   its main value with standard uncertainty, NaN for none, and their unit
    ranger     that carries the mirror or stands on the monument; "" for none
    """

    instrument: str
    kind: str
    file: str
    record: Certificate
    value: float = NAN
    u: float = NAN
    unit: str = ""
    ranger: str = ""


def certificate_rows(site: SiteFolder, common: dict[str, Any]) -> Columns:
    """Records that a result stands on, with the distance of each head's cube and the height of each triplet's ball."""
    carriers = {zp: ranger for ranger, (zp, _) in mounts(site.monuments, site.feedarm).items()}
    rows = [RecordRow(site.site.campaign.name, "site", "site.toml", site.site)]
    for name, mirror in site.mirrors.items():
        d0, u_d0 = (NAN if value is None else value * MILLIMETRE for value in (mirror.d0_mm, mirror.u_d0_mm))
        rows.append(RecordRow(name, "mirror", f"mirrors/{name}.toml", mirror, d0, u_d0, "m", carriers.get(name, "")))
    for name, monument in site.monuments.items():
        rows.append(RecordRow(name, "monument", f"monuments/{name}.toml", monument, ranger=name))
    for name, triplet in site.triplets.items():
        height, u_height = triplet.h_corr_mm * MILLIMETRE, triplet.u_h_corr_mm * MILLIMETRE
        rows.append(RecordRow(name, "triplet", f"triplets/{name}.toml", triplet, height, u_height, "m"))
    plain = ("instrument", "kind", "file", "value", "u", "unit", "ranger")
    columns = {
        **{name: [getattr(row, name) for row in rows] for name in plain},
        "sha256": [site.hashes.get(row.file, "") for row in rows],
        "valid_from": [mjd_of(row.record.measured_on) for row in rows],
        "valid_until": [mjd_of(row.record.valid_until) for row in rows],
    }
    return broadcast({**columns, **common}, len(rows))
