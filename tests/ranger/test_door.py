"""The site's key: where it comes from, and what it may be."""

import pytest

from catseye.errors import InputError
from catseye.ranger.door import is_here, key_of, opens

KEY = "a-key-of-the-site"


def test_the_key_is_of_the_environment_or_of_a_file_that_it_names(tmp_path):
    (tmp_path / "key").write_text(f"{KEY}\n")
    assert key_of({}) is None
    assert key_of({"CATSEYE_KEY": KEY}) == KEY
    assert key_of({"CATSEYE_KEY_FILE": str(tmp_path / "key")}) == KEY


@pytest.mark.parametrize(
    "key", ["", "short", "with a blank in it, all", "semi;colon-in-the-middle", "ümlaut-ümlaut-ümlaut"]
)
def test_a_key_that_no_line_holds_is_refused(key):
    with pytest.raises(InputError, match="expected 16 or more"):
        key_of({"CATSEYE_KEY": key})


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        key_of({"CATSEYE_KEY_FILE": str(tmp_path / "none")})


def test_only_the_key_opens():
    assert opens(f"KEY {KEY}".encode(), KEY)
    assert opens(f"1000\tkey {KEY}\r".encode(), KEY)
    for line in (b"", b"KEY", f"KEY {KEY} ".encode() + b"x", f"KEY {KEY}, x".encode(), KEY.encode(), b"\xff\xfe"):
        assert not opens(line, KEY)


def test_what_is_here():
    assert all(map(is_here, ("127.0.0.1", "127.9.9.9", "::1", "localhost")))
    assert not any(map(is_here, ("0.0.0.0", "::", "10.0.0.1", "example.org", "")))
