"""Ranging networks solved by block elimination: the input, the solver, the answer."""

from catseye.estimation.network.multilateration.gauss_newton import adjust_ranges
from catseye.estimation.network.multilateration.network import RangingNetwork
from catseye.estimation.network.multilateration.solution import RangingSolution
from catseye.estimation.network.multilateration.terms import PointPriors, StationRanges

__all__ = ["PointPriors", "RangingNetwork", "RangingSolution", "StationRanges", "adjust_ranges"]
