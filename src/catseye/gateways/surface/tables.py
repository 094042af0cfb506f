"""Tables of a surface: prisms, Zernike terms, look-up table, actuators; CSV and FITS."""

from collections.abc import Iterable, Sequence

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable
from catseye.gateways.writers.written import csv_text
from catseye.optics.zernike import Numbering, number
from catseye.records.panels.actuators import ActuatorCorrection
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.lookup import Lookup
from catseye.reduction.surface.shape import Expansion, SurfaceShape

PRISMS = ("point", "x_dish_m", "y_dish_m", "z_dish_m", "deviation_mm", "u_deviation_mm", "half_path_mm", "weight")
ZERNIKE = (
    *("number", "n", "m", "name", "value_mm", "u_mm", "share_taken"),
    *("joint_mm", "u_joint_mm", "orthonormal_mm", "u_orthonormal_mm"),
)
ACTUATOR_MARK = ",".join(ActuatorCorrection.model_fields)  # the header, which identifies a file of catseye


def prisms_csv(shape: SurfaceShape) -> str:
    """One row per prism, in the fitted paraboloid's frame; the weight is its share of illumination."""
    u = np.sqrt(np.diag(shape.fit.deviation_covariance)) / MILLIMETRE
    cells = zip(
        shape.prisms.names,
        shape.fit.local.tolist(),
        (shape.fit.deviation / MILLIMETRE).tolist(),
        u.tolist(),
        (shape.fit.half_path / MILLIMETRE).tolist(),
        shape.weights.tolist(),
        strict=True,
    )
    return csv_text(PRISMS, ((name, *place, d, s, h, w) for name, place, d, s, h, w in cells))


def change_csv(change: Change) -> str:
    """One row per prism of both epochs, second minus first.

    Places are those of the first epoch, in the nominal paraboloid's frame.
    """
    u = np.sqrt(np.diag(change.deviation_covariance)) / MILLIMETRE
    cells = zip(
        change.names,
        change.local.tolist(),
        (change.deviation / MILLIMETRE).tolist(),
        u.tolist(),
        (change.half_path / MILLIMETRE).tolist(),
        change.weights.tolist(),
        strict=True,
    )
    return csv_text(PRISMS, ((name, *place, d, s, h, w) for name, place, d, s, h, w in cells))


def zernike_csv(expansion: Expansion, numbering: Numbering) -> str:
    """Zernike terms as CSV, one row per term."""
    u, u_joint = np.sqrt(np.diag(expansion.covariance)), np.sqrt(np.diag(expansion.joint_covariance))
    columns = [
        values / MILLIMETRE
        for values in (expansion.value, u, expansion.joint, u_joint, expansion.orthonormal, expansion.u_orthonormal)
    ]
    rows = []
    for k, term in enumerate(expansion.terms):
        value, spread, joint, u_j, ortho, u_o = (float(column[k]) for column in columns)
        share = float(expansion.share[k])
        rows.append((number(term, numbering), term.n, term.m, term.name, value, spread, share, joint, u_j, ortho, u_o))
    return csv_text(ZERNIKE, rows)


def lookup_csv(lookup: Lookup) -> str:
    """One row per elevation and term: rising, mean, falling, u."""
    header = [f"{u}{direction}_mm" for direction in ("rising", "mean", "falling") for u in ("", "u_")]
    numbering = lookup.shapes[0].settings.numbering
    rows = [
        (
            float(elevation),
            number(model.term, numbering),
            model.term.name,
            *(float(v[e, k, direction]) / MILLIMETRE for direction in range(3) for v in (lookup.table, lookup.u_table)),
        )
        for e, elevation in enumerate(lookup.table_deg)
        for k, model in enumerate(lookup.models)
    ]
    return csv_text(("elevation_deg", "number", "name", *header), rows)


def epochs_csv(lookup: Lookup) -> str:
    """One row per epoch and term: measured value and residual to the model."""
    header = ("epoch", "source", "elevation_deg", "rising", "number", "name", "value_mm", "u_mm", "residual_mm", "w")
    numbering = lookup.shapes[0].settings.numbering
    rows = [
        (
            t + 1,
            shape.prisms.source,
            float(lookup.elevation_deg[t]),
            "yes" if lookup.rising[t] > 0.0 else "no",
            number(model.term, numbering),
            model.term.name,
            float(lookup.measured[t, k]) / MILLIMETRE,
            float(lookup.u_measured[t, k]) / MILLIMETRE,
            float(model.residual[t]) / MILLIMETRE,
            float(model.standardised[t]),
        )
        for t, shape in enumerate(lookup.shapes)
        for k, model in enumerate(lookup.models)
    ]
    return csv_text(header, rows)


def actuators_csv(rows: Iterable[ActuatorCorrection]) -> str:
    """One row per actuator, as read exactly by `read_corrections`."""
    return csv_text(tuple(ActuatorCorrection.model_fields), (tuple(row.model_dump().values()) for row in rows))


def actuators_table(rows: Sequence[ActuatorCorrection]) -> SamplerTable:
    """The same as a table ACTUATORS of FITS samplers; units are in TUNIT, not in the names."""
    columns = {}
    for name in ActuatorCorrection.model_fields:
        unit = "mm" if name.endswith("_mm") else "m" if name.endswith("_m") else ""
        label = (name.removesuffix(f"_{unit}") if unit else name).upper()
        columns[label] = SamplerColumn(unit, [getattr(row, name) for row in rows])
    return SamplerTable("ACTUATORS", columns, comment="corrections of a surface's actuators", frame="reflector")
