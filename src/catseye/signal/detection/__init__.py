"""Samples to phase: synchronous detection, spectra, zero crossings, kernels."""
