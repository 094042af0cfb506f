"""Registry of the parameters that a client can set while the site is measured.

A parameter is one row here; its present value and its activation are in `bindings`, checks between parameters in
`interlocks`. The table in docs/formats/ziy.md is checked against it.
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from catseye.coordinator.modes import Mode
from catseye.errors import InputError
from catseye.names import AIR_MODELS

Changes = Literal["coordinator", "plan", "shots", "answers", "safety", "output"]
LONGEST_VALUE = 280  # characters: a reply's value has 300 at most
FILTERS = ("random_walk", "constant_velocity")


@dataclass(frozen=True)
class ParameterRow:
    """A parameter that can be set.

    name        of the parameter
    unit        of its value; "" for none
    meaning     one line
    changes     affected part: what changes answers is journalled as an event of the reduction, and replayed
    low, high   limits of a number; NaN for another kind of value
    whole       True for an integer
    words       legal words, for a parameter of a few words
    form        legal values in words, for a parameter of free text
    """

    name: str
    unit: str
    meaning: str
    changes: Changes
    low: float = math.nan
    high: float = math.nan
    whole: bool = False
    words: tuple[str, ...] = ()
    form: str = ""

    @property
    def legal(self) -> str:
        """Legal values, in words.

        >>> ROWS["round_s"].legal, ROWS["corrections"].legal
        ('2 to 600', 'off on')
        """
        if self.words:
            return " ".join(self.words)
        return self.form or f"{self.low:g} to {self.high:g}{', an integer' if self.whole else ''}"

    def normalised(self, text: str) -> str:
        """A value's text in its usual form.

        Raises InputError: not legal.

        >>> ROWS["round_s"].normalised("20.0"), ROWS["corrections"].normalised("ON")
        ('20', 'on')
        """
        if len(text) > LONGEST_VALUE:
            raise InputError(f"{self.name}: {len(text)} characters (limit {LONGEST_VALUE})")
        if self.words:
            if text.lower() not in self.words:
                raise InputError(f"{self.name} {text[:20]!a} (expected {' or '.join(self.words)})")
            return text.lower()
        if math.isnan(self.low):
            return " ".join(text.split())
        try:
            value = float(text)
        except ValueError:
            raise InputError(f"{self.name} {text[:20]!a} is not a number (expected {self.legal}{self._of})") from None
        if not self.low <= value <= self.high or (self.whole and value != int(value)):
            raise InputError(f"{self.name} {value:g} is not legal (expected {self.legal}{self._of})")
        return number_text(value)

    @property
    def _of(self) -> str:
        return f" {self.unit}" if self.unit else ""


def number_text(value: float) -> str:
    """Shortest text of a number that reads back the same, integers without a point."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


def _row(name: str, unit: str, low: float, high: float, changes: Changes, meaning: str) -> ParameterRow:
    return ParameterRow(name=name, unit=unit, meaning=meaning, changes=changes, low=low, high=high)


def _whole(name: str, unit: str, low: float, high: float, meaning: str) -> ParameterRow:
    return ParameterRow(name=name, unit=unit, meaning=meaning, changes="shots", low=low, high=high, whole=True)


def _words(name: str, words: tuple[str, ...], changes: Changes, meaning: str) -> ParameterRow:
    return ParameterRow(name=name, unit="", meaning=meaning, changes=changes, words=words)


def _text(name: str, unit: str, form: str, changes: Changes, meaning: str) -> ParameterRow:
    return ParameterRow(name=name, unit=unit, meaning=meaning, changes=changes, form=form)


ROWS = {
    row.name: row
    for row in (
        _words("mode", get_args(Mode), "coordinator", "mode of the coordinator"),
        _text("dropped", "", "rangers with blanks between, or none", "coordinator", "rangers left out on purpose"),
        _row("round_s", "s", 2.0, 600.0, "plan", "length of a round"),
        _row("rate_hz", "Hz", 0.02, 20.0, "plan", "most planned shots a second of each ranger"),
        _row("reference_every_s", "s", 5.0, 3600.0, "plan", "longest time between two shots of a ranger on ZRG"),
        _row("benchmark_every_s", "s", 5.0, 86400.0, "plan", "longest time between two shots on a benchmark"),
        _row("dish_share", "", 0.0, 1.0, "plan", "share of a feed-arm ranger's round for the dish"),
        _text(
            "scan_list",
            "",
            "names or patterns such as ZEG* with blanks between, or all",
            "plan",
            "targets that are measured, besides ZRG and benchmarks",
        ),
        _text(
            "priorities",
            "",
            "name=factor or pattern=factor, 0.001 to 1000, with blanks between, or none",
            "plan",
            "factors of the worth of a target's shots; the last that fits counts",
        ),
        _whole("cycles", "", 1, 65_536, "cycles of a buffer (CYC)"),
        _whole("samples_per_cycle", "", 3, 65_536, "samples of a cycle (SFQ)"),
        _whole("if_hz", "Hz", 1, 10_000, "intermediate frequency (IFF)"),
        _words("filter", FILTERS, "answers", "motion model between epochs"),
        _words("air_model", AIR_MODELS, "answers", "model of the index of air"),
        _row("rejection_w", "", 2.0, 20.0, "answers", "test statistic above which a shot is rejected"),
        _row("smallest_return", "", 1.0, 1000.0, "answers", "amplitude over its u below which a shot is blocked"),
        _text(
            "target_positions",
            "mm",
            "name x y z in the frame of its record, with ; between targets, or none",
            "answers",
            "approximate positions that replace the record's; a target named here begins anew",
        ),
        _row("sun_cone_deg", "deg", 0.5, 60.0, "safety", "half angle of the Sun's cone, never less than the record's"),
        _text(
            "keep_out_more",
            "m",
            "name x1 y1 z1 x2 y2 z2 in the ground frame, with ; between boxes, or none",
            "safety",
            "boxes that no beam enters, besides those of the record",
        ),
        _words("corrections", ("off", "on"), "output", "corrections are given to the telescope"),
    )
}
