"""The command that shows the documentation in the terminal."""

import io
import os
import shlex
import shutil
import signal
import subprocess
import sys
import textwrap
from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.terminal import WIDTH, say

FOLDERS = {  # order and headings of the list
    "": "Pages",
    "tour": "Tour",
    "howto": "How-to",
    "why": "Why",
    "formats": "Files",
    "reference": "Reference",
    "gallery": "Gallery",
    "evidence": "Evidence",
    "people": "For maintainers",
    "decisions": "Decisions",
    "studies": "Studies",
}
EPILOG = (
    "\b\nExample: catseye help conventions\n"
    "The last part of a name is enough where it is the only one: catseye help network"
)
NAMES = 46  # columns of a name
STYLES = "-FRX"  # of less: leave at once where a page fits, show colours, keep the screen


@app.command("help", epilog=EPILOG)
def show_topic(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[TOPIC]", help="Page, such as conventions or formats/beam; listed without."),
    ] = None,
    json: Json = False,
) -> None:
    """List the topics of the documentation, or show one."""
    from catseye.api.reading import topic, topics
    from catseye.api.result import json_text

    titles = topics()
    if name is None:
        say(json_text({"topics": titles}) if json else listed(titles))
        return
    group = typer.main.get_command(app)
    command = getattr(group, "commands", {}).get(name)
    if command is not None and name not in titles:
        text = command.get_help(typer.Context(command, info_name=f"catseye {name}", max_content_width=WIDTH))
        say(json_text({"topic": name, "title": command.get_short_help_str(WIDTH), "text": text}) if json else text)
        return
    page = topic(name)
    if json:
        say(json_text(page.to_object()))
        return
    related = "\n".join(f"- `catseye help {linked}`: {titles[linked]}" for linked in page.related)
    show(page.text + (f"\n## Related topics\n\n{related}\n" if related else ""))


def listed(titles: dict[str, str]) -> str:
    """Topics with their titles, by folder."""
    folders = dict.fromkeys([*FOLDERS, *(name.rpartition("/")[0].partition("/")[0] for name in titles)])
    lines: list[str] = []
    for folder in folders:
        inside = [
            name
            for name in titles
            if (name.partition("/")[0] if "/" in name else "") == folder and not (folder == "" and name in folders)
        ]
        if folder in titles:
            inside = [folder, *inside]
        if not inside:
            continue
        column = min(max(map(len, inside)), NAMES)
        lines += ["", FOLDERS.get(folder, folder.capitalize())]
        for name in inside:
            lines += textwrap.wrap(
                titles[name], width(), initial_indent=f"  {name:<{column}}  ", subsequent_indent=" " * (column + 4)
            )
    return "\n".join([*lines[1:], "", "Show one: catseye help conventions"])


def width() -> int:
    """Columns for text on this terminal, 100 at most."""
    return min(WIDTH, shutil.get_terminal_size().columns) if sys.stdout.isatty() else WIDTH


def show(text: str) -> None:
    """Show Markdown on the terminal, a long text in its pager; plain lines where stdout is no terminal."""
    from rich.console import Console
    from rich.markdown import Markdown

    terminal = sys.stdout.isatty()
    with io.StringIO() as stream:
        console = Console(
            file=stream, width=width(), force_terminal=terminal, color_system="auto" if terminal else None
        )
        console.print(Markdown(text, hyperlinks=False))
        lines = [line.rstrip() for line in stream.getvalue().splitlines()]
    if not terminal or len(lines) < shutil.get_terminal_size().lines or not paged("\n".join(lines) + "\n"):
        say("\n".join(lines))


def paged(text: str) -> bool:
    """Show a text in the reader's pager; False where there is none.

    Ctrl-C is the pager's while it runs.
    """
    program = shlex.split(os.environ.get("PAGER", "less"))
    if not program or shutil.which(program[0]) is None:
        return False
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        place = {**os.environ, "LESS": os.environ.get("LESS", STYLES)}
        subprocess.run(program, input=text.encode(), env=place, check=False)
    except OSError:
        return False
    finally:
        signal.signal(signal.SIGINT, handler)
    return True
