"""Kinds of retroreflector that records name, for the rooms above.

The simulator, which shares no formula with `optics`, takes the kinds from here and asks for facts only.
"""

from catseye.optics.retroreflector.kinds.kind import GlassForm, RetroreflectorKind
from catseye.optics.retroreflector.kinds.registry import BALL, HOLLOW, PRISM, kind_named

__all__ = ["BALL", "HOLLOW", "PRISM", "GlassForm", "RetroreflectorKind", "kind_named"]
