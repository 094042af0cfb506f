"""Phase detection: synchronous detection, spectra, zero crossings, compiled kernels."""
