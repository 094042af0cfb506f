"""The index of air: models, kernels, wavelength."""
