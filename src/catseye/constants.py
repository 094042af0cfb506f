"""Constants of nature and of convention, each with its unit and source."""

import math

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact (SI)
ZERO_CELSIUS_K = 273.15  # K at 0 °C, exact
SECONDS_PER_DAY = 86_400.0

TWO_PI = 2.0 * math.pi
DEGREE = math.pi / 180.0  # rad
ARCSECOND = DEGREE / 3600.0  # rad
MILLIMETRE = 1e-3  # m
PPM = 1e-6
