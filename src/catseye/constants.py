"""Constants of nature and of convention, with units and sources."""

import math

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact (SI)
ZERO_CELSIUS_K = 273.15  # K at 0 °C, exact
SECONDS_PER_DAY = 86_400.0

TWO_PI = 2.0 * math.pi
DEGREE = math.pi / 180.0  # rad
ARCSECOND = DEGREE / 3600.0  # rad
MILLIMETRE = 1e-3  # m
MILLIRADIAN = 1e-3  # rad
PPM = 1e-6
DRY_AIR_KG_PER_MOL = 28.9641e-3  # [CIDDOR96] appendix A, at 450 ppm of carbon dioxide
WATER_OVER_AIR = 0.62198  # ratio of molar masses, [CIDDOR96] appendix A
GAS_CONSTANT = 8.314_462_618  # J/(mol K), exact in the SI to these digits
STANDARD_GRAVITY = 9.806_65  # m/s², conventional
