"""Report of a surface, one self-contained HTML page."""

from collections.abc import Mapping
from datetime import datetime
from html import escape

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.surface.figures import actuator_map, change_map, elevation_terms, shape_map, zernike_bars
from catseye.gateways.surface.objects import (
    actuators_passage,
    change_passages,
    lookup_passages,
    shape_passages,
)
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import verdict_line
from catseye.optics.zernike import number
from catseye.reduction.surface.actuators import Actuators
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.findings import SurfaceFindings
from catseye.reduction.surface.lookup import Lookup
from catseye.reduction.surface.shape import Expansion, MeanSquare, ShapeSettings, SurfaceShape


def surface_report(result: SurfaceFindings, when: datetime, inputs: Mapping[str, str]) -> str:
    """HTML report.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    body = [_header(result, when), verdict_line(result.verdict)]
    if result.lookup is not None:
        body.append(_lookup(result.lookup))
    if result.change is not None:
        body.append(_change(result.change))
    body += [_shape(shape, k + 1, len(result.shapes)) for k, shape in enumerate(result.shapes)]
    if result.actuators is not None:
        body.append(_actuators(result.actuators, result.shapes[-1]))
    rows = [(name, digest) for name, digest in inputs.items()]
    versions_text = ", ".join(f"{k} {v}" for k, v in versions().items())
    body.append(section("origin", "Origin", paragraph(versions_text, "faint"), table(("file", "SHA-256"), rows, "th")))
    return page("catseye: surface", "\n".join(body))


def _header(result: SurfaceFindings, when: datetime) -> str:
    names = ", ".join(shape.prisms.source for shape in result.shapes)
    return (
        f"<header><h1>The surface</h1><div class='faint'>{escape(names)}; by catseye on {when:%Y-%m-%d %H:%M} UTC; "
        "deviations along the normal, positive towards the focus; half-path errors are half of the "
        "path's shortening; u = standard uncertainty, 1σ</div></header>"
    )


def _definitions(passages: list[Passage]) -> str:
    return "<dl>" + "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages) + "</dl>"


def _cards(square: MeanSquare, extra: list[str]) -> str:
    text = "not above the noise" if square.rms is None else f"{square.rms / MILLIMETRE:.3f} mm"
    first = card("Half-path rms", text, "weighted by the illumination, without measurement noise")
    return f'<div class="cards">{first}{"".join(extra)}</div>'


def _shape(shape: SurfaceShape, epoch: int, of: int) -> str:
    title = "The dish" if of == 1 else f"Epoch {epoch}: {shape.prisms.source}"
    gains = [
        card(f"Gain at {g.frequency / 1e9:g} GHz", f"{g.ruze:.3f}", f"± {g.u_ruze:.3f} of the perfect surface's, Ruze")
        for g in shape.gains
    ]
    u = float(np.median(np.sqrt(np.diag(shape.fit.deviation_covariance)))) / MILLIMETRE
    return section(
        f"epoch-{epoch}",
        title,
        _cards(shape.square, gains),
        _definitions(shape_passages(shape)),
        picture(
            svg(shape_map(shape)),
            f"Half-path errors from the fitted paraboloid, u of a deviation {u:.3f} mm (median); colours between "
            "prisms are linear interpolation in triangles. Dashed: the aperture.",
        ),
        *_terms(shape.expansion, shape.settings),
    )


def _change(change: Change) -> str:
    return section(
        "change",
        "The change",
        _cards(change.square, []),
        _definitions(change_passages(change)),
        picture(
            svg(change_map(change)),
            "Second epoch minus first, after removing the dish's motion, fitted in all three coordinates.",
        ),
        *_terms(change.expansion, change.settings),
    )


def _terms(expansion: Expansion, settings: ShapeSettings) -> list[str]:
    u, u_joint = np.sqrt(np.diag(expansion.covariance)), np.sqrt(np.diag(expansion.joint_covariance))
    rows = [
        (
            str(number(term, settings.numbering)),
            term.name,
            f"{expansion.value[k] / MILLIMETRE:+.4f}",
            f"{u[k] / MILLIMETRE:.4f}",
            f"{round(100.0 * float(expansion.share[k]))} %",
            *_cell(expansion.joint[k], u_joint[k]),
        )
        for k, term in enumerate(expansion.terms)
    ]
    columns = (settings.numbering, "term", "residual (mm)", "u (mm)", "absorbed by the fit", "term (mm)", "u (mm)")
    return [
        picture(svg(zernike_bars(expansion, settings)), "Zernike terms of the half-path errors after the fit."),
        table(columns, rows, "ntnnnnn"),
        paragraph(
            "Residual: coefficient of the errors after the fit. Absorbed: share of the term's square absorbed by the "
            "fitted paraboloid or the dish's motion. Term: estimated together with the paraboloid; empty where the "
            "paraboloid absorbs it completely.",
            "faint",
        ),
    ]


def _cell(value: float, u: float) -> tuple[str, str]:
    return (f"{value / MILLIMETRE:+.4f}", f"{u / MILLIMETRE:.4f}") if np.isfinite(u) else ("", "")


def _lookup(lookup: Lookup) -> str:
    numbering = lookup.shapes[0].settings.numbering
    rows = [
        (
            str(number(model.term, numbering)),
            model.term.name,
            *(
                f"{v / MILLIMETRE:+.4f} ± {model.raised * np.sqrt(s) / MILLIMETRE:.4f}"
                for v, s in zip(model.value, np.diag(model.covariance), strict=True)
            ),
            f"{model.variance_factor:.2f}" if np.isfinite(model.variance_factor) else "",
        )
        for model in lookup.models
    ]
    columns = ("term", "name", *(f"{name} (mm)" for name in lookup.columns), "variance factor")
    return section(
        "elevation",
        "Terms by elevation",
        _definitions(lookup_passages(lookup)),
        picture(
            svg(elevation_terms(lookup)),
            "Terms that change most with elevation. Triangles: epochs, up and down; lines: the model; grey: its 1σ.",
        ),
        table(columns, rows, "nt" + "n" * (len(lookup.columns) + 1)),
        paragraph(
            "Thermal: mm per degree. Hysteresis: the term going up minus going down. Where "
            "epochs scatter more than claimed (variance factor above 1), u is increased by its root.",
            "faint",
        ),
    )


def _actuators(actuators: Actuators, shape: SurfaceShape) -> str:
    return section(
        "actuators",
        "Actuators",
        _definitions([actuators_passage(actuators)]),
        picture(svg(actuator_map(actuators, shape.aperture)), "Corrections and their standard uncertainty."),
    )
