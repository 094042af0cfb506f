"""Index of air: models, compiled kernels, wavelength."""
