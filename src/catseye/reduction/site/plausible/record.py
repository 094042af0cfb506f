"""A record that cannot be right."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ImplausibleRecord:
    """Record that no site has.

    where      file and key: "weather.csv: pressure_mb"
    text       for the user: value, limit, likely mistake, and what was done or is to do
    quantity   that it states: "pressure"
    owners     names of stations, rangers or targets
    fatal      True if nothing else gives the quantity, so that the campaign cannot be reduced
    """

    where: str
    text: str
    quantity: str
    owners: tuple[str, ...]
    fatal: bool = False

    @property
    def note(self) -> str:
        """Record in one line.

        >>> ImplausibleRecord("weather.csv: humidity_pct", "WX1 reads 0 % throughout", "humidity", ("WX1",)).note
        'weather.csv: humidity_pct: WX1 reads 0 % throughout'
        """
        return f"{self.where}: {self.text}"


def listed(names: tuple[str, ...], most: int = 6) -> str:
    """Names in one text, the first ones of many.

    >>> listed(("WX1", "WX2")), listed(tuple("abcdefgh"))
    ('WX1 and WX2', 'a, b, c, d, e, f and 2 more')
    """
    if len(names) > most:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
