"""Three walks of CONTRIBUTING.md: an answer and its verdict are complete before `gateways` is entered."""

import re
import subprocess
import sys

import pytest

from repository import ROOT

WALKS = {  # title in CONTRIBUTING.md: the call that goes it
    "A buffer's walk": 'catseye.reduce("night-01")',
    "A range's walk": 'catseye.adjust("networks/template")',
    "A sheet's walk": 'catseye.triplet("triplets/TR99.toml")',
}


@pytest.mark.parametrize("call", WALKS.values())
def test_answer_and_verdict_need_nothing_of_gateways(call):
    code = f"import sys, catseye; {call}.verdict; print(*(m for m in sys.modules if m.startswith('catseye.gateways')))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


def test_each_walk_is_written_down():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for title, call in WALKS.items():
        [walk] = re.findall(rf"(?ms)^## {title}\n(.*?)(?=^## )", text)
        name = call.partition("(")[0].removeprefix("catseye.")
        assert f"`{name}` in `api/" in walk
        steps = re.split(r"(?m)^\d+\. ", walk)[1:]
        assert len(steps) >= 4
        entered = [k for k, step in enumerate(steps) if "`gateways/" in step]
        assert entered == [len(steps) - 1], f"{title}: gateways is the last step alone"
