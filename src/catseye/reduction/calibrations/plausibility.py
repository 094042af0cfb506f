"""Plausibility of a calibration: scatter, sizes, u and columns.

Against the limits of the kind's instruments.

Tests of the kind ask whether the readings agree with each other and with what the sheet claims. A column that is
negated, doubled or shifted often agrees with itself; then only size tells: a height gauge does not scatter by 18 mm.
Before a column is blamed the cure is tried on a copy of the readings; the readings themselves stay as they are.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import islice, pairwise

import numpy as np

from catseye.atmosphere.weather.humidity import LEAST_RESOLVED, humidity_doubts
from catseye.errors import CatseyeError
from catseye.records.files.readings import TIME, SheetReadings
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.kind import CalibrationKind, Plausibility

GRAVE = 10.0  # times a limit: beyond it the result is rejected, up to it doubtful
ROUNDING = 1e-6  # of a period, or of a column's largest value: rounding of equal readings
NAMED = 4  # reported cures; more mean that no column is suspect
MOST_TRIED = 5000  # readings times cures: beyond it the search is left out, a few seconds
SERIAL = 4.0  # standard deviations of the correlation of neighbours; 3e-5 by chance
FEWEST = 12  # readings that tell such a correlation
WAYS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "negated": lambda v: -v,
    "halved": lambda v: 0.5 * v,
    "doubled": lambda v: 2.0 * v,
    "moved up a row": lambda v: np.roll(v, -1),
    "moved down a row": lambda v: np.roll(v, 1),
    "in reverse order": lambda v: v[::-1],
}


def judged(kind: CalibrationKind, readings: SheetReadings, calibration: Calibration) -> Calibration:
    """Calibration with `plausible`: limits, and the suspect column.

    kind, readings   its input, for the cures

    Where every limit holds and the scatter is that of the instrument the outcomes are few: one a limit that the kind
    states for a reading, and one for all quantities.
    """
    outcomes = _outcomes(kind.plausible, readings, calibration)
    failed = [k for k, outcome in enumerate(outcomes) if outcome.passed is False]
    grave = [k for k in failed if outcomes[k].grave]
    suspect = calibration.fit is not None and bool(calibration.fit.suspects.any())
    if not failed or (suspect and not grave):  # a single reading that stands out is looked at first
        return replace(calibration, plausible=tuple(outcomes))
    first = (grave or failed)[0]
    advice = _advice(kind, readings)
    if advice:
        outcomes[first] = replace(outcomes[first], text=f"{outcomes[first].text}; {advice}")
    return replace(calibration, plausible=tuple(outcomes))


def _outcomes(limits: Plausibility, readings: SheetReadings, calibration: Calibration) -> list[CheckOutcome]:
    return [
        *_columns(limits, readings),
        *_humidity(readings),
        *_scatter(limits, calibration),
        *_explained(limits, calibration),
        *_sizes(limits, calibration),
        *_neighbours(calibration),
    ]


def _columns(limits: Plausibility, readings: SheetReadings) -> Iterator[CheckOutcome]:
    """Constant columns that must vary, and implausible values."""
    for name, period in limits.varying.items():
        if name not in readings.numbers:
            continue
        values = readings.numbers[name][readings.active]
        away = values - values[0]
        away = np.abs(away - period * np.round(away / period) if period else away)
        if not np.any(away > ROUNDING * (period or float(np.max(np.abs(values))))):
            modulo_text = f" (modulo {period:g})" if period else ""
            yield CheckOutcome(
                f"column {name}: different values", 1.0, 2.0, False,
                f"column {name} holds {values[0]:g} in every reading{modulo_text} (expected values that vary)",
                least=True,
            )  # fmt: skip
    for name, span in limits.columns.items():
        if name not in readings.numbers:
            continue
        values = readings.numbers[name][readings.active]
        excess = np.maximum(span.low - values, values - span.high)
        if np.any(excess > 0.0):
            worst = float(values[np.argmax(excess)])
            low = worst < span.low
            yield CheckOutcome(
                f"column {name}: {'smallest' if low else 'largest'}", worst, span.low if low else span.high, False,
                f"column {name} holds {worst:g}, expected {span.low:g} to {span.high:g}: {span.reason}",
                least=low, grave=False,
            )  # fmt: skip


def _humidity(readings: SheetReadings) -> Iterator[CheckOutcome]:
    """Humidity that is likely a fraction of 1, of the sheet or its column."""
    of_sheet = getattr(readings.sheet, "humidity_percent", None)
    values = readings.numbers.get("humidity_percent", np.array([] if of_sheet is None else [of_sheet], dtype=float))
    for text in humidity_doubts(values):
        largest = float(np.max(values))
        yield CheckOutcome("humidity_percent: largest", largest, LEAST_RESOLVED, False, text, least=True, grave=False)


def _scatter(limits: Plausibility, calibration: Calibration) -> Iterator[CheckOutcome]:
    """Scatter of a reading, estimated or claimed, against the instrument's."""
    fit, scatter = calibration.fit, limits.scatter
    if fit is None or scatter is None:
        return
    deviations = fit.components or {"claimed scatter of the best reading": float(np.min(fit.sigma[fit.active]))}
    for name, deviation in deviations.items():
        size = deviation / scatter.size
        text = (
            f"the readings scatter by {size:.3g} {scatter.unit}, the instrument by {scatter.most:g} at most: "
            if size > scatter.most
            else ""
        )
        yield _at_most(f"{name}, {scatter.unit}", size, scatter.most, f"{text}{scatter.reason}")


def _explained(limits: Plausibility, calibration: Calibration) -> Iterator[CheckOutcome]:
    """Share of the readings' variance outside the model."""
    if limits.explained <= 0.0:
        return
    share = calibration.explained
    if share != share and calibration.fit is not None:
        share = calibration.fit.explained
    if share != share:
        share = 0.0  # readings all alike: there was nothing to explain
    text = "the readings follow the model"
    if 1.0 - share > 1.0 - limits.explained:
        text = f"the model explains {max(share, 0.0):.2%} of the readings' variance, {limits.explained:.2%} is expected"
    yield _at_most("variance that the model leaves, share", 1.0 - share, 1.0 - limits.explained, text)


def _sizes(limits: Plausibility, calibration: Calibration) -> Iterator[CheckOutcome]:
    """Each quantity and its u within the kind's span.

    One outcome if all are.
    """
    failed = False
    for q in calibration.quantities:
        for span in (s for pattern, s in limits.sizes.items() if fnmatchcase(q.key, pattern)):
            if not span.low <= q.value <= span.high:
                low, failed = q.value < span.low, True
                yield CheckOutcome(
                    q.key, q.value, span.low if low else span.high, False,
                    f"{q.key} = {q.value:.6g} {q.unit}, plausible {span.low:g} to {span.high:g}: {span.reason}",
                    least=low, grave=bool(abs(q.value) > GRAVE * max(abs(span.low), abs(span.high))),
                )  # fmt: skip
            if q.u > span.most_u:
                failed = True
                yield _at_most(
                    f"u of {q.key}, {q.unit}".rstrip(", "), q.u, span.most_u,
                    f"u of {q.key} is {q.u:.2g} {q.unit}: these readings tell no more than that it lies between "
                    f"{span.low:g} and {span.high:g}",
                )  # fmt: skip
    if limits.sizes and not failed:
        yield CheckOutcome("quantities beyond their span", 0.0, 0.0, True, "every size and u is plausible")


def _neighbours(calibration: Calibration) -> Iterator[CheckOutcome]:
    """Correlation of neighbouring residuals.

    Something in the order of the readings is missing in the model.

    Only where the scatter is one of independent readings. The correlation of m neighbours scatters by 1/sqrt(m) about a
    little less than zero, as the fit takes a part away [FOERSTNER16].
    """
    fit = calibration.fit
    if fit is None or len(fit.components) != 1 or not fit.independent:
        return
    residual = np.where(fit.active, fit.statistic, 0.0)
    count = int(np.count_nonzero(fit.active))
    power = float(np.mean(residual**2)) * len(residual) / max(count, 1)
    if count < FEWEST or power <= 0.0:
        return
    together = float(np.sum(residual[1:] * residual[:-1])) / count / power
    text = "readings scatter independently"
    if together * np.sqrt(count) > SERIAL:
        text = (
            f"residuals of neighbours are alike (correlation {together:.2f}): they follow something that is not in the "
            "model, and u is too small"
        )
    yield replace(
        _at_most("correlation of neighbouring residuals", together, SERIAL / np.sqrt(count), text), grave=False
    )


def _at_most(name: str, statistic: float, most: float, text: str) -> CheckOutcome:
    return CheckOutcome(name, statistic, most, bool(statistic <= most), text, grave=bool(statistic > GRAVE * most))


# ----------------------------------------------------------------------------------------------------------- cures


def _advice(kind: CalibrationKind, readings: SheetReadings) -> str:
    """Columns whose change on a copy makes the readings plausible, as a text.

    "" if none or many do.
    """
    copies = list(_changed(kind, readings))
    if len(readings) * len(copies) > MOST_TRIED:
        return ""
    cures = list(islice((how for how, copy in copies if _holds(kind, copy)), NAMED + 1))
    if not cures or len(cures) > NAMED:
        return ""
    return f"they agree with {', or '.join(cures)}: check {'that column' if len(cures) == 1 else 'these columns'}"


def _holds(kind: CalibrationKind, readings: SheetReadings) -> bool:
    """True if every limit of the kind is kept, with all readings.

    No single wrong one has such an effect on the scatter.
    """
    try:
        calibration = kind.recipe(readings, False)
    except (CatseyeError, np.linalg.LinAlgError):
        return False
    return all(outcome.passed for outcome in _outcomes(kind.plausible, readings, calibration))


def _changed(kind: CalibrationKind, readings: SheetReadings) -> Iterator[tuple[str, SheetReadings]]:
    """Copies of readings with one change, within the layout's limits.

    One column changed or two neighbours exchanged.
    """
    numbers = {name: values for name, values in readings.numbers.items() if name != TIME}
    bounds = {**kind.layout.optional, **kind.layout.required}
    candidates = [
        (f"{name} {change_name}", {name: change(v)})
        for name, v in numbers.items()
        for change_name, change in WAYS.items()
    ]
    candidates += [(f"{a} and {b} exchanged", {a: numbers[b], b: numbers[a]}) for a, b in pairwise(numbers)]
    for how, change in candidates:
        inside = (
            (limit := bounds[name]) is None or bool(np.all((values >= limit.low) & (values <= limit.high)))
            for name, values in change.items()
        )
        unchanged = all(np.array_equal(values, numbers[name]) for name, values in change.items())
        if not unchanged and all(inside):
            yield how, replace(readings, numbers={**readings.numbers, **change})
    for name, words in readings.words.items():
        for how, moved in (("moved up a row", (*words[1:], words[0])), ("moved down a row", (words[-1], *words[:-1]))):
            if moved != words:
                yield f"{name} {how}", replace(readings, words={**readings.words, name: moved})
