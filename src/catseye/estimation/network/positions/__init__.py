"""Positions of many targets from ranges to known stations."""

from catseye.estimation.network.positions.dispatch import Positions, positions
from catseye.estimation.network.positions.status import TEXTS, Status

__all__ = ["TEXTS", "Positions", "Status", "positions"]
