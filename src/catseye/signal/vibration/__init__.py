"""Shaking: spectra, modes, a filter that foretells."""
