"""EDM baselines: pillar distances, instrument calibration, ISO 17123-4 tests."""
