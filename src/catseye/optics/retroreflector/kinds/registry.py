"""Registry of the kinds of retroreflector, a file each, in the order of `catseye.names`."""

from collections.abc import Mapping
from importlib import import_module

from catseye.errors import InputError
from catseye.names import RETROREFLECTORS, RetroreflectorName
from catseye.optics.retroreflector.kinds.kind import RetroreflectorKind


def _kind(name: RetroreflectorName) -> RetroreflectorKind:
    kind: RetroreflectorKind = import_module(f"catseye.optics.retroreflector.kinds.{name}").KIND
    assert kind.name == name, f"kinds/{name}.py defines {kind.name!r}"
    return kind


KINDS: Mapping[RetroreflectorName, RetroreflectorKind] = {name: _kind(name) for name in RETROREFLECTORS}
PRISM, HOLLOW, BALL = KINDS["prism"], KINDS["hollow"], KINDS["ball"]


def kind_named(name: str) -> RetroreflectorKind:
    """Kind of a name. Raises InputError for an unknown one.

    >>> kind_named("ball").label
    'ball'
    """
    for kind in KINDS.values():
        if kind.name == name:
            return kind
    raise InputError(f"retroreflector {name!r} is unknown (expected one of {', '.join(KINDS)})")
