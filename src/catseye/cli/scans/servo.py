"""The commands of a mirror's servo."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.scans.scan import Out

servo = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Servo of a mirror's axis, identified from recorded moves.",
    epilog="\b\nExample: catseye servo identify examples/servo/moves.csv",
)
app.add_typer(servo, name="servo")


@servo.callback()
def _group() -> None:
    """Group of one command: its name stays part of the command line."""


@servo.command(
    epilog="\b\nExample: catseye servo identify examples/servo/moves.csv --kp 176 --ki 217 --kd 2273 --interval 3 "
    "--out servo\n"
    "Columns of MOVES.csv: catseye help formats/servo"
)
def identify(  # noqa: PLR0913 - its options are its command line
    moves: Annotated[Path, typer.Argument(metavar="MOVES.csv", help="Recorded moves of one axis.")],
    kp: Annotated[int | None, typer.Option("--kp", help="Proportional gain of the filter, as FKP takes it.")] = None,
    ki: Annotated[int, typer.Option("--ki", help="Integral gain, as FKI takes it.")] = 0,
    kd: Annotated[int | None, typer.Option("--kd", help="Derivative gain, as FKD takes it.")] = None,
    interval: Annotated[int, typer.Option("--interval", help="Interval of the derivative, as FSI takes it.")] = 0,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Recorded moves of a mirror's axis to gain, friction and delay; margins of its loop."""
    from catseye.api.result import require_writable, save
    from catseye.api.scans.servo import identify_servo

    require_writable(out, moves)
    result = identify_servo(moves, kp=kp, ki=ki, kd=kd, interval=interval)
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: windows.csv, moves.svg, result.json")]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)
