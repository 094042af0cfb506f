"""What `import catseye` gives: a function a job, arrays and paths in, frozen results out.

Each function takes a path, a bundled name or what `load` gave, and answers with a `Result` (`result`). A subject is a
file: `reading` (load, examples), `night` (reduce, explain), `weather` (air, sound), `living` (simulate, replay).
Nothing heavier than numpy is imported before a function is called.
"""

from catseye.api.living import replay, simulate
from catseye.api.night import explain, reduce
from catseye.api.reading import examples, load
from catseye.api.result import save, show
from catseye.api.weather import air, sound

__all__ = [
    "air",
    "examples",
    "explain",
    "load",
    "reduce",
    "replay",
    "save",
    "show",
    "simulate",
    "sound",
]
