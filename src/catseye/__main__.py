"""Entry point of `python -m catseye`."""

from catseye.cli.main import run

if __name__ == "__main__":
    run()
