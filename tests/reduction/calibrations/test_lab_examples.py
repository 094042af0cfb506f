"""The examples of the lab's kinds are as `lab_scene` writes them."""

import pytest

from lab_scene import EXAMPLES, write_example
from repository import ROOT

HERE = ROOT / "examples" / "calibrations"


@pytest.mark.parametrize("planted", [False, True])
@pytest.mark.parametrize("kind", EXAMPLES)
def test_an_example_is_what_its_maker_writes(kind, planted, tmp_path):
    write_example(kind, tmp_path, planted)
    name = f"{kind}-planted" if planted else kind
    for ending in (".csv", ".toml"):
        made, kept = ((folder / (name + ending)).read_text(encoding="utf-8") for folder in (tmp_path, HERE))
        assert made == kept
