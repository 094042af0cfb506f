"""Where an adjustment begins: approximate coordinates and orientations, found for what a network does not give."""

from catseye.estimation.network.approximate.start import Approximation, approximate

__all__ = ["Approximation", "approximate"]
