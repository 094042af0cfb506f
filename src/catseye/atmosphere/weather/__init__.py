"""Humidity, pressure, dew: from what instruments show to what formulas need."""
