"""Weather readings to formula inputs: humidity, pressure, dew."""
