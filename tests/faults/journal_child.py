"""A process that journals until it is killed: each acknowledged number goes to stdout (test_journal_killed.py)."""

import sys
import threading

from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import scene_answer, scene_run

AT_ONCE = 12  # appends under way


def main(place: str, first: int) -> None:
    journal = Journal.open(
        place,
        run=scene_run(),
        clock=ManualClock(52889.125),
        settings=JournalSettings(group=0.001, compress=first % 2 == 1),
    )
    free, out = threading.Semaphore(AT_ONCE), threading.Lock()
    said(f"run {journal.run}")
    number = first

    def acknowledged(number, future):
        with out:
            said(f"{number} {future.result()}")
        free.release()

    while True:
        free.acquire()
        future = journal.append(scene_answer(number))
        future.add_done_callback(lambda future, number=number: acknowledged(number, future))
        number += 1


def said(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
