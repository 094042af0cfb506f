"""EDM baselines: pillar distances, an instrument against them, the tests of ISO 17123-4."""
