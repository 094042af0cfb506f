"""Styles of the screen: colours that are legible on light and on dark backgrounds, never the only sign of a state.

Each has a contrast of 4 or so to white and to black, which no colour can much exceed to both; terminals with fewer
colours get the nearest of theirs, and with NO_COLOR none.
"""

from catseye.coordinator.condition import WRONG

GOOD, WARNING, ALARM = "color(29)", "bold color(166)", "bold color(196)"  # of the 256: green, orange, red
FAINT = "dim"
CHOSEN = "reverse"
WORDS = {  # of a site's condition
    "starting": "bold reverse",
    "well": "bold color(231) on color(29)",
    "impaired": "bold color(231) on color(166)",
    "alarm": "bold color(231) on color(196)",
    "stopped": "bold color(231) on color(196)",
}
OF_SEVERITY = {"debug": FAINT, "note": "", "warning": WARNING, "alarm": ALARM}


def of_ranger(word: str) -> str:
    """Style of a ranger's state."""
    if word in WRONG:
        return OF_SEVERITY[WRONG[word]]
    return GOOD if word == "measures" else ""
