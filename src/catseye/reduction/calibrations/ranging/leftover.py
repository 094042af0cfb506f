"""Residual leakage after its subtraction, as an effect on phases."""

import numpy as np

from catseye.records.files.readings import SheetReadings
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.fit import Effect
from catseye.signal.systematics.leakage import phase_by_leakage

NAMES = ("leakage left over, real part", "leakage left over, imaginary part")


def leakage_effects(readings: SheetReadings, u_leakage_volt: float) -> list[Effect]:
    """Effects of residual leakage on the target's phase.

    Minus that on the reference where there is one.

    readings         columns phase_target_rad and amplitude_target_volt; phase_reference_rad needs
                     amplitude_reference_volt: one leakage acts on both
    u_leakage_volt   V, of each quadrature

    Two effects with columns in rad/V. Left over is the opposite of taken out, so the sign of `phase_by_leakage` turns.
    """
    pairs = [("amplitude_target_volt", "phase_target_rad")]
    if "phase_reference_rad" in readings.numbers:
        pairs.append(("amplitude_reference_volt", "phase_reference_rad"))
    phasors = []
    for amplitude, phase in pairs:
        if amplitude not in readings.numbers:
            raise refusal(
                readings.file,
                f"line 1, column {amplitude!r} is missing (needed as {readings.sheet_file} states u_leakage_volt)",
            )
        phasors.append(readings.get(amplitude) * np.exp(1j * readings.get(phase)))
    slopes = -phase_by_leakage(*phasors)
    return [Effect(name, column, u_leakage_volt, "V") for name, column in zip(NAMES, slopes.T, strict=True)]
