"""Barrell and Sears, resolutions of 1960 and 1963: used in older instruments.

Its form is (n_L - 1) = (n_g - 1)/(1 + a t) p/760 - 5.5e-8 e/(1 + a t), p and e in mm Hg. The resolution's a is
0.003661 = 1/273.15; 1/273.16, also seen, is 6e-6 of the refractivity or less (2e-9 of the index).
"""

from catseye.atmosphere.index import ciddor_hill1999
from catseye.atmosphere.index.ideal_gas import densities, density_slopes, limits
from catseye.atmosphere.index.model import Gases, IndexModel, RefractiveDispersion
from catseye.constants import ZERO_CELSIUS_K

# [BARRELL39] as [RUEGER90] gives the resolution: phase refractivity, ppm, of dry air with 300 ppm of carbon dioxide at
# 0 °C and 760 mm Hg, in 1, s, s²; group 287.604, 4.8864, 0.0680
PHASE_POWERS = (287.604, 1.6288, 0.0136)
STANDARD_HPA = 1013.25  # 760 mm Hg
VAPOUR_PER_MMHG = -5.5e-8  # at 0 °C, at all wavelengths

MODEL = IndexModel(
    name="barrell_sears1963",
    label="Barrell, Sears 1963",
    source="[BARRELL39], [RUEGER90]",
    dispersion=Gases(
        RefractiveDispersion(powers=PHASE_POWERS, scale=1e-6 * ZERO_CELSIUS_K / STANDARD_HPA),
        RefractiveDispersion(powers=(VAPOUR_PER_MMHG * ZERO_CELSIUS_K * 760.0 / STANDARD_HPA,)),
    ),
    densities=densities,
    density_slopes=density_slopes,
    vapour_formula="buck",
    # minimum: 6e-8 rms from [CIDDOR99] over -20 to 45 °C, 600 to 1100 hPa, 0 to 100 %, all our lasers, and that
    # one's 5e-8; up to 3.2e-7 there, 4.3e-7 at 0.633 um and 50 °C, 1.8e-6 at 0.36 um: compared in each weather
    standard_uncertainty=1e-7,
    standard=ciddor_hill1999.MODEL,
    limits=limits("[RUEGER90]"),
    co2_ppm=300.0,
)
