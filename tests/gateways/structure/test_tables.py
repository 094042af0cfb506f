"""The tables of a structure's model and vibration: each number is the one in memory over the unit in its name."""

from types import SimpleNamespace

import numpy as np

from catseye.gateways.structure.tables import coefficients_csv, prediction_csv, residuals_csv, spectra_csv
from column_scene import assert_columns

RNG = np.random.default_rng(31)
EPOCHS, POINTS = 3, 2


def spreads(*shape, size=1e-4):
    """Covariances (..., 3, 3), m^2, of some tenths of a millimetre."""
    root = size * RNG.normal(size=(*shape, 3, 5))
    return root @ np.swapaxes(root, -1, -2)


def made_fit():
    """What the tables ask of a fit: coefficients (6, p) in m and rad, residuals (T, n, 3) in m, postures in rad."""
    six, spread = RNG.normal(size=(6, 2)) * 1e-3, np.diag(RNG.uniform(0.5, 1.0, 12) * 1e-8)
    residual = RNG.normal(size=(EPOCHS, POINTS, 3)) * 1e-3
    residual[1, 0, 2] = np.nan  # not seen in the second epoch
    posture = SimpleNamespace(elevation=np.array([0.3, 0.7, 1.1]), temperature_c=np.array([4.5, np.nan, 12.25]))
    series = SimpleNamespace(
        labels=("a", "b", "c"),
        names=("P1", "P2"),
        mjd=np.array([60_000.125, np.nan, 60_000.5]),
        posture=posture,
        way=np.array([1.0, -1.0, 1.0]),
    )
    model = SimpleNamespace(functions=("sin E", "cos E"))
    fit = SimpleNamespace(residual=residual)
    return SimpleNamespace(six_of=lambda: (six, spread), model=model, series=series, fit=fit), six, spread


def test_every_column_of_the_coefficients_has_the_unit_of_its_name():
    fit, six, spread = made_fit()
    names = [f"shift_{a}_mm" for a in "xyz"] + [f"turn_{a}_arcsec" for a in "xyz"]
    told = {
        "function": lambda k: fit.model.functions[k],
        **{name: lambda k, row=row: six[row, k] for row, name in enumerate(names)},
        **{f"u_{name}": lambda k, row=row: spread[6 * k + row, 6 * k + row] ** 0.5 for row, name in enumerate(names)},
    }
    assert_columns(coefficients_csv(fit), told, range(2))


def test_every_column_of_the_residuals_has_the_unit_of_its_name():
    fit, _, _ = made_fit()
    s, residual = fit.series, fit.fit.residual
    check = SimpleNamespace(residual=2.0 * residual, covariance=spreads(EPOCHS, POINTS))
    told = {
        "epoch": lambda at: s.labels[at[0]],
        "mjd_utc": lambda at: s.mjd[at[0]],
        "elevation_deg": lambda at: s.posture.elevation[at[0]],
        "temperature_c": lambda at: s.posture.temperature_c[at[0]],
        "way": lambda at: s.way[at[0]],
        "point": lambda at: s.names[at[1]],
        **{f"residual_{'xyz'[a]}_mm": lambda at, a=a: residual[*at, a] for a in range(3)},
    }
    rows = [(0, 0), (0, 1), (1, 1), (2, 0), (2, 1)]
    assert_columns(residuals_csv(fit, None), told, rows)
    told |= {f"left_out_{'xyz'[a]}_mm": lambda at, a=a: check.residual[*at, a] for a in range(3)}
    told |= {f"u_left_out_{'xyz'[a]}_mm": lambda at, a=a: check.covariance[*at, a, a] ** 0.5 for a in range(3)}
    assert_columns(residuals_csv(fit, check), told, rows)


def test_every_column_of_a_prediction_has_the_unit_of_its_name():
    place, covariance = RNG.normal(size=(2, POINTS, 3)) * 10.0, spreads(2, POINTS)
    predicted = SimpleNamespace(names=("P1", "P2"), place=place, covariance=covariance)
    asked = {"elevation_deg": [20.5, 45.25], "temperature_c": 7.5}
    told = {
        "elevation_deg": lambda at: np.radians(asked["elevation_deg"][at[0]]),
        "temperature_c": lambda at: 7.5,
        "point": lambda at: predicted.names[at[1]],
        **{f"{'xyz'[a]}_m": lambda at, a=a: place[*at, a] for a in range(3)},
        **{f"u_{'xyz'[a]}_mm": lambda at, a=a: covariance[*at, a, a] ** 0.5 for a in range(3)},
    }
    assert_columns(prediction_csv(predicted, asked), told, list(np.ndindex(2, POINTS)))


def test_every_column_of_the_spectra_has_the_unit_of_its_name():
    density = RNG.uniform(1.0, 2.0, (3, 2)) * 1e-10
    band = np.stack([0.5 * density, 2.0 * density], axis=-1)
    spectrum = SimpleNamespace(
        frequency_hz=np.array([0.25, 0.5, 0.75]),
        density=density,
        interval=lambda share: band if share == 0.95 else None,
    )
    found = SimpleNamespace(spectrum=spectrum, series=[SimpleNamespace(name="ZY101"), SimpleNamespace(name="ZY104")])
    told = {
        "series": lambda at: found.series[at[0]].name,
        "frequency_hz": lambda at: spectrum.frequency_hz[at[1]],
        "density_m2_per_hz": lambda at: density[at[1], at[0]],
        "low_95_m2_per_hz": lambda at: band[at[1], at[0], 0],
        "high_95_m2_per_hz": lambda at: band[at[1], at[0], 1],
    }
    assert_columns(spectra_csv(found), told, list(np.ndindex(2, 3)))
