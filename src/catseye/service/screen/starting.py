"""Picture of a start, before there is a coordinator to ask; imported before anything heavy."""

from rich.console import Console
from rich.text import Text

BAR = 20  # characters
MESSAGES = 6  # shown


def start_line(what: str, done: int, total: int) -> Text:
    """Progress of a start, as a bar and in numbers."""
    bar = "█" * (BAR * done // total if total else 0)
    return Text(f"start    {bar:·<{BAR}} {done} of {total} {what}")


def start_picture(
    console: Console, name: str, seconds: float, progress: tuple[str, int, int] | None, messages: list[str]
) -> list[str]:
    """Lines for a console: site, time since the command, progress, last messages."""
    lines = [Text(f"{name}  starting, {seconds:.0f} s", style="bold"), Text("")]
    if progress is not None:
        lines.append(start_line(*progress))
    lines += [Text(text, style="dim") for text in messages[-MESSAGES:]]
    with console.capture() as capture:
        for line in lines:
            console.print(line, overflow="ellipsis", no_wrap=True)
    return capture.get().removesuffix("\n").split("\n")
