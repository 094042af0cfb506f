"""Figures from lengths alone: stations and targets both unknown."""

from catseye.estimation.network.unfolding.factors import classical_scaling
from catseye.estimation.network.unfolding.location import locate
from catseye.estimation.network.unfolding.unfold import NO_FIT, TOO_FEW, UNFOLDED, Unfolding, unfold

__all__ = ["NO_FIT", "TOO_FEW", "UNFOLDED", "Unfolding", "classical_scaling", "locate", "unfold"]
