"""Vectors: tables of printed numbers, each naming the public function that gives it."""

from collections.abc import Callable
from importlib import import_module
from typing import Any


def function_of(name: str) -> Callable[..., Any]:
    """The function that a vector names from the package's root: `atmosphere.index.air.air`."""
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"catseye.{module}"), function)
