"""Report of a surface."""

from collections.abc import Mapping
from datetime import datetime

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.surface.objects import actuators_passage, change_passages, lookup_passages, shape_passages
from catseye.gateways.surface.report_charts import (
    actuator_charts,
    change_chart,
    elevation_charts,
    shape_chart,
    zernike_chart,
)
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import ReportTable, number, sentences, text, uncertainty
from catseye.optics.zernike import number as zernike_number
from catseye.reduction.surface.actuators import Actuators
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.findings import SurfaceFindings
from catseye.reduction.surface.lookup import Lookup
from catseye.reduction.surface.shape import Expansion, MeanSquare, ShapeSettings, SurfaceShape


def surface_report(result: SurfaceFindings, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a surface.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    names = ", ".join(shape.prisms.source for shape in result.shapes)
    single = result.shapes[0] if len(result.shapes) == 1 else None
    return ResultReport(
        title="The surface",
        subtitle=(
            f"{names}; by catseye on {when:%Y-%m-%d %H:%M} UTC; deviations along the normal, positive towards the "
            "focus; half-path errors are half of the path's shortening; u = standard uncertainty, 1σ"
        ),
        verdict=result.verdict,
        cards=_cards(single) if single is not None else [] if result.change is None else [_rms(result.change.square)],
        passages=shape_passages(single) if single is not None else (),
        sections=[
            _lookup(result.lookup) if result.lookup else None,
            _change(result.change) if result.change else None,
            *(_shape(shape, k + 1, single is not None) for k, shape in enumerate(result.shapes)),
            _actuators(result.actuators, result.shapes[-1]) if result.actuators else None,
            origin_section(when, inputs),
        ],
        label="catseye: surface",
    )


def _rms(square: MeanSquare) -> Card:
    value = "not above the noise" if square.rms is None else f"{square.rms / MILLIMETRE:.3f} mm"
    return Card("Half-path rms", value, "weighted by the illumination, without measurement noise")


def _cards(shape: SurfaceShape) -> list[Card]:
    return [_rms(shape.square)] + [
        Card(f"Gain at {g.frequency / 1e9:g} GHz", f"{g.ruze:.3f}", f"± {g.u_ruze:.3f} of the perfect surface's, Ruze")
        for g in shape.gains
    ]


def _quantities(key: str, cards: list[Card]) -> TableBlock:
    heads = (text("quantity", "quantity"), text("value", "value"), text("remark", "remark"))
    return TableBlock(key, ReportTable.of_rows(cards, *heads))


def _shape(shape: SurfaceShape, epoch: int, single: bool) -> ReportSection:
    u = float(np.median(np.sqrt(np.diag(shape.fit.deviation_covariance)))) / MILLIMETRE
    key = f"epoch-{epoch}"
    lead: list[Block] = [
        _quantities(f"{key}-quantities", _cards(shape)),
        TableBlock(f"{key}-results", sentences(shape_passages(shape))),
    ]
    caption = f"Half-path errors from the fitted paraboloid, u of a deviation {u:.3f} mm (median). Line: the aperture."
    return ReportSection(
        key,
        "The dish" if single else f"Epoch {epoch}: {shape.prisms.source}",
        [
            *([] if single else lead),
            ChartBlock(f"{key}-map", shape_chart(shape), caption),
            TableBlock(f"{key}-prisms", _prisms(shape), folded="Prisms and their half-path errors"),
            *_terms(f"{key}-terms", shape.expansion, shape.settings),
        ],
    )


def _prisms(shape: SurfaceShape) -> ReportTable:
    fit = shape.fit
    u = np.sqrt(np.diag(fit.deviation_covariance)) / MILLIMETRE
    return ReportTable(
        (
            text("point", "prism", shape.prisms.names),
            *(number(f"{a}_dish", f"{a} in the dish's frame", fit.local[:, k], "m", 5) for k, a in enumerate("xyz")),
            number("deviation", "deviation", fit.deviation / MILLIMETRE, "mm", 4, u="u_deviation"),
            uncertainty("u_deviation", "u", u, "mm", 4),
            number("half_path", "half-path error", fit.half_path / MILLIMETRE, "mm", 4),
        ),
        "point",
    )


def _change(change: Change) -> ReportSection:
    caption = "Second epoch minus first, after removing the dish's motion, fitted in all three coordinates."
    return ReportSection(
        "change",
        "The change",
        [
            _quantities("change-quantities", [_rms(change.square)]),
            TableBlock("change-results", sentences(change_passages(change))),
            ChartBlock("change-map", change_chart(change), caption),
            *_terms("change-terms", change.expansion, change.settings),
        ],
    )


def _terms(key: str, expansion: Expansion, settings: ShapeSettings) -> list[Block]:
    u, u_joint = np.sqrt(np.diag(expansion.covariance)), np.sqrt(np.diag(expansion.joint_covariance))
    known = np.isfinite(u_joint)
    table = ReportTable(
        (
            number(
                "number", settings.numbering, [zernike_number(t, settings.numbering) for t in expansion.terms], digits=0
            ),
            text("term", "term", [t.name for t in expansion.terms]),
            number("residual", "residual", expansion.value / MILLIMETRE, "mm", 4, u="u_residual"),
            uncertainty("u_residual", "u", u / MILLIMETRE, "mm", 4),
            number("absorbed", "absorbed by the fit", 100.0 * np.asarray(expansion.share), "%", 0),
            number("joint", "term", np.where(known, expansion.joint, np.nan) / MILLIMETRE, "mm", 4, u="u_joint"),
            uncertainty("u_joint", "u of the term", u_joint / MILLIMETRE, "mm", 4),
        ),
        "term",
    )
    return [
        ChartBlock(key, zernike_chart(expansion, settings), "Zernike terms of the half-path errors after the fit."),
        TableBlock(key, table),
        Text(
            "Residual: coefficient of the errors after the fit. Absorbed: share of the term's square absorbed by the "
            "fitted paraboloid or the dish's motion. Term: estimated together with the paraboloid; unknown where the "
            "paraboloid absorbs it completely.",
            faint=True,
        ),
    ]


def _lookup(lookup: Lookup) -> ReportSection:
    numbering, models = lookup.shapes[0].settings.numbering, lookup.models
    u = [model.raised * np.sqrt(np.diag(model.covariance)) / MILLIMETRE for model in models]
    coefficients = [
        column
        for k, name in enumerate(lookup.columns)
        for column in (
            number(f"c_{k + 1}", name, [m.value[k] / MILLIMETRE for m in models], "mm", 4, u=f"u_{k + 1}"),
            uncertainty(f"u_{k + 1}", f"u {name}", [v[k] for v in u], "mm", 4),
        )
    ]
    table = ReportTable(
        (
            number("number", "term", [zernike_number(m.term, numbering) for m in models], digits=0),
            text("term", "name", [m.term.name for m in models]),
            *coefficients,
            number("variance_factor", "variance factor", [m.variance_factor for m in models], digits=2),
        ),
        "term",
    )
    return ReportSection(
        "elevation",
        "Terms by elevation",
        [
            TableBlock("elevation-results", sentences(lookup_passages(lookup))),
            *elevation_charts(lookup),
            TableBlock("elevation-terms", table),
            Text(
                "Thermal: mm per degree. Hysteresis: the term going up minus going down. Where "
                "epochs scatter more than claimed (variance factor above 1), u is increased by its root.",
                faint=True,
            ),
        ],
    )


def _actuators(actuators: Actuators, shape: SurfaceShape) -> ReportSection:
    return ReportSection(
        "actuators",
        "Actuators",
        [
            TableBlock("actuator-results", sentences([actuators_passage(actuators)])),
            *actuator_charts(actuators, shape.aperture),
        ],
    )
