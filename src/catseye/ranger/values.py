"""Parameters of ZY commands: kinds, limits, parsing."""

import math
import re
from dataclasses import dataclass
from typing import Literal

from catseye.errors import InputError
from catseye.ranger.line import parse_stamp

INTEGER = re.compile(r"[+-]?[0-9]{1,12}")
REAL = re.compile(r"[+-]?([0-9]{1,15}(\.[0-9]{0,15})?|\.[0-9]{1,15})([eE][+-]?[0-9]{1,3})?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")
Value = int | float | str
Kind = Literal["whole", "real", "cube", "name", "stamp", "text"]


@dataclass(frozen=True)
class CommandParameter:
    """One parameter of a command.

    name      in messages and help, its unit in it
    kind      whole, real, cube (a number or a name), name, stamp (ticks of an MJD), text
    low, high accepted range, inclusive
    unit      in words, "" for none
    """

    name: str
    kind: Kind = "whole"
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""

    def read(self, command: str, text: str) -> Value:
        """Value of a text.

        command   of the parameter, for messages
        text      as received

        Raises InputError: not of this kind, or outside its limits.

        >>> CommandParameter("axis", low=0, high=1).read("STT", "1")
        1
        """
        if self.kind == "cube":
            return int(text) if text.isdecimal() and INTEGER.fullmatch(text) else self._word(command, text)
        if self.kind == "name":
            return self._word(command, text)
        if self.kind == "text":
            return text
        if self.kind == "stamp":
            try:
                return parse_stamp(text)
            except InputError as problem:
                raise InputError(f"{command}: {problem}") from problem
        form, what = (INTEGER, "a whole number") if self.kind == "whole" else (REAL, "a number")
        if not form.fullmatch(text):
            raise InputError(f"{command}: {self.name} {_quoted(text)} is not {what}{self._expected()}")
        value: int | float = int(text) if self.kind == "whole" else float(text)
        if not self.low <= value <= self.high:
            raise InputError(f"{command}: {self.name} {text} is outside{self._limits()}")
        return value

    def _word(self, command: str, text: str) -> str:
        if not NAME.fullmatch(text):
            raise InputError(
                f"{command}: {self.name} {_quoted(text)} is not a name (expected a letter, then at most 15 letters, "
                "digits, - or _)"
            )
        return text

    def _limits(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f" {self.low:.12g} to {self.high:.12g}{unit}"

    def _expected(self) -> str:
        return f" (expected{self._limits()})" if math.isfinite(self.high) else ""


def _quoted(text: str) -> str:
    return ascii(text if len(text) <= 40 else f"{text[:40]}...")
