"""Where the checkout is, for tests of every room: no test counts the folders above it."""

from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
