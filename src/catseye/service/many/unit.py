"""Unit of work, its report from the process that did it, and its outcome."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

MEMORY = 300 * 2**20  # bytes that a unit may take, unless it says more


@dataclass(frozen=True)
class Unit:
    """One night, one run or one chunk of a Monte Carlo.

    name        unlike any other unit's; a file's name
    work        function of a module, called with the arguments; it answers with a small dict of JSON's types and
                writes its files whole, into a place of its own
    arguments   that can be pickled
    key         text that identifies options and version, such as a SHA-256
    memory      bytes that it may take
    inputs      files and folders that it reads; their content is part of its identity, beside the key
    output      folder that it writes; None: none. Unfinished output (`.catseye-*`) beside it is removed when no unit
                runs
    """

    name: str
    work: Callable[..., dict[str, Any]]
    arguments: tuple[Any, ...] = ()
    key: str = ""
    memory: int = MEMORY
    inputs: tuple[Path, ...] = ()
    output: Path | None = None


@dataclass(frozen=True)
class UnitOutcome:
    """Result of one unit.

    state     "done" now, "resumed" from an earlier run, or "failed"
    why       of a failure, one line; "" else
    value     answer of the unit's work; None of a failed one
    seconds   that the work took; of a resumed unit in the earlier run
    """

    name: str
    state: Literal["done", "resumed", "failed"]
    why: str
    value: dict[str, Any] | None
    seconds: float


class UnitReport(NamedTuple):
    """Answer of the process that did a unit.

    state   "done"; "failed" by its own fault; "stopped" by a fault that all units share, such as a full disk
    """

    state: Literal["done", "failed", "stopped"]
    why: str
    value: dict[str, Any] | None
    seconds: float


class Death(NamedTuple):
    """End of a process in the middle of a unit.

    why   one line without a name: "killed by SIGKILL"
    """

    why: str
