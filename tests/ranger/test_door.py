"""The site's key: sources and requirements."""

import os
import random
import subprocess

import pytest

from catseye.errors import InputError
from catseye.ranger.door import Door, answer_to, key_of, triviality
from catseye.ranger.entrance import MOST_PENDING, Doorway, Entrance
from catseye.ranger.network import is_here

KEY = "a-key-of-the-site"


def test_key_comes_from_environment_or_file(tmp_path):
    (tmp_path / "key").write_text(f"{KEY}\n")
    (tmp_path / "key").chmod(0o600)
    assert key_of({}) is None
    assert key_of({"CATSEYE_KEY": KEY}) == KEY
    assert key_of({"CATSEYE_KEY_FILE": str(tmp_path / "key")}) == KEY


@pytest.mark.parametrize(
    "key", ["", "short", "with a blank in it, all", "semi;colon-in-the-middle", "ümlaut-ümlaut-ümlaut"]
)
def test_key_with_invalid_characters_is_refused(key):
    with pytest.raises(InputError, match="expected 16 or more"):
        key_of({"CATSEYE_KEY": key})


def test_missing_key_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        key_of({"CATSEYE_KEY_FILE": str(tmp_path / "none")})


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o602])
def test_key_file_accessible_by_others_is_refused(tmp_path, mode):
    (tmp_path / "key").write_text(f"{KEY}\n")
    if os.geteuid() == 0:
        os.chown(tmp_path / "key", 1000, 1000)
    (tmp_path / "key").chmod(mode)
    with pytest.raises(InputError, match=r"accessible by others, -rw.* \(expected -rw-------"):
        key_of({"CATSEYE_KEY_FILE": str(tmp_path / "key")})


@pytest.mark.parametrize(
    ("key", "why"),
    [
        ("aaaaaaaaaaaaaaaaaaaa", "1 different characters"),
        ("abababababababababab", "2 different characters"),
        ("0123456789abcdef0123", "consecutive"),
        ("xq2-jihgfedcb-7kQpZ-w", "consecutive"),
        ("kQ7-zx1pkQ7-zx1pkQ7-zx1p", "repeated"),
        ("our-Password-of-2026", "contains 'password'"),
        ("GBT-changeme-x2-key1", "contains 'changeme'"),
    ],
)
def test_trivial_key_is_refused(key, why):
    with pytest.raises(InputError, match=f"trivial: .*{why}"):
        key_of({"CATSEYE_KEY": key})


def test_random_keys_are_not_trivial():
    rng = random.Random(40)
    assert all(triviality(f"{rng.getrandbits(128):032x}") is None for _ in range(2000))


def test_answer_to_a_nonce_agrees_with_openssl():
    asked = ["openssl", "dgst", "-sha256", "-hmac", KEY]
    said = subprocess.run(asked, input=b"00ff", capture_output=True, check=True).stdout.split()[-1]
    assert answer_to("00ff", KEY) == said.decode()
    assert answer_to("00fe", KEY) != said.decode()


def test_addresses_of_this_machine():
    assert all(map(is_here, ("127.0.0.1", "127.9.9.9", "::1", "localhost", "unix:/run/catseye")))
    assert not any(map(is_here, ("0.0.0.0", "::", "10.0.0.1", "example.org", "")))


class Peer:
    """A connection from an address, as far as an entrance asks."""

    def __init__(self, host, port):
        self.peer, self.gone = (host, port), False

    def get_extra_info(self, name):
        return self.peer if name == "peername" else None

    def is_closing(self):
        return self.gone

    def abort(self):
        self.gone = True


def test_an_address_that_opens_many_connections_keeps_no_other_address_out():
    """Attack: with a way of 0.2 s to the port, 17 strangers a way closed whoever was about to prove the key."""
    gate = Doorway(lambda: "ZY101: port 5240", Door(key=KEY), {"KEY"}, lambda: 0.0)
    peers = [Peer("10.0.0.9", 1000 + k) for k in range(200)]
    peers.insert(3, Peer("10.0.0.2", 7))
    said, entrances = [], []
    for peer in peers:
        entrances.append(Entrance(gate, peer, said.append))
        entrances[-1].begin()
    assert [peer.gone for peer in peers if peer.peer[0] == "10.0.0.2"] == [False]
    assert sum(not peer.gone for peer in peers) == MOST_PENDING
    assert peers[-1].gone is False  # the oldest of the others made room
    entrances[3].take(f"KEY {answer_to(said[3].values[0], KEY)}\n".encode())
    assert entrances[3].admitted
