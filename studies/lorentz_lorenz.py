"""Do refractivities add in proportion to density, or does the Lorentz-Lorenz sum? And how far are the models apart?

python studies/lorentz_lorenz.py DIRECTORY

Writes lorentz-lorenz.svg into the directory and prints the tables. Ciddor gives both sums for the phase index of moist
air: in proportion to density (his eq. 5), n - 1 = sum r_i (n_i - 1), and by molar refraction, L = sum r_i L_i with
L = (n² - 1)/(n² + 2), where r_i is a gas's density over its standard density. Catseye takes the first. The group form
of the second is derived here: L_i changes with wavenumber by 6 n_i/(n_i² + 2)² dn_i, and n by the same backwards.

What it shows. L = (2/3)(n - 1)(1 - (n - 1)/6 ...): the sums agree at the density for which n_i holds, and in air r
times as dense the second gives more by (r - 1)(n_i - 1)(n - 1)/6: 4e-9 in dense air, -3e-9 in rare. Ciddor's printed
table settles it: the sum in proportion to density gives every digit, the other misses by up to two in the last.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.index import ciddor_hill1999
from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, mpl, svg

WAVELENGTH_UM, CO2_PPM = 0.780, 450.0
HUMIDITIES = (0.0, 50.0, 100.0)
# [CIDDOR96]'s table, phase, 0.633 um, 450 ppm: °C, Pa, % of humidity, 1e8 (n - 1) to a tenth
PRINTED = (
    (20.0, 80_000.0, 0.0, 21458.0),
    (20.0, 100_000.0, 0.0, 26824.4),
    (20.0, 120_000.0, 0.0, 32191.6),
    (10.0, 100_000.0, 0.0, 27774.7),
    (20.0, 80_000.0, 75.0, 21394.0),
    (50.0, 120_000.0, 100.0, 28792.4),
)


class Sums(NamedTuple):
    """Refractivity n - 1 by the two sums.

    proportional   in proportion to density
    lorentz        by Lorentz and Lorenz
    """

    proportional: np.ndarray
    lorentz: np.ndarray


def molar(x):
    """L = (n² - 1)/(n² + 2) of x = n - 1, without loss of digits."""
    return x * (2.0 + x) / (3.0 + x * (2.0 + x))


def unmolar(refraction):
    """x = n - 1 of L: n² = 1 + 3 L/(1 - L)."""
    y = 3.0 * refraction / (1.0 - refraction)
    return y / (1.0 + np.sqrt(1.0 + y))


def molar_slope(x):
    """dL/dn = 6 n/(n² + 2)²."""
    n = 1.0 + x
    return 6.0 * n / (n * n + 2.0) ** 2


def both(t, p, h, *, wavelength_um=WAVELENGTH_UM, co2_ppm=CO2_PPM, group=True) -> Sums:
    """Group or phase refractivity by both sums: °C, hPa, % over liquid water, um, ppm."""
    e = vapour_pressure_hpa(t, p, h, "ciddor")
    density, standard = ciddor_hill1999.densities(t, p, e), _standard_densities()
    ratios = [d / s for d, s in zip(density, standard, strict=True)]
    phase = [s * c for s, c in zip(standard, _coefficients(wavelength_um, co2_ppm, "phase"), strict=True)]
    per_group = [s * c for s, c in zip(standard, _coefficients(wavelength_um, co2_ppm, "group"), strict=True)]
    wanted = per_group if group else phase
    proportional = sum(r * x for r, x in zip(ratios, wanted, strict=True))
    n = unmolar(sum(r * molar(x) for r, x in zip(ratios, phase, strict=True)))
    if not group:
        return Sums(proportional, n)
    # sigma dn_i/dsigma is the gas's group less its phase refractivity
    turned = sum(r * molar_slope(x) * (g - x) for r, x, g in zip(ratios, phase, per_group, strict=True))
    return Sums(proportional, n + turned / molar_slope(n))


def _coefficients(wavelength_um, co2_ppm, kind):
    return ciddor_hill1999.MODEL.coefficients(wavelength_um, co2_ppm, kind)


def _standard_densities():
    """Of each gas where its standard refractivity holds: pure, as `ciddor_hill1999.densities` counts it."""
    dry_t, dry_pa, _ = ciddor_hill1999.STANDARD_DRY
    vapour_t, vapour_pa, _ = ciddor_hill1999.STANDARD_VAPOUR
    dry = ciddor_hill1999.densities(dry_t, dry_pa / 100.0, 0.0).dry
    return dry, ciddor_hill1999.densities(vapour_t, vapour_pa / 100.0, vapour_pa / 100.0).vapour


def printed_residuals() -> Sums:
    """Computed less printed, 1e8 (n - 1), at every printed value."""
    t, pa, h, printed = np.array(PRINTED).T
    found = both(t, pa / 100.0, h, wavelength_um=0.633, group=False)
    return Sums(*(1e8 * values - printed for values in found))


def grid(steps: int = 27) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The ground's weather: -20 to 45 °C, 600 to 1100 hPa, 0 to 100 %."""
    axes = (np.linspace(-20.0, 45.0, steps), np.linspace(600.0, 1100.0, steps), np.linspace(0.0, 100.0, steps))
    t, p, h = np.meshgrid(*axes, indexing="ij")
    return t, p, h


def largest() -> dict[str, tuple[float, tuple[float, ...]]]:
    """Largest departure of the Lorentz-Lorenz sum over the ground's weather, and its place, for phase and group."""
    found = {}
    for kind in ("phase", "group"):
        sums = both(*grid(), group=kind == "group")
        difference = sums.lorentz - sums.proportional
        at = np.unravel_index(np.argmax(np.abs(difference)), difference.shape)
        found[kind] = (float(difference[at]), tuple(float(axis[at]) for axis in grid()))
    return found


def models_apart() -> dict[str, dict[str, float]]:
    """Each model less the default over the ground's weather, ppm of the group index at 0.780 um."""
    weather = grid()
    default = group_refractivity(*weather)
    found = {}
    for name in MODELS:
        if name != "ciddor_hill1999":
            d = 1e6 * (group_refractivity(*weather, model=name) - default)
            found[name] = {"least": d.min(), "greatest": d.max(), "mean": d.mean(), "rms": np.sqrt(np.mean(d**2))}
    return found


def report() -> str:
    lines = ["Ciddor's table, computed less printed in 1e-8: C, hPa, %, in proportion to density, Lorentz-Lorenz"]
    residuals = printed_residuals()
    for row, plain, lorentz in zip(PRINTED, *residuals, strict=True):
        lines.append(f"  {row[0]:5.0f} {row[1] / 100:6.0f} {row[2]:5.0f}   {plain:+.3f}   {lorentz:+.3f}")
    for kind, (value, (t, p, h)) in largest().items():
        lines.append(f"Lorentz-Lorenz less proportional, {kind}, largest: {value:+.2e} at {t:g} C, {p:g} hPa, {h:g} %")
    lines.append("model less ciddor_hill1999 over -20 to 45 C, 600 to 1100 hPa, 0 to 100 %, ppm")
    for name, found in models_apart().items():
        lines.append(f"  {name:20s}" + "".join(f"  {key} {value:+.3f}" for key, value in found.items()))
    return "\n".join(lines)


def figure() -> str:
    """Differences of the models above, of the two sums below, as SVG text."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(9.4, 6.8), layout="constrained")
        axes = drawn.subplots(2, 3)
        others = [name for name in MODELS if name != "ciddor_hill1999"]
        for ax, name in zip(axes[0], others, strict=False):
            _draw_model(ax, name)
            ax.set_ylim(-0.55, 0.18)
        axes[0, 0].set_ylabel("less ciddor_hill1999 (ppm)")
        _draw_sums(axes[1, 0], axes[1, 1])
        _draw_printed(axes[1, 2])
        drawn.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
        return svg(drawn)


def _draw_model(ax, name: str) -> None:
    """A line for each humidity at 850 hPa; the band is all pressures."""
    t = np.linspace(-20.0, 45.0, 131)
    for humidity, colour in zip(HUMIDITIES, SERIES, strict=False):
        spread = [
            1e6 * (group_refractivity(t, p, humidity, model=name) - group_refractivity(t, p, humidity))
            for p in (600.0, 725.0, 850.0, 975.0, 1100.0)
        ]
        ax.fill_between(t, np.min(spread, axis=0), np.max(spread, axis=0), color=colour, alpha=0.2, lw=0)
        ax.plot(t, spread[2], color=colour, lw=1.3, label=f"{humidity:.0f} % humidity")
    u = 1e6 * MODELS["ciddor_hill1999"].standard_uncertainty
    ax.axhspan(-u, u, color=FAINT, alpha=0.15, lw=0, label="u of ciddor_hill1999")
    ax.axhline(0.0, color=INK, lw=0.8)
    ax.set_title(name)
    ax.set_xlabel("temperature (°C)")


def _draw_sums(by_temperature, by_pressure) -> None:
    """The Lorentz-Lorenz sum less the other, 1e-9 of the group index."""
    t, p = np.linspace(-20.0, 45.0, 131), np.linspace(600.0, 1100.0, 131)
    for humidity, colour in zip(HUMIDITIES, SERIES, strict=False):
        for ax, x, weather in ((by_temperature, t, (t, 850.0)), (by_pressure, p, (20.0, p))):
            sums = both(*weather, humidity)
            ax.plot(x, 1e9 * (sums.lorentz - sums.proportional), color=colour, lw=1.3)
    for ax, label, title in (
        (by_temperature, "temperature (°C)", "The two sums, at 850 hPa"),
        (by_pressure, "pressure (hPa)", "The two sums, at 20 °C"),
    ):
        ax.axhline(0.0, color=INK, lw=0.8)
        ax.set_xlabel(label)
        ax.set_title(title)
    by_temperature.set_ylabel("Lorentz-Lorenz less eq. 5 (1e-9)")


def _draw_printed(ax) -> None:
    """What each sum misses of the printed values; half a printed digit is shaded."""
    at = np.arange(len(PRINTED))
    residuals = printed_residuals()
    ax.axvspan(-0.05, 0.05, color=FAINT, alpha=0.2, lw=0)
    ax.axvline(0.0, color=INK, lw=0.8)
    ax.plot(residuals.proportional, at, "o", color=SERIES[2], ms=5, label="eq. 5")
    ax.plot(residuals.lorentz, at, "s", color=SERIES[3], ms=5, label="Lorentz-Lorenz")
    ax.set_yticks(at, [f"{t:.0f} °C {pa / 100:.0f} hPa {h:.0f} %" for t, pa, h, _ in PRINTED], fontsize=7.5)
    ax.set_ylim(len(PRINTED) + 0.7, -0.5)  # the legend goes under the last
    ax.set_title("Less Ciddor's table")
    ax.set_xlabel("phase index (1e-8)")
    ax.legend(loc="lower center", ncols=2, columnspacing=1.0)


def main(directory: str) -> None:
    """Print the tables, write the figure."""
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    (target / "lorentz-lorenz.svg").write_text(figure(), encoding="utf-8")
    sys.stdout.write(f"{report()}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python studies/lorentz_lorenz.py DIRECTORY")
    main(sys.argv[1])
