"""Address files, addresses.toml."""

import pytest

from catseye.coordinator.link.settings import Address
from catseye.errors import InputError
from catseye.service.addresses import read_addresses
from simulator.living_scene import site

HEAD = 'format = "catseye-addresses-1"\n'
ONE = HEAD + '[[ranger]]\nname = "ZY101"\nhost = "10.1.8.1"\n'


def read(tmp_path, text):
    path = tmp_path / "where.toml"
    path.write_text(text)
    return read_addresses(path, site())


def test_rangers_have_default_ports_unless_stated(tmp_path):
    text = HEAD + 'feed = "10.1.0.2:5250"\n' + ONE.removeprefix(HEAD)
    text += '[[ranger]]\nname = "ZY113"\nhost = "h"\nports = [1, 2]\n'
    found, feed = read(tmp_path, text)
    assert found == {"ZY101": Address("10.1.8.1", (5240, 5241)), "ZY113": Address("h", (1, 2))}
    assert feed == ("10.1.0.2", 5250)
    assert read(tmp_path, ONE)[1] is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "format is missing"),
        ('format = "other"', "format = 'other'"),
        (HEAD, "names no ranger"),
        (ONE.replace("ZY101", "ZY999"), "name = 'ZY999' is not a ranger"),
        (ONE + ONE.removeprefix(HEAD), "is listed twice"),
        (ONE + "ports = [5240]\n", r"ports = \[5240\]"),
        (ONE + "ports = [5240, 70000]\n", "expected two, 1 to 65535"),
        (HEAD + 'feed = "10.1.0.2"\n' + ONE.removeprefix(HEAD), r"feed = '10\.1\.0\.2' \(expected HOST:PORT\)"),
    ],
)
def test_invalid_file_is_refused_with_its_name_and_place(tmp_path, text, said):
    with pytest.raises(InputError, match=rf"where\.toml.*{said}"):
        read(tmp_path, text)


def test_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"no\.toml"):
        read_addresses(tmp_path / "no.toml", site())
