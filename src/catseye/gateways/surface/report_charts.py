"""Charts of the report of a surface: maps, Zernike terms, terms by elevation, actuators."""

import numpy as np

from catseye.constants import MILLIMETRE, TWO_PI
from catseye.gateways.writers.report import ChartBlock
from catseye.gateways.writers.report_parts import Axis, Chart, Coloured
from catseye.optics.zernike import number
from catseye.reduction.surface.actuators import Actuators
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.lookup import HYSTERESIS, Lookup
from catseye.reduction.surface.shape import Expansion, LitAperture, ShapeSettings, SurfaceShape

PANELS = 6  # terms drawn by elevation
RIM = 73  # points of the aperture's outline


def _map(xy: np.ndarray, value: Coloured, aperture: LitAperture, names: tuple[str, ...] = ()) -> Chart:
    """Map of values over the aperture; xy (k, 2 or 3) m in the dish's frame."""
    angle = np.linspace(0.0, TWO_PI, RIM)
    rim = np.array(aperture.centre)[:2] + aperture.radius * np.column_stack([np.cos(angle), np.sin(angle)])
    x = Axis("x in the dish's frame", "m", xy[:, 0], digits=4)
    y = Axis("y in the dish's frame, from the vertex", "m", xy[:, 1], digits=4)
    return Chart("map", x, y, value=value, names=names, outline=[rim])


def shape_chart(shape: SurfaceShape) -> Chart:
    """Map of half-path errors of one epoch relative to its fitted paraboloid."""
    value = Coloured("half-path error", "mm", shape.fit.half_path / MILLIMETRE, 5)
    return _map(shape.fit.local, value, shape.aperture, shape.prisms.names)


def change_chart(change: Change) -> Chart:
    """Map of the half-path change between two epochs."""
    value = Coloured("change of half path", "mm", change.half_path / MILLIMETRE, 5)
    return _map(change.local, value, change.aperture, change.names)


def actuator_charts(actuators: Actuators, aperture: LitAperture) -> list[ChartBlock]:
    """Maps of actuator corrections and their standard uncertainty."""
    correction = Coloured("correction", "mm", actuators.correction / MILLIMETRE, 5)
    usual = float(np.median(actuators.u_correction))
    u = Coloured("standard uncertainty, from the median", "mm", (actuators.u_correction - usual) / MILLIMETRE, 5)
    return [
        ChartBlock("actuators", _map(actuators.places, correction, aperture), "Corrections."),
        ChartBlock(
            "actuators-u",
            _map(actuators.places, u, aperture),
            f"Their standard uncertainty, {usual / MILLIMETRE:.4f} mm in the median.",
        ),
    ]


def zernike_chart(expansion: Expansion, settings: ShapeSettings) -> Chart:
    """Bars of Zernike terms with standard uncertainties, without piston and tilts."""
    chosen = [k for k, term in enumerate(expansion.terms) if term.n >= 2] or list(range(len(expansion.terms)))
    names = [f"{number(expansion.terms[k], settings.numbering)} {expansion.terms[k].name}" for k in chosen]
    return Chart(
        "bars",
        Axis("term", "", np.arange(len(chosen)), names, digits=0),
        Axis(
            "half-path error of the term, rms over the aperture", "mm", expansion.value[chosen] / MILLIMETRE, digits=6
        ),
        u=np.sqrt(np.diag(expansion.covariance))[chosen] / MILLIMETRE,
        names=[expansion.terms[k].name for k in chosen],
    )


def elevation_charts(lookup: Lookup) -> list[ChartBlock]:
    """Terms that change most with elevation: epochs, up and down, and the model."""
    span = np.ptp(lookup.table[:, :, 1], axis=0)
    order = [int(k) for k in np.argsort(span)[::-1] if lookup.models[k].term.n >= 2][:PANELS] or [0]
    return [ChartBlock(f"elevation-{k}", _by_elevation(lookup, k), _caption(lookup, k)) for k in order]


def _caption(lookup: Lookup, k: int) -> str:
    return f"{lookup.models[k].term.name}: epochs going up and down with their u, and the model with its u."


def _by_elevation(lookup: Lookup, k: int) -> Chart:
    ways = [("going up", lookup.rising > 0.0), ("going down", lookup.rising < 0.0)]
    curves = [("model, going up", 0), ("model, going down", 2)] if HYSTERESIS in lookup.columns else [("model", 1)]
    x = [lookup.elevation_deg[rows] for _, rows in ways] + [lookup.table_deg] * len(curves)
    y = [lookup.measured[rows, k] for _, rows in ways] + [lookup.table[:, k, column] for _, column in curves]
    u = [lookup.u_measured[rows, k] for _, rows in ways] + [lookup.u_table[:, k, column] for _, column in curves]
    return Chart(
        "scatter",
        Axis("elevation", "°", np.concatenate(x), digits=3),
        Axis("half path, rms", "mm", np.concatenate(y) / MILLIMETRE, digits=6),
        u=np.concatenate(u) / MILLIMETRE,
        group=np.repeat(np.arange(len(x)), [len(part) for part in x]),
        groups=[name for name, _ in (*ways, *curves)],
    )
