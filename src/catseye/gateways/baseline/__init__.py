"""Output of an EDM baseline calibration."""
