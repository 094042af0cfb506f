"""Tables of a structural model: displacements, fitted coefficients, residuals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.design.cardinal_points import NATS, PointChoice
from catseye.reduction.structure.beam import BeamOffset
from catseye.reduction.structure.displacement import ModelDisplacements
from catseye.reduction.structure.finite_elements import ImportedModel
from catseye.reduction.structure.model_fit import FittedCoefficient, ModelFindings

PAGE = "structural-model.md"
FRAMES = ("ground", "body")


def _posture(name: str) -> Column[ModelDisplacements]:
    def values(displaced: ModelDisplacements) -> np.ndarray:
        one = np.asarray(getattr(displaced.posture, name), dtype=float)
        return np.repeat(one / (1.0 if name == "temperature_c" else DEGREE), len(displaced.points))

    words = {
        "azimuth": ("azimuth_deg", "deg", "azimuth, clockwise from north"),
        "elevation": ("elevation_deg", "deg", "elevation"),
        "temperature_c": ("temperature_c", "deg_C", "temperature of the structure"),
    }
    column, unit, doc = words[name]
    return Column(column, unit, doc, values, ".6f")


def _repeated(name: str, doc: str) -> Column[ModelDisplacements]:
    return Column(name, "", doc, lambda f: [getattr(point, _FIELDS[name]) for _ in f.rigid for point in f.points])


_FIELDS = {"point": "name", "kind": "kind", "frame": "frame"}


def _rigid(k: int) -> Column[ModelDisplacements]:
    doc = f"{'xyz'[k]} of the rigid telescope's point, ground frame"
    return Column(f"{'xyz'[k]}_m", "m", doc, lambda f: f.rigid[..., k].ravel(), ".6f")


def _moved(frame: str, k: int) -> Column[ModelDisplacements]:
    axes = "ground axes" if frame == "ground" else "axes of `frame`"
    doc = f"displacement along {'xyz'[k]}, {axes}"
    return Column(f"{frame}_{'xyz'[k]}_mm", "mm", doc, lambda f: getattr(f, frame)[..., k].ravel() / MILLIMETRE, ".4f")


def _u_moved(frame: str, k: int) -> Column[ModelDisplacements]:
    def values(displaced: ModelDisplacements) -> np.ndarray:
        spread = displaced.covariance if frame == "ground" else displaced.body_covariance
        return np.asarray(np.sqrt(spread[..., k, k]).ravel() / MILLIMETRE)

    doc = f"standard uncertainty of `{frame}_{'xyz'[k]}_mm`"
    return Column(f"u_{frame}_{'xyz'[k]}_mm", "mm", doc, values, ".4f")


DISPLACEMENTS = Table[ModelDisplacements](
    "displacements.csv",
    PAGE,
    (
        *(_posture(name) for name in ("azimuth", "elevation", "temperature_c")),
        _repeated("point", "target or ranger"),
        _repeated("kind", "`target` or `ranger`"),
        _repeated("frame", "frame of the model that carries it"),
        *(_rigid(k) for k in range(3)),
        *(column(frame, k) for frame in FRAMES for column in (_moved, _u_moved) for k in range(3)),
    ),
)


@dataclass(frozen=True, eq=False)
class BeamRows:
    """Source of beam.csv: a row a posture."""

    displaced: ModelDisplacements
    beam: BeamOffset


def _beam_posture(name: str, column: str, doc: str) -> Column[BeamRows]:
    return Column(
        column, "deg", doc, lambda r: np.asarray(getattr(r.displaced.posture, name), dtype=float) / DEGREE, ".6f"
    )


def _u(rows: BeamRows, k: int) -> np.ndarray:
    return np.asarray(np.sqrt(rows.beam.covariance[:, k, k]))


BEAM = Table[BeamRows](
    "beam.csv",
    PAGE,
    (
        _beam_posture("azimuth", "azimuth_deg", "azimuth, clockwise from north"),
        _beam_posture("elevation", "elevation_deg", "elevation"),
        Column(
            "azimuth_cos_e_arcsec",
            "arcsec",
            "beam's azimuth times cos E, off the rigid telescope's",
            lambda r: r.beam.offset[:, 0] / ARCSECOND,
            ".3f",
        ),
        Column(
            "elevation_arcsec",
            "arcsec",
            "beam's elevation off the rigid telescope's",
            lambda r: r.beam.offset[:, 1] / ARCSECOND,
            ".3f",
        ),
        Column(
            "focus_mm",
            "mm",
            "feed farther from the dish, along the beam",
            lambda r: r.beam.offset[:, 2] / MILLIMETRE,
            ".4f",
        ),
        Column(
            "u_azimuth_cos_e_arcsec",
            "arcsec",
            "standard uncertainty of `azimuth_cos_e_arcsec`",
            lambda r: _u(r, 0) / ARCSECOND,
            ".3f",
        ),
        Column(
            "u_elevation_arcsec",
            "arcsec",
            "standard uncertainty of `elevation_arcsec`",
            lambda r: _u(r, 1) / ARCSECOND,
            ".3f",
        ),
        Column("u_focus_mm", "mm", "standard uncertainty of `focus_mm`", lambda r: _u(r, 2) / MILLIMETRE, ".4f"),
    ),
)


def _size(rows: Sequence[FittedCoefficient], name: str) -> list[float]:
    return [getattr(row, name) / (ARCSECOND if row.turns else MILLIMETRE) for row in rows]


COEFFICIENTS = Table[Sequence[FittedCoefficient]](
    "model-coefficients.csv",
    PAGE,
    (
        Column("owner", "", "frame or group that moves", each(lambda row: row.owner)),
        Column("component", "", "`shift_x` to `turn_z`", each(lambda row: row.component)),
        Column("function", "", "term, or knot of a table", each(lambda row: row.function)),
        Column(
            "before", "", "coefficient of the model: mm of a shift, ″ of a turn", lambda r: _size(r, "before"), ".5f"
        ),
        Column("after", "", "fitted coefficient, likewise", lambda r: _size(r, "after"), ".5f"),
        Column("u", "", "standard uncertainty of `after`", lambda r: _size(r, "u"), ".5f"),
    ),
)


@dataclass(frozen=True, eq=False)
class EpochRows:
    """Source of model-residuals.csv: a row per epoch and target."""

    findings: ModelFindings

    @property
    def each(self) -> list[tuple[int, str]]:
        """Epoch and target of the rows."""
        return [(k, name) for k, epoch in enumerate(self.findings.epochs) for name in epoch.names]


def _model_residual(k: int) -> Column[EpochRows]:
    doc = f"measured less fitted along {'xyz'[k]}, ground axes"
    return Column(f"residual_{'xyz'[k]}_mm", "mm", doc, lambda rows: rows.findings.residuals[:, k] / MILLIMETRE, ".4f")


def _elevations(rows: EpochRows) -> np.ndarray:
    return np.array([float(np.ravel(rows.findings.epochs[k].posture.elevation)[0]) / DEGREE for k, _ in rows.each])


RESIDUALS = Table[EpochRows](
    "model-residuals.csv",
    PAGE,
    (
        Column("epoch", "", "label of the epoch", lambda rows: [rows.findings.labels[k] for k, _ in rows.each]),
        Column("elevation_deg", "deg", "elevation", _elevations, ".6f"),
        Column("point", "", "target", lambda rows: [name for _, name in rows.each]),
        *(_model_residual(k) for k in range(3)),
    ),
)


def _of_node(model: ImportedModel, k: int, *, residual: bool) -> np.ndarray:
    values = model.residual if residual else model.rigid + model.residual
    return np.asarray(values[..., k].ravel() / MILLIMETRE)


def _total(k: int) -> Column[ImportedModel]:
    doc = f"displacement per unit of the term along {'xyz'[k]}, axes of the body"
    return Column(f"d{'xyz'[k]}_mm", "mm", doc, lambda model: _of_node(model, k, residual=False), ".4f")


def _residual(k: int) -> Column[ImportedModel]:
    doc = f"its part that no frame's motion has, along {'xyz'[k]}"
    return Column(f"own_d{'xyz'[k]}_mm", "mm", doc, lambda model: _of_node(model, k, residual=True), ".4f")


NODES = Table[ImportedModel](
    "model-nodes.csv",
    PAGE,
    (
        Column("target", "", "target", lambda m: [each.target for each in m.matches for _ in m.terms]),
        Column("node", "", "number of its node", lambda m: [each.node for each in m.matches for _ in m.terms]),
        Column(
            "distance_m",
            "m",
            "distance of the node from the target at rest",
            lambda m: np.repeat([each.distance for each in m.matches], len(m.terms)),
            ".4f",
        ),
        Column("term", "", "function of posture", lambda m: list(m.terms) * len(m.matches)),
        *(_total(k) for k in range(3)),
        *(_residual(k) for k in range(3)),
    ),
)


POINTS = Table[PointChoice](
    "model-points.csv",
    PAGE,
    (
        Column("target", "", "cardinal point, in the order of the choice", lambda choice: list(choice.names)),
        Column("lines", "", "its lines in all postures", lambda choice: choice.candidates.lines[list(choice.order)]),
        Column("bits", "", "information of the points up to this one", lambda choice: choice.gains / NATS, ".3f"),
        Column(
            "alone_bits",
            "",
            "information of the point by itself",
            lambda choice: choice.alone[list(choice.order)] / NATS,
            ".3f",
        ),
    ),
)
