"""Hostile nights: how a reduction answers each kind of wrong record and of unexpected nature."""

from hostile.outcome import DOUBTFUL, OUTCOMES, SILENT
from hostile.rows import HONEST, NAMES, TWO, UNTRIED_SEED, sizes_of, unit_of
from hostile.run import cases, outcomes, row_of

MANY = {TWO: 40 / 9, HONEST: 200 / 9}  # times as many nights as of the others: with 9, 400 and 200
APART = 100  # seeds from a row's first to the next row's; the last row has more


def nights_of(name, count):
    """Nights of a row: its sizes by turns, each night with a nature of its own."""
    first = UNTRIED_SEED + APART * NAMES.index(name)
    return cases([name], range(first, first + round(count * MANY.get(name, 1))), cycle=True)


def measured(count, say, jobs):
    """Row of each kind of lie: how many of so many nights were answered how."""
    rows = []
    for name in NAMES:
        found = list(outcomes(nights_of(name, count), jobs))
        row = row_of(name, found)
        del row["slowest_s"]
        first = {"lies": list(found[0].case.lies), "word": found[0].word}
        rows.append(row | {"sizes": list(sizes_of(name)), "unit": unit_of(name), "first_night": first})
        say(f"{name}: {', '.join(f'{row[word]} {word}' for word in OUTCOMES if row[word])}")
        for o in found:
            if o.accused or (o.alarms and name == HONEST) or o.word in (DOUBTFUL, SILENT):
                say(f"  {o.case.seed} {', '.join(o.case.lies)}: {o.word}; {'; '.join((*o.accused, *o.alarms))}")
    return rows
