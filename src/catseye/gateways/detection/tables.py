"""Tables of detection: methods and harmonics of a buffer, lengths from several frequencies."""

from collections.abc import Sequence

from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.detection.buffer_phase import Harmonic, MethodPhase
from catseye.reduction.detection.cycle_lengths import ShotLength

PAGE = "buffer.md"
EXACT = ".10g"

METHODS = Table[Sequence[MethodPhase]](
    "methods.csv",
    PAGE,
    (
        Column("method", "", "synchronous detection, zero crossings or spectrum", each(lambda m: m.name)),
        Column("phase_rad", "rad", "phase at the first sample", each(lambda m: m.phase), EXACT),
        Column("u_phase_rad", "rad", "its standard uncertainty", each(lambda m: m.u_phase), EXACT),
        Column("amplitude_v", "V", "amplitude; empty where the method gives none", each(lambda m: m.amplitude), EXACT),
        Column("u_amplitude_v", "V", "its standard uncertainty", each(lambda m: m.u_amplitude), EXACT),
        Column(
            "difference_rad",
            "rad",
            "phase less that of synchronous detection",
            each(lambda m: m.difference),
            EXACT,
        ),
        Column(
            "expected_difference_rad",
            "rad",
            "part of it that the harmonics explain",
            each(lambda m: m.expected_difference),
            EXACT,
        ),
        Column(
            "u_difference_rad",
            "rad",
            "standard uncertainty of what they leave; the methods share their noise",
            each(lambda m: m.u_difference),
            EXACT,
        ),
    ),
)

HARMONICS = Table[Sequence[Harmonic]](
    "harmonics.csv",
    PAGE,
    (
        Column("order", "", "order of the harmonic", each(lambda h: h.order)),
        Column("amplitude_v", "V", "amplitude B", each(lambda h: h.amplitude), EXACT),
        Column("phase_rad", "rad", "phase ψ of B cos(2π k j/n − ψ)", each(lambda h: h.phase), EXACT),
        Column("relative", "", "amplitude over that of the fundamental", each(lambda h: h.relative), EXACT),
        Column("u_relative", "", "its standard uncertainty", each(lambda h: h.u_relative), EXACT),
        Column(
            "effect_rad",
            "rad",
            "largest error of the phase by synchronous detection: 0 unless it folds",
            each(lambda h: h.effect),
            EXACT,
        ),
        Column(
            "crossing_rad",
            "rad",
            "shift of a phase by zero crossings that it makes alone",
            each(lambda h: h.crossing),
            EXACT,
        ),
    ),
)

LENGTHS = Table[Sequence[ShotLength]](
    "lengths.csv",
    "cycles.md",
    (
        Column("shot", "", "name of the shot", each(lambda s: s.shot)),
        Column("length_m", "m", "length in air; empty where unknown", each(lambda s: s.length), ".7f"),
        Column(
            "u_length_m",
            "m",
            "its standard uncertainty by the phases, if the cycles are right",
            each(lambda s: s.u_length),
            EXACT,
        ),
        Column("cycles", "", "whole cycles, the lowest frequency first", each(lambda s: " ".join(map(str, s.cycles)))),
        Column(
            "misfit",
            "",
            "chi-square of the phases, one less than their number expected",
            each(lambda s: s.misfit),
            ".4f",
        ),
        Column("next_length_m", "m", "length that fits second best", each(lambda s: s.next_length), ".7f"),
        Column(
            "discrimination",
            "",
            "chi-square of that length less that of the best",
            each(lambda s: s.discrimination),
            ".4f",
        ),
        Column("slip_probability", "", "probability of wrong cycles", each(lambda s: s.slip_probability), ".3e"),
        Column("cascade_m", "m", "length by steps from the longest beat", each(lambda s: s.cascade_length), ".7f"),
        Column("margin_m", "m", "least margin of these steps", each(lambda s: s.cascade_margin), ".7f"),
        Column("thin", "", "`thin` where one of them is not sure", each(lambda s: "thin" if s.cascade_thin else "")),
        Column(
            "status",
            "",
            "`found`, `ambiguous`: another length fits nearly as well, `misfit`: none fits, or `unknown`",
            each(lambda s: s.status),
        ),
    ),
)
