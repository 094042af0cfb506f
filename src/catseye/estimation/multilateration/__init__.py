"""Ranging networks solved by block elimination: the input, the solver, the answer."""

from catseye.estimation.multilateration.gauss_newton import adjust_ranges
from catseye.estimation.multilateration.network import RangingNetwork
from catseye.estimation.multilateration.solution import RangingSolution
from catseye.estimation.multilateration.terms import PointPriors, StationRanges

__all__ = ["PointPriors", "RangingNetwork", "RangingSolution", "StationRanges", "adjust_ranges"]
