"""Vibration: spectra, modes, and a filter that predicts."""
