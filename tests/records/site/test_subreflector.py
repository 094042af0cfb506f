"""subreflector.toml: the example, and what is refused in one line."""

import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.subreflector import SubreflectorMount
from repository import ROOT

TEXT = (ROOT / "examples" / "subreflector" / "hexapod.toml").read_text(encoding="utf-8")


def test_joints_are_metres_in_the_order_of_the_file():
    mount = read_record(ROOT / "examples" / "subreflector" / "hexapod.toml", SubreflectorMount)
    assert [each.name for each in mount.actuator] == ["1A", "1B", "2A", "2B", "3A", "3B"]
    assert mount.joints["fixed"][0].tolist() == [0.5806, 2.3287, 6.2]
    assert mount.joints["pivot"].tolist() == [0.0, 0.0, 4.0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "1B"', 'name = "1A"', "the name '1A' stands twice"),
        ("least_mm = 2040", "least_mm = 2400", "1A is 2344.15 mm long at rest"),
        ("most_mm = 2640", "most_mm = 2.64", "most_mm = 2.64"),
        (TEXT[TEXT.rindex("[[actuator]]") :], "", "5 tables"),
        ("pivot_mm", "pivot", "pivot"),
    ],
)
def test_spoilt_files_are_refused(tmp_path, old, new, said):
    (tmp_path / "sub.toml").write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"sub\.toml") as refused:
        read_record(tmp_path / "sub.toml", SubreflectorMount)
    assert said in str(refused.value)
