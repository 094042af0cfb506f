"""Oscillator test: noise kinds, spurs, and averaging.

From phases of the internal cube at equal intervals.

The readings are the phases of single cycles (SEQ) or of buffers of the reference cube, one after the other.
"""

from typing import Annotated

import numpy as np

from catseye.constants import MILLIRADIAN, TWO_PI
from catseye.records.files.readings import Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Within
from catseye.reduction.calibrations.budget import SharedInput
from catseye.reduction.calibrations.calibration import Calibration, Quantity
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.kind import CalibrationKind, Plausibility, PlausibleSpan, provenance, quantities
from catseye.signal.drift.allan import allan_deviation, expected_variance
from catseye.signal.drift.noise import FEWEST, NoiseSpectrum, noise_spectrum

KIND = "oscillator"
LISTED_SPURS = 5  # spurs listed
MRAD2 = 1e6  # mrad^2 in a rad^2


class OscillatorSheet(Sheet):
    """Sheet of an oscillator test.

    interval_s        time between readings: 0.001 for single cycles at an IF of 1 kHz
    half_wavelength_mm   half wavelength of the modulation, turns phases into ranges
    cycles_per_range  readings that one range averages
    false_alarm       probability of calling noise a spur, over the whole spectrum
    """

    interval_s: Annotated[float, Within(1e-6, 1e5)]
    half_wavelength_mm: Annotated[float, Within(1, 1e6)] = 99.93
    cycles_per_range: Annotated[int, Within(1, 65_536)] = 128
    false_alarm: Annotated[float, Within(0, 0.5, above=True)] = 0.001


LAYOUT = SheetLayout(KIND, OscillatorSheet, required={"phase_rad": Within(-1e6, 1e6)})


def measure_oscillator(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Phase noise by kind, spurs, and the noise of one range.

    White, flicker and random-walk noise.

    readings   column phase_rad at equal intervals; sheet OscillatorSheet
    reject     has no effect: a series with holes has no spectrum

    Raises InputError where readings are left out or are too few.

    Source: [PARKER04] chapter 8, "oscillator phase noise vs cycles"; [WHITTLE53], [RILEY08].
    """
    sheet, m = readings.sheet, len(readings)
    for row, reason in enumerate(readings.left_out):
        if reason:
            raise readings.refuse(row, "is left out, but readings at equal intervals cannot spare one (cut the series)")
    if m < FEWEST:
        raise readings.refuse(m - 1, f"is the last of {m} readings (expected at least {FEWEST})")
    phase = np.unwrap(readings.get("phase_rad"))
    spectrum = noise_spectrum(phase, sheet.interval_s, false_alarm=sheet.false_alarm)
    allan = allan_deviation(phase)
    quantity, covariance = _quantities(spectrum, sheet)
    interval = allan.interval()
    rows = tuple(
        (int(size), float(size * sheet.interval_s), float(d), float(low), float(high), kind,
         float(d * sheet.half_wavelength_mm * 1e3 / TWO_PI))
        for size, d, (low, high), kind in zip(allan.size, allan.deviation, interval, allan.kind, strict=True)
    )  # fmt: skip
    time = allan.size * sheet.interval_s
    fitted = np.sqrt(expected_variance(allan.size, white=spectrum.white, flicker=spectrum.flicker, walk=spectrum.walk))
    positive, line = allan.deviation > 0.0, fitted > 0.0  # what has a logarithm
    return Calibration(
        kind=KIND,
        title=f"Oscillator test of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=quantity,
        covariance=covariance,
        columns=("averaged", "averaged_s", "allan_deviation_rad", "low_95_rad", "high_95_rad", "kind", "range_um"),
        rows=rows,
        decisions=(
            CheckOutcome(
                "spurs: lines in the spectrum",
                float(len(spectrum.spurs)),
                0.0,
                not spectrum.spurs,
                "no line stands out of the noise" if not spectrum.spurs else _lines(spectrum),
            ),
        ),
        degrees_of_freedom=m - 1,
        notes=(
            *(
                f"spur at {s.frequency_hz:.4g} Hz (u {s.u_frequency_hz:.2g}): amplitude {s.amplitude:.3g} rad "
                f"(u {s.u_amplitude:.2g}), false alarm {s.false_alarm:.1g}"
                for s in spectrum.spurs[:LISTED_SPURS]
            ),
            "spurs above half the sampling rate show folded below it",
            f"a drift of {spectrum.drift:+.3g} rad/s was taken out before the spectrum; the Allan deviation has it",
        ),
        curve={
            "readings": (np.log10(time[positive]), np.log10(allan.deviation[positive])),
            "fit": (np.log10(time[line]), np.log10(fitted[line])),
            "averages": (allan.size, allan.deviation / MILLIRADIAN),
        },
        axes=("averaging time (log10 of s)", "Allan deviation (log10 of rad)"),
        method="The spectrum of the unwrapped phases, a straight line taken out, is fitted with white, flicker and "
        "random-walk noise by the likelihood of its ordinates, spurs taken out one by one. Beside it the overlapping "
        "Allan deviation of averages, with 95 % limits; the line in the figure is what the three "
        "noises together make of it; spurs and drift are not in it.",
        record={q.key: q.value for q in quantity},
    )


def _quantities(spectrum: NoiseSpectrum, sheet: OscillatorSheet) -> tuple[tuple[Quantity, ...], np.ndarray]:
    """Coefficients (mrad^2) and the white part of a range's noise.

    With covariance.
    """
    per_range = (sheet.half_wavelength_mm * 1e3 / TWO_PI) / np.sqrt(sheet.cycles_per_range)
    slope = np.zeros((4, 3))
    slope[:3] = MRAD2 * np.eye(3)
    slope[3, 0] = 0.5 * per_range / spectrum.white if spectrum.white > 0.0 else 0.0
    covariance = slope @ spectrum.covariance @ slope.T
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    ordinates = SharedInput(
        "ordinates of the spectrum", u, "", np.ones(len(u)), evaluation="A", distribution="likelihood, to first order"
    )
    values = (*(MRAD2 * spectrum.squares), spectrum.white * per_range)
    keys = (
        ("white_mrad2", "mrad²", "variance of a reading, white"),
        ("flicker_mrad2", "mrad²", "h of the density h/f"),
        ("walk_mrad2", "mrad²", "variance of a step of the walk, reading to reading"),
        ("white_range_um", "µm", f"white noise of a range of {sheet.cycles_per_range} readings"),
    )
    return quantities(keys, np.array(values), np.diag(u**2), inputs=[ordinates]), covariance


def _lines(spectrum: NoiseSpectrum) -> str:
    return "lines at " + ", ".join(f"{s.frequency_hz:.4g} Hz" for s in spectrum.spurs[:LISTED_SPURS])


RECIPE = CalibrationKind(
    "phase noise of the oscillator against averaging, with spurs",
    LAYOUT,
    measure_oscillator,
    plausible=Plausibility(
        sizes={"white_mrad2": PlausibleSpan(0.0, 1e5, "a third of a radian in a cycle: its phase would be lost")},
    ),
)
