"""Entry point of `python -m catseye.web`: settings on the first line of standard input."""

import sys

from catseye.errors import CatseyeError


def main() -> int:
    """Serve until standard input ends; the exit status."""
    from catseye.api.live.address import page_settings
    from catseye.web.refusals import printable, write_line
    from catseye.web.service import first_line, run

    try:
        run(page_settings(first_line()))
    except CatseyeError as problem:
        write_line(printable(f"catseye: {problem}"))
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
