"""Tables of phasors: real and imaginary part, or amplitude and phase."""

import numpy as np

from catseye.constants import TWO_PI
from catseye.records.files.readings import SheetReadings
from catseye.records.files.record import Within
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Quantity, RecordValue
from catseye.reduction.calibrations.fit import CalibrationFit
from catseye.reduction.calibrations.kind import quantities
from catseye.signal.cycles.whole import fraction
from catseye.signal.systematics.leakage import polar_covariance

VOLT, PART = Within(0, 20), Within(-20, 20)
CARTESIAN, POLAR = ("real_volt", "imaginary_volt"), ("amplitude_volt", "phase_rad")
COLUMNS = {
    "real_volt": PART,
    "imaginary_volt": PART,
    "amplitude_volt": VOLT,
    "phase_rad": Within(-2 * TWO_PI, 2 * TWO_PI),
    "u_volt": Within(0, 1, above=True),
}
MILLIVOLT = 1e-3  # V


def phasors(readings: SheetReadings) -> np.ndarray:
    """Phasors (m,) V, complex.

    InputError unless exactly one pair of columns exists.
    """
    pairs = [pair for pair in (CARTESIAN, POLAR) if all(name in readings.numbers for name in pair)]
    present = [name for name in (*CARTESIAN, *POLAR) if name in readings.numbers]
    if len(pairs) != 1 or len(present) != 2:
        raise refusal(
            readings.file,
            f"line 1, {', '.join(present) or 'no column of a phasor'} (expected {','.join(CARTESIAN)} or "
            f"{','.join(POLAR)})",
        )
    first, second = (readings.get(name) for name in pairs[0])
    return first + 1j * second if pairs[0] == CARTESIAN else first * np.exp(1j * second)


def polar_quantities(
    phasor: complex, covariance: np.ndarray, fit: CalibrationFit
) -> tuple[tuple[Quantity, ...], np.ndarray]:
    """Amplitude and phase of a leakage with covariance.

    From its real and imaginary part.
    """
    polar = polar_covariance(phasor, covariance)
    keys = [
        ("leakage_amplitude_volt", "V", "of the phasor that leaks into every shot"),
        ("leakage_phase_rad", "rad", "of it, in the phase frame of the converter"),
    ]
    values = np.array([abs(phasor), float(fraction(np.angle(phasor), 0.0))])
    turn = np.zeros((2, len(fit.x)))
    along = phasor / abs(phasor)
    turn[:, :2] = [[along.real, along.imag], [-along.imag / abs(phasor), along.real / abs(phasor)]]
    return quantities(keys, values, polar, fit=fit, turn=turn), polar


def leakage_record(leakage: tuple[Quantity, ...], u_volt: float) -> dict[str, RecordValue]:
    """Entries for the ranger's record: one u for each quadrature."""
    return {
        "leakage_amplitude_volt": leakage[0].value,
        "leakage_phase_rad": leakage[1].value,
        "u_leakage_volt": u_volt,
    }
