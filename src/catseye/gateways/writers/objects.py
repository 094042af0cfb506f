"""JSON conversion and formatting, and the versions of the software."""

import json
import math
import platform
from importlib.metadata import version
from typing import Any

import numpy as np

from catseye.version import __version__

PACKAGES = ("numpy", "scipy", "pydantic", "matplotlib", "threadpoolctl", "typer")


def plain(value: Any) -> Any:
    """Value in JSON's own types; NaN and infinity become null.

    >>> plain({"a": np.float64(1.5), "b": [float("nan")]})
    {'a': 1.5, 'b': [None]}
    """
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)


def json_line(value: Any) -> str:
    """JSON text on one line, for programs."""
    return json.dumps(plain(value), allow_nan=False)


def json_page(value: dict[str, Any]) -> str:
    """JSON text with one line per entry, two levels deep, readable in an editor."""
    lines = []
    for key, item in plain(value).items():
        start = f"  {json.dumps(key)}: "
        if isinstance(item, dict) and item:
            inner = ",\n".join(f"    {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in item.items())
            lines.append(f"{start}{{\n{inner}\n  }}")
        elif isinstance(item, list) and item and isinstance(item[0], list | dict):
            inner = ",\n".join(f"    {json.dumps(row, allow_nan=False)}" for row in item)
            lines.append(f"{start}[\n{inner}\n  ]")
        else:
            lines.append(start + json.dumps(item, allow_nan=False))
    return "{\n" + ",\n".join(lines) + "\n}\n"


def versions() -> dict[str, str]:
    machine = f"{platform.system()} {platform.machine()}"
    installed = {name: version(name) for name in PACKAGES}
    return {"catseye": __version__, "python": platform.python_version(), **installed, "platform": machine}
