"""Driver of one LM628 motion chip through its two ports, byte by byte.

Source: [TEXAS13] LM628/LM629 data sheet SNVS781C, pages 14 to 24: codes, control words, tables 5 to 7. Written from it
and tried on a simulated chip only (tests/examples/byte_chip.py): first try it with the amplifier off.
"""

from typing import Literal, Protocol

from catseye.errors import InputError

RESET, PORT8, DFH, SIP, STT, UDF = 0x00, 0x05, 0x02, 0x03, 0x01, 0x04
LPES, RSTI, LFIL, LTRJ = 0x1A, 0x1D, 0x1E, 0x1F
RDDP, RDIP, RDRP, RDSIGS = 0x08, 0x09, 0x0A, 0x0C
BUSY, COMMAND_ERROR = 0x01, 0x02  # of the status byte
SEEKS_INDEX, EXCESSIVE_ERROR, MOTOR_OFF, ON_TARGET = 0x0001, 0x0020, 0x0080, 0x0400  # of the signals register
POSITION_GIVEN, VELOCITY_GIVEN, ACCELERATION_GIVEN = 0x0002, 0x0008, 0x0020  # of LTRJ's control word, all absolute
STOP_ABRUPTLY, STOP_SMOOTHLY, VELOCITY_MODE, FORWARD = 0x0200, 0x0400, 0x0800, 0x1000
ALL_OF_THE_FILTER = 0x000F  # of LFIL's control word: kp, ki, kd, il
KEEP_ALL = 0x007E  # of RSTI: a flag whose bit is zero is cleared
LOOKS = 2000  # at the status byte; a chip is busy for some 100 us, and 1.5 ms after a reset


class Port(Protocol):
    """One chip on the bus: /CS of it low, PS low for the command port, PS high for the data port."""

    def status(self) -> int:
        """Read the command port: the status byte."""
        ...

    def command(self, code: int) -> None:
        """Write the command port."""
        ...

    def write(self, byte: int) -> None:
        """Write the data port."""
        ...

    def read(self) -> int:
        """Read the data port."""
        ...


class Lm628:
    """A chip. Positions are counts, velocities 1/65536 count a sample, accelerations 1/65536 count a sample squared.

    port   where it answers
    name   for messages

    Every method raises InputError where the chip stays busy.
    """

    def __init__(self, port: Port, name: str):
        self._port, self._name = port, name

    def reset(self) -> None:
        """As when power comes on: motor off, gains zero, home where it stands; the 8-bit converter, all flags clear."""
        self._command(RESET)
        self._command(PORT8)
        self._clear(0)

    def actual(self) -> int:
        """Where the encoder is."""
        return _signed(self._ask(RDRP, 4), 4)

    def desired(self) -> int:
        """Where the profile is, whole counts."""
        return _signed(self._ask(RDDP, 4), 4)

    def index(self) -> int:
        """Where the index was seen last."""
        return _signed(self._ask(RDIP, 4), 4)

    def signals(self) -> int:
        """The signals register."""
        return self._ask(RDSIGS, 2)

    def seek_index(self) -> None:
        """Keep the position of the next index pulse; until then `signals` has SEEKS_INDEX."""
        self._command(SIP)

    def define_home(self) -> None:
        """Zero is here."""
        self._command(DFH)

    def stop_on_error(self, counts: int) -> None:
        """Position error past which the motor goes off."""
        self._command(LPES)
        self._words(counts)

    def load_filter(self, kp: int, ki: int, kd: int, limit: int, interval: int) -> None:
        """All five values, at work at once."""
        self._command(LFIL)
        self._words(interval << 8 | ALL_OF_THE_FILTER, kp, ki, kd, limit)
        self._command(UDF)

    def move(self, position: int, velocity: int, acceleration: int) -> bool:
        """Begin a trapezoidal move; False where the acceleration would change during another."""
        control = POSITION_GIVEN | VELOCITY_GIVEN | ACCELERATION_GIVEN
        return self._start(control, *_long(acceleration), *_long(velocity), *_long(position))

    def run(self, velocity: int, acceleration: int) -> bool:
        """Run at a velocity with its sign until told otherwise; False as above."""
        control = VELOCITY_MODE | VELOCITY_GIVEN | ACCELERATION_GIVEN | (FORWARD if velocity >= 0 else 0)
        return self._start(control, *_long(acceleration), *_long(abs(velocity)))

    def stop(self, how: Literal["smooth", "abrupt"]) -> None:
        """Stop with the acceleration of the move, or at once."""
        self._start(STOP_SMOOTHLY if how == "smooth" else STOP_ABRUPTLY)

    def _start(self, *words: int) -> bool:
        self._clear(KEEP_ALL & ~(COMMAND_ERROR | EXCESSIVE_ERROR))
        self._command(LTRJ)
        self._words(*words)
        self._command(STT)
        return not self._ready() & COMMAND_ERROR

    def _clear(self, keep: int) -> None:
        self._command(RSTI)
        self._words(keep)

    def _ready(self) -> int:
        """The status byte of a chip that is not busy: what is written to a busy one is lost."""
        for _ in range(LOOKS):
            status = self._port.status()
            if not status & BUSY:
                return status
        raise InputError(f"motion chip {self._name}: busy at {LOOKS} looks (expected ready: power, clock, address)")

    def _command(self, code: int) -> None:
        self._ready()
        self._port.command(code)

    def _words(self, *words: int) -> None:
        for word in words:
            self._ready()
            self._port.write(word >> 8 & 0xFF)
            self._port.write(word & 0xFF)

    def _ask(self, code: int, count: int) -> int:
        self._command(code)
        value = 0
        for k in range(count):
            if k % 2 == 0:
                self._ready()
            value = value << 8 | self._port.read() & 0xFF
        return value


def _long(value: int) -> tuple[int, int]:
    """A 32-bit number as two words, the higher first."""
    return value >> 16 & 0xFFFF, value & 0xFFFF


def _signed(value: int, size: int) -> int:
    half = 1 << (8 * size - 1)
    return (value + half) % (2 * half) - half
