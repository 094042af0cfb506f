"""Calibrations from tables of readings; `kinds` names them all."""
