"""Hardware that a card-and-chips head could be wired to: an LM628 seen from its two ports, a card, a clock, a panel."""

import numpy as np

from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND
from catseye.ranger.motion_units import SAMPLE_TIME
from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.kernel import CompiledAxes
from catseye.simulator.servo.motion_chip import POSITION, VELOCITY, MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor

RESET, DFH, SIP, STT, UDF, PORT8 = 0x00, 0x02, 0x03, 0x01, 0x04, 0x05
WORDS = {0x1A: 1, 0x1B: 1, 0x1D: 1}  # of data that a command takes; LFIL and LTRJ say it in their first
LFIL, LTRJ = 0x1E, 0x1F
ANSWERS = {0x08: 4, 0x09: 4, 0x0A: 4, 0x0C: 2}
BUSY_LOOKS = 2  # at the status byte after each command and each word


class ByteChip:
    """The chip's bus side as [TEXAS13] pages 14 to 24 tell it, around `MotionChip` on an axis.

    What is written or read while it is busy is lost, and noted in `lost`.
    """

    def __init__(self, design: AxisDesign, angle: float):
        self.axis = ServoAxis(MotionChip(), Motor(design, angle))
        self._passed = 0.0
        self.lost, self.heard = 0, []
        self._power_on()

    def _power_on(self):
        motor, enabled = self.axis.motor, self.axis.enabled
        self.axis = ServoAxis(MotionChip(), motor)
        self.axis.axis(enabled)
        self._busy, self._command, self._bytes, self._out = BUSY_LOOKS, None, [], []
        self._flags = 0x44  # after a reset: breakpoint and trajectory complete
        self._error = 0
        self._seen_index = self._seen_error = False
        self._stop = None

    def pass_time(self, seconds):
        self._passed += seconds / SAMPLE_TIME
        axes = CompiledAxes([self.axis])
        axes.skip(int(self._passed))
        axes.axis(0)
        self._passed %= 1.0
        chip = self.axis.chip
        self._flags |= (chip.excessive_error and 0x20) | (chip.index_found and 0x08)
        self._flags |= chip.trajectory_complete and 0x04

    # The ports ------------------------------------------------------------------------------------------------------

    def status(self):
        busy = self._busy > 0
        self._busy -= busy
        return (self.axis.chip.motor_off and 0x80) | (self._flags & 0x7C) | self._error << 1 | busy

    def command(self, code):
        if self._busy:
            self.lost += 1
            return
        self.heard.append(code)
        self._busy, self._bytes, self._command, self._out = BUSY_LOOKS, [], code, []
        if code in ANSWERS:
            self._out = list((self._answer(code) % (1 << 8 * ANSWERS[code])).to_bytes(ANSWERS[code], "big"))
        elif code not in WORDS and code not in (LFIL, LTRJ):
            self._do(code)

    def write(self, byte):
        if self._busy or self._command is None:
            self.lost += 1
            return
        self.heard.append(byte)
        self._bytes.append(byte)
        if len(self._bytes) % 2 == 0:
            self._busy = BUSY_LOOKS
            words = [high << 8 | low for high, low in zip(self._bytes[::2], self._bytes[1::2], strict=True)]
            if len(words) == 1 + self._more(words[0]):
                self._take(self._command, words)
                self._command = None

    def read(self):
        if self._busy or not self._out:
            self.lost += 1
            return 0xFF
        byte = self._out.pop(0)
        if len(self._out) % 2 == 0:
            self._busy = BUSY_LOOKS
        return byte

    # Behind them ----------------------------------------------------------------------------------------------------

    def _more(self, control):
        if self._command == LFIL:
            return (control & 0x0F).bit_count()
        if self._command == LTRJ:
            assert not control & 0x15, "relative values are not simulated"
            return 2 * (control & 0x2A).bit_count()
        return 0

    def _do(self, code):
        chip = self.axis.chip
        if code == RESET:
            self._power_on()
        elif code == DFH:
            chip.define_home()
        elif code == SIP:
            chip.find_index()
        elif code == UDF:
            chip.update_filter()
        elif code == STT:
            if self._stop is not None:
                chip.stop(self._stop)
                self._stop = None
            else:
                self._error |= int(not chip.start())  # latched until RSTI
        else:
            assert code == PORT8, f"command {code:#04x} is not simulated"

    def _take(self, code, words):
        chip, control = self.axis.chip, words[0]
        if code == LFIL:
            values = iter(words[1:])
            given = {name: next(values) for name, bit in (("kp", 8), ("ki", 4), ("kd", 2), ("il", 1)) if control & bit}
            chip.load_filter(interval=control >> 8, **given)
        elif code == LTRJ:
            longs = [high << 16 | low for high, low in zip(words[1::2], words[2::2], strict=True)]
            values = iter((n + 2**31) % 2**32 - 2**31 for n in longs)
            order = (("acceleration", 0x20), ("velocity", 0x08), ("position", 0x02))
            given = {name: next(values) for name, bit in order if control & bit}
            mode, direction = "velocity" if control & 0x800 else "position", 1 if control & 0x1000 else -1
            chip.load_trajectory(mode=mode, direction=direction, **given)
            self._stop = {0x100: "off", 0x200: "abrupt", 0x400: "smooth"}.get(control & 0x700)
        elif code == 0x1D:
            self._flags &= control
            self._error &= control >> 1
        else:
            chip.limit_error(control, stop=code == 0x1A)

    def _answer(self, code):
        chip = self.axis.chip
        if code == 0x0C:
            signals = self.status_flags() | chip.seeking | chip.on_target << 10 | chip.stops_on_error << 9 | 1 << 8
            return signals | (chip.mode == VELOCITY) << 11 | (chip.mode != POSITION and chip.direction > 0) << 12
        return {0x08: chip.desired_position, 0x09: chip.index_position, 0x0A: chip.actual_position}[code]

    def status_flags(self):
        return (self.axis.chip.motor_off and 0x80) | (self._flags & 0x7C) | self._error << 1


class Hardware:
    """All of a head's: two chips, card, clock and panel; time passes when told."""

    def __init__(self, stands=(300.0, -200.0), day=52889):
        turn = 2 * np.pi / 100_000
        self.chips = [ByteChip(AxisDesign(low_stop=-0.5, high_stop=0.6), count * turn) for count in stands]
        self.ns, self.volts_per_code = day * PER_DAY, 10.0 / 32768.0
        self._words, self._ready_at, self.started = 0, None, None
        self.lit = False

    def pass_time(self, seconds):
        self.ns += round(seconds * PER_SECOND)
        for chip in self.chips:
            chip.pass_time(seconds)

    # card
    def begin(self, words, rate_hz):
        self._words, self._ready_at = words, self.ns + round(words / rate_hz * PER_SECOND)
        self.started = (words, rate_hz)

    def done(self):
        return self._ready_at is not None and self.ns >= self._ready_at

    def read(self):
        assert self.done()
        return [round(9000 * np.cos(2 * np.pi * j / 64 - 0.7)) for j in range(self._words)]

    # panel
    def amplifier(self, axis, on):
        self.chips[axis].axis.axis(on)

    def laser(self, on):
        self.lit = on

    def volts(self):
        return {"+5": 5.01}

    def celsius(self):
        return 25.5


class IrigClock:
    """The clock card of a `Hardware`."""

    def __init__(self, hardware):
        self.hardware, self.offset = hardware, 0

    def read(self):
        return divmod(self.hardware.ns + self.offset, PER_DAY)

    def set(self, day, nanoseconds):
        self.offset = day * PER_DAY + nanoseconds - self.hardware.ns

    def locked(self):
        return True
