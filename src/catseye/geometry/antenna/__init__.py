"""Telescope geometry: frames, paraboloid, subreflector, alidade, panels."""
