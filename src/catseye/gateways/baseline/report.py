"""Report of an EDM baseline, one self-contained HTML page."""

from collections.abc import Mapping
from datetime import datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.gateways.baseline.figures import baseline_figures
from catseye.gateways.baseline.objects import passages
from catseye.gateways.writers.drawing import svgs
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

CONTENTS = {
    "summary": "Summary",
    "pillars": "Pillars",
    "residuals": "Residuals",
    "tests": "Tests",
    "budget": "Budget",
    "sets": "Sets",
    "provenance": "Provenance",
}


def baseline_report(calibration: "BaselineCalibration", when: datetime, inputs: Mapping[str, str]) -> str:
    """HTML report.

    calibration   a calibration
    when          UTC
    inputs        SHA-256 of each input file, by name
    """
    drawn = svgs(baseline_figures(calibration))
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title in CONTENTS.items())
    header = (
        f"<header><h1>{escape(Path(calibration.observations.file).name)}: EDM baseline</h1>"
        f'<div class="faint">adjusted by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ; '
        f"observed = (1 + scale) × distance + zero + cyclic</div><nav>{links}</nav></header>"
    )
    body = [
        header,
        verdict_line(calibration.verdict),
        _summary(calibration),
        _pillars(calibration, drawn),
        _residuals(drawn),
        _tests(calibration),
        _budget(calibration),
        _sets(calibration),
        _provenance(calibration, when, inputs),
    ]
    return page("catseye: EDM baseline", "\n".join(body))


def _summary(calibration: "BaselineCalibration") -> str:
    s, test = calibration.solution, calibration.test
    zero, u_zero = (v / MILLIMETRE for v in s.of("zero"))
    scale, u_scale = (v / PPM for v in s.of("scale"))
    valid = np.isfinite(scale)
    failed = [d for d in calibration.decisions if d.passed is False]
    longest = max(calibration.spans, key=lambda span: span.distance)
    cards = [
        card("Zero", f"{zero:+.3f} ± {u_zero:.3f} mm", "observed minus true"),
        card("Scale", f"{scale:+.2f} ± {u_scale:.2f} ppm" if valid else "not determined", "positive: reads too long"),
        card(
            "s of one distance",
            f"{test.s / MILLIMETRE:.3f} mm" if isinstance(test, FullTest) else "unknown",
            f"{test.degrees_of_freedom} degrees of freedom" if isinstance(test, FullTest) else test,
        ),
        card(f"{longest.start} to {longest.end}", f"{longest.distance:.4f} m", f"u = {longest.u / MILLIMETRE:.2f} mm"),
    ]
    words = "".join(
        f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages(calibration) if p.title != "Test"
    )
    verdict = "Every test passes." if not failed else f"Failed: {'; '.join(d.name for d in failed)}."
    return section(
        "summary",
        CONTENTS["summary"],
        paragraph(verdict, "bad" if failed else ""),
        f'<div class="cards">{"".join(cards)}</div>',
        f"<dl>{words}</dl>",
    )


def _pillars(calibration: "BaselineCalibration", drawn: dict[str, str]) -> str:
    rows = [
        (name, f"{p.x:.5f}", f"{p.u_x / MILLIMETRE:.3f}", f"{p.y:.5f}", f"{p.u_y / MILLIMETRE:.3f}",
         "" if p.height is None else f"{p.height:.4f}")
        for name, p in calibration.pillars.items()
    ]  # fmt: skip
    pairs = [(a, b, f"{d:.5f}", f"{u / MILLIMETRE:.3f}") for a, b, d, u in calibration.spans]
    height = (
        "one height" if calibration.reference_height is None else f"the height {calibration.reference_height:.3f} m"
    )
    return section(
        "pillars",
        CONTENTS["pillars"],
        picture(drawn["line"], "Pillars along the line from the first to the last, and their offsets from it."),
        table(("pillar", "x (m)", "u (mm)", "y (m)", "u (mm)", "height (m)"), rows, "tnnnnn"),
        paragraph(f"Horizontal distances at {height}; their full covariance is in baseline.json and BASELINE.toml."),
        table(("from", "to", "distance (m)", "u (mm)"), pairs, "ttnn"),
    )


def _residuals(drawn: dict[str, str]) -> str:
    parts = [
        picture(drawn["residuals"], "All shots, by set-up. Shots of a set lie together if the scatter is between sets, "
                "not between shots."),
        picture(drawn["weather"], "Residuals of the longer lines over the change of the corrected length by weather: "
                "flat if the light follows the weather readings, rising if the correction is too large."),
        picture(drawn["corrections"], "Corrections added to the displayed lengths."),
    ]  # fmt: skip
    if "cyclic" in drawn:
        parts.append(picture(drawn["cyclic"], "Cyclic terms over the unit length, with residuals."))
    return section("residuals", CONTENTS["residuals"], *parts)


def _tests(calibration: "BaselineCalibration") -> str:
    verdict = {True: "passed", False: "failed", None: "not possible"}
    rows = [
        (d.name, f"{d.statistic:.4g}" if np.isfinite(d.statistic) else "",
         f"{d.limit:.4g}" if np.isfinite(d.limit) else "", verdict[d.passed], d.text)
        for d in calibration.decisions
    ]  # fmt: skip
    return section(
        "tests",
        CONTENTS["tests"],
        paragraph(
            f"All at the level {calibration.settings.level:g}. Limits follow from claim and degrees of freedom, "
            "not from the scatter under test. A set, its repeats averaged, counts as one distance."
        ),
        table(("test", "statistic", "limit", "outcome", "meaning"), rows, "wnntw"),
    )


def _budget(calibration: "BaselineCalibration") -> str:
    s = calibration.solution
    last = f"x {calibration.order[-1]}"
    parameters = [n for n in ("zero", "scale", *calibration.cyclic, last) if n in s.names]
    at = [s.names.index(n) for n in parameters]
    unit = [PPM if n == "scale" else MILLIMETRE for n in parameters]
    rows = [(cause, *(f"{part[i] / u:.4f}" for i, u in zip(at, unit, strict=True))) for cause, part in s.parts.items()]
    rows.append(("combined", *(f"{s.of(n)[1] / u:.4f}" for n, u in zip(parameters, unit, strict=True))))
    heads = [f"x of {calibration.names[calibration.order[-1]]}" if n == last else n for n in parameters]
    heads = [f"{h} ({'ppm' if n == 'scale' else 'mm'})" for h, n in zip(heads, parameters, strict=True)]
    return section(
        "budget",
        CONTENTS["budget"],
        paragraph("Standard uncertainty by cause; causes are independent and add in quadrature."),
        table(("cause", *heads), rows, "t" + "n" * len(heads)),
    )


def _sets(calibration: "BaselineCalibration") -> str:
    s, shots = calibration.solution, calibration.observations
    first = np.flatnonzero(calibration.keep)[s.used.first]
    scatter = [
        float(np.std(calibration.shot_residuals[calibration.keep][s.used.set == k])) for k in range(len(s.residual))
    ]
    rows = [
        (
            calibration.names[shots.start[row]],
            calibration.names[shots.end[row]],
            str(s.used.shots[k]),
            f"{calibration.lengths.distance[row]:.4f}",
            f"{shots.temperature_c[row]:.1f}",
            f"{s.residual[k] / MILLIMETRE:+.3f}",
            f"{scatter[k] / MILLIMETRE:.3f}",
            f"{s.w_set[k]:+.2f}" if np.isfinite(s.w_set[k]) else "",
            f"{s.redundancy[k]:.2f}",
        )
        for k, row in enumerate(first)
    ]
    columns = ("from", "to", "shots", "distance (m)", "°C", "residual (mm)", "repeats (mm)", "w", "redundancy")
    left_out = [f"row {k + 1}: {why}" for k, why in enumerate(calibration.rejected) if why]
    return section(
        "sets",
        CONTENTS["sets"],
        paragraph("Excluded: " + "; ".join(left_out), "bad") if left_out else "",
        table(columns, rows, "ttnnnnnnn"),
        paragraph("All shots are in observations.csv."),
    )


def _provenance(calibration: "BaselineCalibration", when: datetime, inputs: Mapping[str, str]) -> str:
    facts = [*((k, v) for k, v in versions().items()), *((k, str(v)) for k, v in calibration.settings.__dict__.items())]
    return section(
        "provenance",
        CONTENTS["provenance"],
        table(("file read", "SHA-256"), list(inputs.items()), "th"),
        table(("item", "value"), [("made (UTC)", f"{when:%Y-%m-%d %H:%M:%S}"), *facts], "tt"),
    )
