"""Trends over an archive: bodies, rangers, thermometers, calibrations, and alarms."""
