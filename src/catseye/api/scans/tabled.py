"""Base of the results of scans: tables, files and inputs."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from catseye.aliases import Progress
from catseye.api.result import Result, quantities

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.scans.files import Sources


@dataclass(frozen=True, eq=False, repr=False)
class TabledResult(Result):
    """Result whose tables are those of its files.

    COMMAND  words of its command
    hashes   SHA-256 of each file read, by its name
    read     files that were read
    """

    COMMAND: ClassVar[str] = ""
    hashes: dict[str, str] = field(default_factory=dict, kw_only=True)
    read: tuple[Path, ...] = field(default=(), kw_only=True)

    def _sources(self) -> "Sources":
        """Tables of the result, and what each is made from, the main one first."""
        raise NotImplementedError

    def tables(self) -> "dict[str, QTable]":
        """Tables of `--out` with their units, under the stems of their files."""
        return {
            table.file.removesuffix(".csv"): quantities(table.quantities(source, [c.name for c in table.columns]))
            for table, source in self._sources().items()
        }

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `--out`: tables, figures, JSON, provenance."""
        from catseye.gateways.scans.files import write_scan

        write_scan(
            directory,
            f"catseye {self.COMMAND}",
            sources=self._sources(),
            answer=self.to_object(),
            figures=self.figures(),
            hashes=self.hashes,
        )

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` leaves alone."""
        return self.read

    def rows(self) -> Any:
        """Lines of the terminal, after the sentences."""
        return ()
