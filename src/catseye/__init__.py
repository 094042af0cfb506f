"""Catseye: laser metrology for large telescopes and structures, from raw samples to coordinates with uncertainty."""

__version__ = "0.1.0"
