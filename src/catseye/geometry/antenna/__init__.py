"""The telescope: frames, paraboloid, subreflector, alidade, panels."""
