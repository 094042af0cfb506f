"""Certificate of an EDM baseline, and of the instrument that measured it."""

from collections.abc import Mapping

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.baseline.figures import baseline_figures
from catseye.gateways.calibrations.calibration_certificate import tests_grid
from catseye.gateways.certificates.document import CellTable, Chapter, Paragraph, SvgPicture
from catseye.gateways.certificates.statement import CertifiedSubject
from catseye.gateways.writers.drawing import svgs
from catseye.reduction.baseline.certified import baseline_quantities
from catseye.reduction.baseline.result import BaselineCalibration

METHOD = (
    "Distances between the pillars of a line are measured in sets; their first velocity correction by the weather at "
    "each shot, their heights and the noise of shots, sets and air are adjusted together with the places of the "
    "pillars and the errors of the instrument. The tests are those of ISO 17123-4 and of the adjustment."
)
SIGN = "observed = (1 + scale) distance + zero + cyclic; the correction of a reading has the opposite sign"
CAPTIONS = {
    "line": "Pillars along the line from the first to the last, and their offsets from it",
    "residuals": "Residuals of all shots, by set-up",
    "weather": "Residuals of the longer lines over the change of the corrected length by weather",
    "corrections": "Corrections added to the displayed lengths",
    "cyclic": "Cyclic terms over the unit length, with residuals",
}
WEATHER = ("temperature_c", "pressure_hpa", "humidity_percent")


def baseline_subject(
    calibration: BaselineCalibration, hashes: Mapping[str, str], provenance: Mapping[str, object]
) -> CertifiedSubject:
    """Baseline as a certificate shows it.

    hashes       SHA-256 of each file read, by its name
    provenance   serial, measured_on, by, report; None: not stated
    """
    shots, used = calibration.observations, calibration.keep
    weather = {name: getattr(shots, name)[used] for name in WEATHER}
    against = calibration.against is not None
    drawn = svgs(baseline_figures(calibration))
    return CertifiedSubject(
        title=f"EDM baseline of {len(calibration.names)} pillars, and the instrument that measured it",
        identity={**provenance, "instrument": "EDM instrument"},
        verdict=calibration.verdict,
        quantities=baseline_quantities(calibration),
        method=METHOD + (" The scale is that of known pillars." if against else ""),
        conventions=(("zero, scale, cyclic", SIGN),),
        covariance=None,
        conditions={name: (float(np.min(values)), float(np.max(values))) for name, values in weather.items()},
        chapters=(
            Chapter("distances", "Distances of all pairs of pillars", (_distances(calibration),)),
            Chapter(
                "tests",
                "Tests",
                (tests_grid(calibration.decisions), *(Paragraph(f"Note: {note}.") for note in calibration.notes)),
            ),
            Chapter(
                "figures",
                "Line, residuals and weather",
                tuple(SvgPicture(drawn[name], text) for name, text in CAPTIONS.items() if name in drawn),
            ),
            Chapter("shots", f"{len(used)} shots", (_shots(calibration),)),
        ),
        hashes=hashes,
        settings=vars(calibration.settings),
    )


def _distances(calibration: BaselineCalibration) -> CellTable:
    rows = tuple((s.start, s.end, f"{s.distance:.5f}", f"{s.u / MILLIMETRE:.3f}") for s in calibration.spans)
    return CellTable(("from", "to", "distance (m)", "u (mm)"), "ttnn", rows)


def _shots(calibration: BaselineCalibration) -> CellTable:
    shots, residual = calibration.observations, calibration.shot_residuals / MILLIMETRE
    rows = tuple(
        (
            calibration.names[shots.start[k]],
            calibration.names[shots.end[k]],
            f"{shots.slope[k]:.5f}",
            f"{shots.temperature_c[k]:.1f}",
            f"{shots.pressure_hpa[k]:.1f}",
            f"{shots.humidity_percent[k]:.0f}",
            f"{residual[k]:+.3f}" if np.isfinite(residual[k]) else "–",
            why or "used",
        )
        for k, why in enumerate(calibration.rejected)
    )
    heads = ("from", "to", "displayed (m)", "°C", "hPa", "%", "residual (mm)", "state")
    return CellTable(heads, "ttnnnnnt", rows)
