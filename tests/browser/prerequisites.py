"""Say what the browser tests lack here; exit status 1 if anything."""

import re
import shutil
import subprocess
import sys

LEAST_NODE = (20, 19)  # Vite's


def missing() -> list[str]:
    """Programs that are not here, each with what was expected."""
    lacks = []
    node = shutil.which("node")
    if node is None or shutil.which("npm") is None:
        lacks.append("no node with npm (expected Node 20.19 or newer)")
    else:
        said = subprocess.run([node, "--version"], capture_output=True, text=True, check=True).stdout
        version = tuple(int(n) for n in re.findall(r"\d+", said)[:2])
        if version < LEAST_NODE:
            lacks.append(f"node {said.strip()} (expected 20.19 or newer)")
    if browser() is None:
        lacks.append("no chromium (expected Debian's)")
    return lacks


def browser() -> str | None:
    """Path of Debian's Chromium, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


if __name__ == "__main__":
    if lacks := missing():
        sys.exit(f"tests of the pages SKIPPED: {'; '.join(lacks)}")
