"""What `insgnss batch` is asked for; standard library only, for the command line."""

from dataclasses import dataclass
from pathlib import Path

from ...io.options.kinds import Checked
from ...io.options.schema import argument


@dataclass(frozen=True)
class SeasonRequest(Checked):
    """What is asked of a season.

    Parameters
    ----------
    sources : tuple of str
        Directories, patterns, flight files, tables of flights.
    out : Path or None
        Directory of table and page; None: the one directory that was named, else the working one.
    workers : int or None
        Most of these processes; None: one a processor, as far as memory allows.
    scheduler : str or None
        Address of a Dask scheduler; None: processes of this machine.
    again : bool
        Whether flights are processed although their products are in force.
    force : bool
        Whether results of other measurements, and a page of others, are overwritten.
    parquet : bool
        Whether season.parquet is written as well.
    """

    sources: tuple[str, ...] = argument(
        ...,
        "flight files, directories (every flight.toml below them), patterns in quotation marks, "
        "or CSV tables with the column flight and optional columns name and out",
        cli="FLIGHTS",
    )
    out: Path | None = argument(
        None,
        "directory of season.csv and index.html (default: the one directory given, otherwise the "
        "working directory); the products of a flight go where its flight file or the column out "
        "of the table says, below the table or below DIR",
        metavar="DIR",
    )
    workers: int | None = argument(
        None, "most flights side by side", low=1, usual="one a processor, as far as memory allows"
    )
    scheduler: str | None = argument(
        None,
        "address of a Dask scheduler that runs the flights in place of this machine, "
        "tcp://HOST:8786 (needs Dask)",
        metavar="ADDRESS",
    )
    again: bool = argument(False, "process also the flights whose products are up to date")
    force: bool = argument(
        False,
        "overwrite results of other measurements, and a page or table that another program wrote",
    )
    parquet: bool = argument(False, "write season.parquet as well (needs pyarrow)")

    @property
    def directory(self) -> Path:
        """Where table and page go."""
        if self.out is not None:
            return self.out
        only_source = Path(self.sources[0]) if len(self.sources) == 1 else Path(".")
        return only_source if only_source.is_dir() else Path(".")
