"""Journals that another version might have written: a recorded run again, with entries changed."""

import sqlite3
from dataclasses import replace

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, Run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.records.night.live import TICKS_PER_DAY
from catseye.simulator.clock.world_clock import ManualClock
from cli.living_scene import recorded


def rewritten(path, change=lambda entry: entry, **settings):
    """The recorded run in a new journal with a chain of its own, each entry as `change` makes it.

    settings   of the journal
    """
    with JournalReader(recorded()) as reader:
        run = reader.run()
        again = Run(reader.site(run.run), run.settings, seed=run.seed)
        clock = ManualClock(run.started / TICKS_PER_DAY)
        with Journal.open(path, run=again, clock=clock, settings=JournalSettings(**settings)) as journal:
            for _, entry in reader.events(run.run):
                journal.append(change(entry))
            journal.append().result(30.0)
    return path


def carried_back(path):
    """A journal as version 1 was: without a chain and without parts."""
    with sqlite3.connect(path) as connection:
        connection.execute("DROP TABLE chain")
        connection.execute("DROP TABLE parts")
        connection.execute("UPDATE journal SET version = 1")
    connection.close()
    return path


def reworded(entry):
    """The same numbers, codes and statuses in other words: notes gone, each reason and each shot's text another."""
    if isinstance(entry, EpochSolution) and entry.answer:
        rejected = {number: f"{line.split(': ')[0]}: as it was" for number, line in entry.answer["rejected"].items()}
        return replace(entry, answer=entry.answer | {"notes": ["in other words"], "rejected": rejected})
    if isinstance(entry, AnsweredShot) and entry.text:
        return replace(entry, text=f"{entry.status}: as it was")
    return entry


def in_epoch(number, change):
    """A change of one epoch's answer."""

    def changed(entry):
        if isinstance(entry, EpochSolution) and entry.answer.get("number") == number:
            return replace(entry, answer=entry.answer | change(entry))
        return entry

    return changed
