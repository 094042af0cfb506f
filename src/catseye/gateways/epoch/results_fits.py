"""Results of a night as FITS binary tables, results.fits: every number unrounded, units in the headers."""

from dataclasses import asdict
from datetime import timedelta
from typing import Any

import numpy as np

from catseye.gateways.epoch.objects import COVARIANCE, matrix_file
from catseye.gateways.epoch.record_tests import CONTRADICTIONS, RECORDS, explanation_rows, listed_tests
from catseye.gateways.epoch.tables import COORDINATES, RANGES, SURFACE, PointRows, PrismRows, ShotRows
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.samplers_fits import (
    SamplerColumn,
    SamplerTable,
    ascii_text,
    of_table,
    sampler_tables,
)
from catseye.geometry.sky.time_tag import MJD_EPOCH
from catseye.reduction.epoch.contradictions.contradiction import ClassScatter, GroupTest
from catseye.reduction.epoch.epoch import Reduction

RESULTS = "results.fits"
GROUND = "ground: x east, y north, z up"


def results_fits(reduction: Reduction) -> bytes:
    """FITS file of a reduction, a table for each subject; those without a row are left out.

    It holds no time of writing, so that the same inputs, settings and versions give the same bytes.
    """
    tables = [
        of_table("POINTS", COORDINATES, PointRows(reduction), frame=GROUND),
        of_table("RANGES", RANGES, ShotRows(reduction)),
        *_surface(reduction),
        _zeros(reduction),
        *_records(reduction),
        *_covariance(reduction),
        _provenance(reduction),
    ]
    return sampler_tables({table.name: table for table in tables}, header=_header(reduction))


def _header(reduction: Reduction) -> dict[str, str | int | float]:
    """Keywords of the primary header."""
    coordinates, campaign = reduction.coordinates, reduction.campaign
    first, last = (float(f(campaign.shots.mjd_utc)) for f in (np.min, np.max))
    separate = matrix_file(coordinates.points) == COVARIANCE
    factor = coordinates.variance_factor
    return {
        "CAMPAIGN": ascii_text(campaign.site.campaign.name),
        "TIMESYS": "UTC",
        "DATE-BEG": _iso(first),
        "DATE-END": _iso(last),
        "MJD-BEG": first,
        "MJD-END": last,
        "AIRMODEL": reduction.settings.air_model,
        "VERDICT": reduction.verdict.word,
        "WHY": ascii_text(reduction.verdict.why),
        **({"VARFACT": factor} if np.isfinite(factor) else {}),
        "DOF": int(coordinates.degrees_of_freedom),
        **({"COVFILE": COVARIANCE} if separate else {}),
    }


def _iso(mjd: float) -> str:
    """Date and time of FITS, to the millisecond."""
    return (MJD_EPOCH + timedelta(days=mjd)).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3]


def _surface(reduction: Reduction) -> list[SamplerTable]:
    """Prisms of the dish and its pose; nothing where the dish was not observed."""
    surface = reduction.surface
    if surface is None:
        return []
    pose: dict[str, Any] = {**surface.pose()}
    units = {
        "pivot": "m",
        "translation": "m",
        "rotation": "rad",
        "vertex": "m",
        "focus": "m",
        "axis": "",
        "covariance": "",
    }
    comments = {
        "pivot": "nominal vertex, about which it is rotated",
        "translation": "of the pivot",
        "rotation": "rotation vector, right-handed",
        "vertex": "of the fitted paraboloid",
        "focus": "of the fitted paraboloid",
        "axis": "unit vector, from vertex to focus",
        "covariance": "6 x 6, translation then rotation, m and rad",
    }
    columns = {
        name.upper(): SamplerColumn(unit, np.array(pose[name])[None], comments[name]) for name, unit in units.items()
    }
    posture = reduction.campaign.site.campaign
    header = {
        "AZ": posture.azimuth_deg,
        "EL": posture.elevation_deg,
        "FOCALLEN": surface.focal_length,
        "RMS": surface.rms,
    }
    return [
        of_table("SURFACE", SURFACE, PrismRows(reduction, surface), frame="fitted paraboloid: vertex, axis along z"),
        SamplerTable(
            "POSE",
            columns,
            comment="of the dish against its nominal posture AZ, EL (deg); FOCALLEN and RMS in m",
            frame=GROUND,
            pivot="column PIVOT",
            header=header,
        ),
    ]


def _zeros(reduction: Reduction) -> SamplerTable:
    zeros = reduction.coordinates.zeros
    values = np.array(list(zeros.values()), dtype=float).reshape(-1, 2)
    columns = {
        "RANGER": SamplerColumn("", np.array(list(zeros), dtype=str)),
        "ZERO": SamplerColumn("m", values[:, 0], "correction to the ranges"),
        "U_ZERO": SamplerColumn("m", values[:, 1], "standard uncertainty"),
    }
    return SamplerTable("ZEROS", columns, comment="zeros of the rangers, as estimated")


def _records(reduction: Reduction) -> list[SamplerTable]:
    """Tests of records and their groups, contradictions, scatter of classes, unmeasured targets: those with rows."""
    coordinates = reduction.coordinates
    explanations = explanation_rows(coordinates.contradictions)
    tables = []
    if coordinates.records:
        tables.append(of_table("RECORDS", RECORDS, listed_tests(coordinates)))
    if coordinates.groups:
        tables.append(_groups(coordinates.groups))
    if explanations:
        tables.append(of_table("CONTRADICTIONS", CONTRADICTIONS, explanations))
    if coordinates.scatter:
        tables.append(_scatter(coordinates.scatter))
    if coordinates.unmeasured:
        columns = {"POINT": SamplerColumn("", np.array([ascii_text(name) for name in coordinates.unmeasured]))}
        tables.append(
            SamplerTable("UNMEASURED", columns, comment="targets and rangers without a usable shot, not in POINTS")
        )
    return tables


def _groups(groups: tuple[GroupTest, ...]) -> SamplerTable:
    columns = {
        "GROUP": SamplerColumn("", np.array([str(test.group) for test in groups])),
        "CHI2": SamplerColumn("", np.array([test.statistic for test in groups]), "chi squared of the group's errors"),
        "DOF": SamplerColumn("", np.array([test.degrees for test in groups]), "degrees of freedom"),
        "PROBABILITY": SamplerColumn("", np.array([test.probability for test in groups]), "of as much by chance"),
    }
    return SamplerTable("GROUPS", columns, comment="tests of all records of a group together")


def _scatter(scatter: tuple[ClassScatter, ...]) -> SamplerTable:
    columns = {
        "CLASS": SamplerColumn("", np.array([ascii_text(entry.name) for entry in scatter])),
        "SHOTS": SamplerColumn("", np.array([entry.shots for entry in scatter]), "used"),
        "VARFACT": SamplerColumn("", np.array([entry.factor for entry in scatter]), "variance factor, expected 1"),
        "SWAY": SamplerColumn("m", np.array([entry.sway_m for entry in scatter]), "from shot to shot, included in u"),
    }
    return SamplerTable("SCATTER", columns, comment="scatter of the shots by class of points, against their claim")


def _covariance(reduction: Reduction) -> list[SamplerTable]:
    """Full covariance, a row a coordinate; nothing where it has a file of its own."""
    coordinates = reduction.coordinates
    if matrix_file(coordinates.points) == COVARIANCE:
        return []
    points = coordinates.points
    columns = {
        "POINT": SamplerColumn("", np.repeat(np.array(points, dtype=str), 3)),
        "AXIS": SamplerColumn("", np.tile(["x", "y", "z"], len(points))),
        "COVARIANCE": SamplerColumn("m2", coordinates.covariance, "with every row's coordinate, in the same order"),
    }
    return [SamplerTable("COVARIANCE", columns, comment="of all coordinates of POINTS", frame=GROUND)]


def _provenance(reduction: Reduction) -> SamplerTable:
    """Inputs with SHA-256, versions and settings, as in provenance.json."""
    origins = {"input": reduction.campaign.hashes, "version": versions(), "setting": asdict(reduction.settings)}
    rows = [(kind, name, str(value)) for kind, values in origins.items() for name, value in values.items()]
    columns = {
        title: SamplerColumn("", np.array([ascii_text(row[k]) for row in rows], dtype=str))
        for k, title in enumerate(("KIND", "NAME", "VALUE"))
    }
    return SamplerTable("PROVENANCE", columns, comment="inputs with their SHA-256, versions, settings")
