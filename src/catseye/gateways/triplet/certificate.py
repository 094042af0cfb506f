"""Certificate of a triplet unit."""

from collections.abc import Iterator, Sequence

from catseye.gateways.certificates.document import Block, CellTable, Chapter, Facts, SvgPicture
from catseye.gateways.certificates.statement import CertifiedSubject
from catseye.gateways.triplet.sheet import SIDE_BY_SIDE, cell, results
from catseye.gateways.triplet.symbols import PLACEMENT, PLATE, UNIT, Symbol, symbol_values
from catseye.reduction.triplet.certified import triplet_quantities
from catseye.reduction.triplet.result import TripletReduction

METHOD = (
    "A ranger measures both prisms and, with the unit turned over, the ball; the height of the ball's centre above the "
    "prisms' mid-point follows from the lengths of all placements, adjusted together. A surface plate gives the same "
    "height by itself. The unit is accepted where both agree within the memo's limit of 0.15 mm (simple acceptance)."
)
WEATHER = ("temperature_c", "pressure_hpa", "humidity_percent")
STATED = ("serial", "measured_on", "valid_until", "by", "report")


def triplet_subject(reduction: TripletReduction, file: str, digest: str) -> CertifiedSubject:
    """Unit as a certificate shows it.

    file, digest   name of its sheet, and the SHA-256 of it
    """
    from catseye.gateways.triplet.figure import triplet_figure  # matplotlib is heavy
    from catseye.gateways.writers.drawing import svg

    m = reduction.measurement
    prisms = f"prisms {m.left_prism.serial} (left) and {m.right_prism.serial} (right)"
    weather = {name: [getattr(placement, name) for placement in m.placement] for name in WEATHER}
    sentences = Facts(tuple((title or "and", text) for title, text in results(reduction)))
    drawn = svg(triplet_figure(reduction))
    identity = {key: getattr(m, key) for key in STATED}
    return CertifiedSubject(
        title=f"Triplet {m.triplet}: height of the ball's centre",
        identity={**identity, "serial": identity["serial"] or m.triplet, "instrument": f"triplet, {prisms}"},
        verdict=reduction.verdict,
        quantities=triplet_quantities(reduction),
        method=METHOD,
        conventions=(),
        covariance=None,
        conditions={name: (min(values), max(values)) for name, values in weather.items()},
        chapters=(
            Chapter("tests", "Acceptance and agreement of the placements", (sentences,)),
            Chapter("figure", "Placements", (SvgPicture(drawn, "H_corr of each placement, its limits, the budget"),)),
            Chapter("unit", "Unit and surface plate", (_once(UNIT, reduction), _once(PLATE, reduction))),
            Chapter("readings", "Readings and lengths of each placement", tuple(_placements(reduction))),
        ),
        hashes={file: digest},
        settings={},
    )


def _once(symbols: Sequence[Symbol], reduction: TripletReduction) -> CellTable:
    rows = tuple((s.label, s.meaning, cell(s, symbol_values(s, reduction)[0]), s.unit or "1") for s in symbols)
    return CellTable(("symbol", "description", "value", "unit"), "twnt", rows)


def _placements(reduction: TripletReduction) -> Iterator[Block]:
    """Symbols of the placements, some side by side."""
    for start in range(0, len(reduction.h), SIDE_BY_SIDE):
        batch = range(start, min(start + SIDE_BY_SIDE, len(reduction.h)))
        rows = []
        for s in PLACEMENT:
            values = symbol_values(s, reduction)
            cells = (cell(s, values[k if len(values) > 1 else 0]) for k in batch)
            rows.append((s.label, s.meaning, *cells, s.unit or "1"))
        rows.append(("status", "of the placement", *(reduction.status[k] for k in batch), ""))
        heads = ("symbol", "description", *(f"no. {k + 1}" for k in batch), "unit")
        yield CellTable(heads, "tw" + "n" * len(batch) + "t", tuple(rows))
