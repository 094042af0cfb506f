"""Measure how good catseye is and write docs/evidence/how-good.md.

PYTHONPATH=tests python tests/evidence/run.py            make evidence
    --nights 60:40 200:40 400:40                          sizes of the dish and numbers of nights
    --records 3                                           nights of each kind of wrong record; 9 are 400, and 200 honest
    --jobs 2                                              processes of these nights
    --show                                                print the tables, write nothing
"""

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from catseye.version import __version__
from evidence import baselines, networks, nights, page, wrong_records
from repository import ROOT


def processor():
    """Model of the processor, as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def revision():
    """Commit that is measured; "no repository" outside of one."""
    words = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "no repository"


def say(line):
    """Write a line of progress at once."""
    sys.stderr.write(line + "\n")
    sys.stderr.flush()


def processor_s():
    """Time of the processor, in seconds, that this process and those it waited for took."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def measure(sizes, records, jobs):
    """Measured data of the page."""
    begun = processor_s()
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        data = {
            "format": "catseye-evidence-1",
            "networks": networks.compared(),
            "variance_factors": networks.factors(),
            "baseline": baselines.compared(),
            "wrong_records": wrong_records.measured(records, say, jobs),
            "nights": [nights.measured(prisms, count, where / str(prisms), say) for prisms, count in sizes],
        }
    run = {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "version": __version__,
        "revision": revision(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "processor_s": round(processor_s() - begun, 1),
    }
    return {"run": run} | data


def size_of(text):
    """Size of the dish and number of nights, from PRISMS:NIGHTS."""
    prisms, _, count = text.partition(":")
    if not (prisms.isdecimal() and count.isdecimal() and int(prisms) in nights.FIRST_SEED and int(count) >= 2):
        sizes = ", ".join(map(str, nights.FIRST_SEED))
        raise argparse.ArgumentTypeError(f"{text!r} (expected PRISMS:NIGHTS, prisms of {sizes}, 2 nights or more)")
    return int(prisms), int(count)


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    usual = [(60, 20), (200, 4)]
    parser.add_argument("--nights", nargs="+", type=size_of, default=usual, metavar="PRISMS:NIGHTS", help="60:20 200:4")
    parser.add_argument("--records", type=int, default=9, help="nights of each kind of wrong record, 1 or more; 9")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes of these nights; one a core")
    parser.add_argument("--show", action="store_true", help="print the tables, write nothing")
    options = parser.parse_args()
    if options.records < 1:
        parser.error(f"--records {options.records} (expected 1 or more)")
    data = measure(options.nights, options.records, options.jobs)
    if options.show:
        sys.stdout.write("\n\n".join(text(data) for text in page.TEXTS.values()) + "\n")
        return 0
    text = page.filled(page.PAGE.read_text(encoding="utf-8"), data)
    page.DATA.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    page.PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
