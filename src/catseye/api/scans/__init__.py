"""Scans and searches: `fit_scan`, `angles_scan`, `search_scan`."""
