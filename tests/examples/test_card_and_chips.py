"""The example of a real head, on simulated hardware that is spoken to in bytes."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.ranger.head import SamplingSettings
from catseye.simulator.servo.motor import AxisDesign
from examples.byte_chip import ByteChip, Hardware, IrigClock
from ranger.head_conformance import HeadConformance
from repository import ROOT

HEADS = ROOT / "examples" / "heads"


@pytest.fixture(autouse=True)
def _beside_the_example(monkeypatch):
    monkeypatch.syspath_prepend(str(HEADS))


def made(**options):
    from card_and_chips import CardAndChips

    hardware = Hardware(**options)
    return CardAndChips(hardware, hardware.chips, IrigClock(hardware), hardware), hardware


def driver(angle=0.0):
    from lm628 import Lm628

    port = ByteChip(AxisDesign(), angle)
    chip = Lm628(port, "azimuth")
    chip.reset()
    port.axis.axis(True)
    return chip, port


class TestCardAndChips(HeadConformance):
    def head(self):
        head, self.hardware = made()
        return head

    def pass_time(self, head, seconds):
        self.hardware.pass_time(seconds)

    def test_no_byte_was_lost_to_a_busy_chip(self):
        self.test_homing_finds_the_index_within_30_s()
        assert [chip.lost for chip in self.hardware.chips] == [0, 0]


def test_the_data_sheet_s_example_in_bytes():
    """[TEXAS13] page 11: 100 turns of 2000 counts, 600 rpm at most, 1 turn/s^2, loaded as 15, 446 956 and 200 000."""
    chip, port = driver()
    port.heard.clear()
    assert chip.move(200_000, 446_956, 15)
    trajectory = [0x1F, 0x00, 0x2A, 0, 0, 0, 0x0F, 0x00, 0x06, 0xD1, 0xEC, 0x00, 0x03, 0x0D, 0x40, 0x01]
    assert port.heard[-len(trajectory) :] == trajectory
    port.heard.clear()
    chip.load_filter(200, 300, 3500, 20, 1)
    assert port.heard == [0x1E, 0x01, 0x0F, 0, 200, 0x01, 0x2C, 0x0D, 0xAC, 0, 20, 0x04]


def test_positions_below_zero_and_speeds_backwards_pass_the_bus():
    chip, port = driver()
    chip.load_filter(356, 465, 4355, 4096, 3)
    assert chip.move(-70_000, 2_000_000, 4000)
    port.pass_time(6.0)
    assert (chip.actual(), chip.desired()) == (-70_000, -70_000)
    assert chip.run(-100_000, 4000)
    port.pass_time(1.0)
    assert chip.desired() == pytest.approx(-70_000 - 100_000 / 65_536 * 2930, abs=60)
    assert not chip.run(100_000, 5000)  # another acceleration under way
    chip.stop("smooth")
    port.pass_time(1.0)
    assert chip.run(100_000, 5000)


def test_a_chip_that_never_is_ready_is_named():
    chip, port = driver()
    port._busy = 10**9
    with pytest.raises(InputError, match="azimuth: busy"):
        chip.actual()


def test_a_chip_that_is_written_to_while_busy_loses_it():
    """So that the test above of no byte lost can fail."""
    _, port = driver()
    while port.status() & 1:
        pass
    port.command(0x0A)
    assert port.lost == 0
    port.command(0x0A)
    assert port.lost == 1


def test_homing_turns_back_at_a_stop():
    head, hardware = made(stands=(5000.0, -200.0))  # the stop of 0.6 rad is at 9549 counts
    head.enable(0, True)
    head.find_home(0)
    for _ in range(1500):
        hardware.pass_time(0.02)
        if head.homing(0) != "searching":
            break
    assert head.homing(0) == "home"
    count = hardware.chips[0].axis.motor.count
    assert abs(count) <= 1  # the index is the encoder's true zero
    assert head.actual(0) == count
    assert not head.motor_off(0)


def test_a_jammed_axis_says_that_its_motor_is_off_until_the_next_move():
    head, hardware = made()
    head.enable(0, True)
    head.set_error_limit(0, 400)
    head.start(0, 30_000, velocity=300_000, acceleration=1000)
    hardware.pass_time(10.0)
    assert head.motor_off(0)
    assert not head.moving(0)
    assert head.start(0, head.actual(0) - 500, velocity=300_000, acceleration=1000)
    assert not head.motor_off(0)
    hardware.pass_time(3.0)
    assert not head.motor_off(0)


@pytest.mark.parametrize("look", [0.005, 0.03])
def test_a_track_is_followed_however_often_the_server_looks(look):
    head, hardware = made()
    for axis in (0, 1):
        head.enable(axis, True)
    begin = head.now().after(0.5)
    ends = np.array([400.0, -100.0]), np.array([720.0, 60.0])  # 160 and 80 counts/s
    assert head.follow(ends, (begin, begin.after(2.0)))
    off = []
    while head.moving(0) or head.moving(1):
        hardware.pass_time(look)
        share = min(max(float(head.now().seconds_since(begin)) / 2.0, 0.0), 1.0)
        off.append([head.actual(axis) - (ends[0] + share * (ends[1] - ends[0]))[axis] for axis in (0, 1)])
    bent, end = round(1.2 / look), round(2.45 / look)
    # A look late is 160 counts/s 0.03 s = 5 counts at the bends; between them the correction has brought it to two.
    assert np.max(np.abs(off[bent:end])) <= 2.5
    hardware.pass_time(0.5)
    assert [head.actual(axis) for axis in (0, 1)] == pytest.approx([720, 60], abs=1)


def test_the_card_is_asked_for_what_the_sampling_says():
    head, hardware = made()
    head.trigger(SamplingSettings(64, 16, 500))
    assert hardware.started == (1024, 32_000)
    hardware.pass_time(0.0319)
    assert head.buffer() is None
    hardware.pass_time(0.0002)
    assert head.buffer().samples[:2].tolist() == [round(9000 * np.cos(0.7)), round(9000 * np.cos(2 * np.pi / 64 - 0.7))]
