"""Closed formula of the 1999 resolution, for work to 1 ppm.

Public code often calls the set of 1963 by this name: 287.604 is not 287.6155 (0.012 ppm at 0 °C), see
`barrell_sears1963`.
"""

from catseye.atmosphere.index import ciddor_hill1999
from catseye.atmosphere.index.ideal_gas import densities, density_slopes, limits
from catseye.atmosphere.index.model import Gases, IndexModel, RefractiveDispersion
from catseye.constants import ZERO_CELSIUS_K

# [IAG99]: group refractivity, ppm, of dry air with 375 ppm of carbon dioxide at 0 °C and 1013.25 hPa, in 1, s, s²;
# the phase form is the same over 1, 3, 5, printed as 287.6155, 1.62887, 0.01360
GROUP_POWERS = (287.6155, 4.88660, 0.06800)
STANDARD_K_PER_HPA = ZERO_CELSIUS_K / 1013.25
VAPOUR_K_PER_HPA = -11.27e-6  # [IAG99], of the vapour pressure over temperature, at all wavelengths

MODEL = IndexModel(
    name="iag1999_closed",
    label="IAG 1999, closed formula",
    source="[IAG99]",
    dispersion=Gases(
        RefractiveDispersion(
            powers=tuple(c / (2 * i + 1) for i, c in enumerate(GROUP_POWERS)), scale=1e-6 * STANDARD_K_PER_HPA
        ),
        RefractiveDispersion(powers=(VAPOUR_K_PER_HPA,)),
    ),
    densities=densities,
    density_slopes=density_slopes,
    vapour_formula="buck",
    # minimum: 6e-8 rms from [CIDDOR99] over -20 to 45 °C, 600 to 1100 hPa, 0 to 100 %, all our lasers, and that
    # one's 5e-8; up to 3.2e-7 there, 4.3e-7 at 0.633 um and 50 °C, 1.8e-6 at 0.36 um: compared in each weather
    standard_uncertainty=1e-7,
    standard=ciddor_hill1999.MODEL,
    limits=limits("[IAG99]"),
    co2_ppm=375.0,
)
