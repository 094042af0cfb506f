"""Tables of a surface: prisms, Zernike terms, look-up table, actuators; CSV and FITS."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.columns import Column, Table, each
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable
from catseye.optics.zernike import Numbering, number
from catseye.records.panels.actuators import ActuatorCorrection
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.lookup import Lookup
from catseye.reduction.surface.shape import Expansion, SurfaceShape

PAGE = "surface.md"


@dataclass(frozen=True, eq=False)
class WeightedPrisms:
    """Source of prisms.csv: n prisms of a shape or of a change; m.

    local                    (n, 3)
    deviation, u_deviation   (n,) along the normal
    half_path                (n,)
    weights                  (n,) shares of the illumination
    """

    names: Sequence[str]
    local: np.ndarray
    deviation: np.ndarray
    u_deviation: np.ndarray
    half_path: np.ndarray
    weights: np.ndarray


PRISMS = Table[WeightedPrisms](
    "prisms.csv",
    PAGE,
    (
        Column("point", "", "name of the prism", lambda p: p.names),
        Column(
            "x_dish_m",
            "m",
            "place in the fitted paraboloid's frame, of a change in the nominal one's, x",
            lambda p: p.local[:, 0],
        ),
        Column("y_dish_m", "m", "place in that frame, y", lambda p: p.local[:, 1]),
        Column("z_dish_m", "m", "place in that frame, z", lambda p: p.local[:, 2]),
        Column(
            "deviation_mm",
            "mm",
            "along the normal, positive towards the focus; of a change second epoch less first",
            lambda p: p.deviation / MILLIMETRE,
        ),
        Column("u_deviation_mm", "mm", "standard uncertainty of the deviation", lambda p: p.u_deviation / MILLIMETRE),
        Column(
            "half_path_mm", "mm", "half of what the deviation shortens the path", lambda p: p.half_path / MILLIMETRE
        ),
        Column("weight", "", "share of the illumination nearest to the prism", lambda p: p.weights),
    ),
    also=("prisms-*.csv", "change.csv"),
)


@dataclass(frozen=True, eq=False)
class TermRows:
    """Source of zernike.csv: a row per term."""

    expansion: Expansion
    numbering: Numbering


def _term(name: str, doc: str, value: Callable[[Expansion], np.ndarray]) -> Column[TermRows]:
    """Column in millimetres of values in metres."""
    return Column(f"{name}_mm", "mm", doc, lambda t: value(t.expansion) / MILLIMETRE)


ZERNIKE = Table[TermRows](
    "zernike.csv",
    PAGE,
    (
        Column(
            "number", "", "number by Noll or ANSI", lambda t: [number(term, t.numbering) for term in t.expansion.terms]
        ),
        Column("n", "", "radial degree", lambda t: [term.n for term in t.expansion.terms]),
        Column("m", "", "azimuthal order, positive for the cosine", lambda t: [term.m for term in t.expansion.terms]),
        Column("name", "", "name", lambda t: [term.name for term in t.expansion.terms]),
        _term("value", "coefficient of the errors after the fit", lambda e: e.value),
        _term("u", "standard uncertainty of that coefficient", lambda e: np.sqrt(np.diag(e.covariance))),
        Column(
            "share_taken",
            "",
            "share of its square that the paraboloid's free parameters take, of a change the motion",
            lambda t: t.expansion.share,
        ),
        _term(
            "joint",
            "coefficient estimated together with the paraboloid; empty where that stands for it",
            lambda e: e.joint,
        ),
        _term(
            "u_joint", "standard uncertainty of the joint coefficient", lambda e: np.sqrt(np.diag(e.joint_covariance))
        ),
        _term(
            "orthonormal",
            "coefficient of terms orthonormal on these prisms under the illumination",
            lambda e: e.orthonormal,
        ),
        _term("u_orthonormal", "standard uncertainty of the orthonormal coefficient", lambda e: e.u_orthonormal),
    ),
    also=("zernike-*.csv", "change-zernike.csv"),
)


@dataclass(frozen=True, eq=False)
class LookupRows:
    """Source of lookup.csv: a row per elevation and term."""

    lookup: Lookup

    @property
    def cells(self) -> list[tuple[int, int]]:
        """Elevation and term of each row."""
        return list(np.ndindex(len(self.lookup.table_deg), len(self.lookup.models)))

    @property
    def numbering(self) -> Numbering:
        return self.lookup.shapes[0].settings.numbering


def _direction(k: int, name: str) -> tuple[Column[LookupRows], Column[LookupRows]]:
    """Two columns of table[elevation, term, direction]: value and u."""
    doc = "coefficient at this elevation, " + ("mean of both directions" if name == "mean" else f"telescope {name}")
    return (
        Column(f"{name}_mm", "mm", doc, lambda t: t.lookup.table[:, :, k].ravel() / MILLIMETRE),
        Column(f"u_{name}_mm", "mm", "standard uncertainty", lambda t: t.lookup.u_table[:, :, k].ravel() / MILLIMETRE),
    )


LOOKUP = Table[LookupRows](
    "lookup.csv",
    PAGE,
    (
        Column("elevation_deg", "deg", "elevation", lambda t: [float(t.lookup.table_deg[e]) for e, _ in t.cells]),
        Column(
            "number",
            "",
            "number of the Zernike term",
            lambda t: [number(t.lookup.models[k].term, t.numbering) for _, k in t.cells],
        ),
        Column("name", "", "name of the term", lambda t: [t.lookup.models[k].term.name for _, k in t.cells]),
        *(column for k, name in enumerate(("rising", "mean", "falling")) for column in _direction(k, name)),
    ),
)


class EpochTerm(NamedTuple):
    """Row of epochs.csv: term k in epoch t of a look-up table."""

    lookup: Lookup
    t: int
    k: int


EPOCHS = Table[Sequence[EpochTerm]](
    "epochs.csv",
    PAGE,
    (
        Column("epoch", "", "epoch, from 1", each(lambda r: r.t + 1)),
        Column("source", "", "directory or file", each(lambda r: r.lookup.shapes[r.t].prisms.source)),
        Column("elevation_deg", "deg", "elevation", each(lambda r: float(r.lookup.elevation_deg[r.t]))),
        Column(
            "rising",
            "",
            "`yes` where the telescope came from below",
            each(lambda r: "yes" if r.lookup.rising[r.t] > 0.0 else "no"),
        ),
        Column(
            "number",
            "",
            "number of the Zernike term",
            each(lambda r: number(r.lookup.models[r.k].term, r.lookup.shapes[0].settings.numbering)),
        ),
        Column("name", "", "name of the term", each(lambda r: r.lookup.models[r.k].term.name)),
        Column(
            "value_mm", "mm", "measured coefficient", each(lambda r: float(r.lookup.measured[r.t, r.k]) / MILLIMETRE)
        ),
        Column(
            "u_mm",
            "mm",
            "standard uncertainty of the coefficient",
            each(lambda r: float(r.lookup.u_measured[r.t, r.k]) / MILLIMETRE),
        ),
        Column(
            "residual_mm",
            "mm",
            "measured less model",
            each(lambda r: float(r.lookup.models[r.k].residual[r.t]) / MILLIMETRE),
        ),
        Column(
            "w",
            "",
            "residual over its own standard deviation",
            each(lambda r: float(r.lookup.models[r.k].standardised[r.t])),
        ),
    ),
)


def _field(name: str, unit: str, doc: str) -> Column[Sequence[ActuatorCorrection]]:
    """Column of a field of the record that reads the table."""
    return Column(name, unit, doc, each(attrgetter(name)))


ACTUATORS = Table[Sequence[ActuatorCorrection]](
    "actuators.csv",
    PAGE,
    (
        _field("actuator", "", "name of the prism above it"),
        _field("x_m", "m", "design place in the reflector frame, x"),
        _field("y_m", "m", "design place, y"),
        _field("z_m", "m", "design place, z"),
        Column(
            "deviation_mm",
            "mm",
            "deviation of the surface there from the fitted paraboloid",
            each(lambda a: a.deviation_mm),
        ),
        _field("u_deviation_mm", "mm", "standard uncertainty of the deviation"),
        Column(
            "correction_mm",
            "mm",
            "correction of the travel: the opposite, along the axis divided by the cosine of the incidence",
            each(lambda a: a.correction_mm),
        ),
        _field("u_correction_mm", "mm", "standard uncertainty of the correction"),
        _field("steps", "", "whole steps of 0.025 mm"),
        _field("left_mm", "mm", "what the steps leave of the correction"),
        _field("position_mm", "mm", "travel before (`--positions`); 0 where unknown"),
        _field("target_mm", "mm", "travel after the steps"),
        _field("within_limits", "", "`yes` where the target is within ± 25.4 mm; nothing is cut"),
        _field("how", "", "`measured`: by its own prism; `foretold`: predicted without one"),
        _field("prisms", "", "the three prisms that support it most"),
        _field("weight", "", "their share of all weights"),
    ),
)
ACTUATOR_MARK = ACTUATORS.header  # identifies a file of catseye


def prisms_csv(shape: SurfaceShape) -> str:
    """One row per prism, in the fitted paraboloid's frame; the weight is its share of illumination."""
    return PRISMS.csv(
        WeightedPrisms(
            names=shape.prisms.names,
            local=shape.fit.local,
            deviation=shape.fit.deviation,
            u_deviation=np.sqrt(np.diag(shape.fit.deviation_covariance)),
            half_path=shape.fit.half_path,
            weights=shape.weights,
        )
    )


def change_csv(change: Change) -> str:
    """One row per prism of both epochs, second minus first.

    Places are those of the first epoch, in the nominal paraboloid's frame.
    """
    return PRISMS.csv(
        WeightedPrisms(
            names=change.names,
            local=change.local,
            deviation=change.deviation,
            u_deviation=np.sqrt(np.diag(change.deviation_covariance)),
            half_path=change.half_path,
            weights=change.weights,
        )
    )


def zernike_csv(expansion: Expansion, numbering: Numbering) -> str:
    """Zernike terms as CSV, one row per term."""
    return ZERNIKE.csv(TermRows(expansion, numbering))


def lookup_csv(lookup: Lookup) -> str:
    """One row per elevation and term: rising, mean, falling, u."""
    return LOOKUP.csv(LookupRows(lookup))


def epochs_csv(lookup: Lookup) -> str:
    """One row per epoch and term: measured value and residual to the model."""
    cells = np.ndindex(len(lookup.shapes), len(lookup.models))
    return EPOCHS.csv([EpochTerm(lookup, t, k) for t, k in cells])


def actuators_csv(rows: Iterable[ActuatorCorrection]) -> str:
    """One row per actuator, read back to the bit as `ActuatorCorrection`."""
    return ACTUATORS.csv(list(rows))


def actuators_table(rows: Sequence[ActuatorCorrection]) -> SamplerTable:
    """The same as a table ACTUATORS of FITS samplers; units are in TUNIT, not in the names."""
    columns = {
        column.label.upper(): SamplerColumn(column.unit, column.value(rows) or []) for column in ACTUATORS.columns
    }
    return SamplerTable("ACTUATORS", columns, comment="corrections of a surface's actuators", frame="reflector")
