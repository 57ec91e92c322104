"""A directory whose files appear whole or not at all."""

import shutil
import tempfile
from pathlib import Path
from types import TracebackType

PREFIX = ".insgnss-"  # of the directories that are gone when a run is over


class Staging:
    """A context that gives a directory within a target, whose files move into the target together.

    The target is made with it where it is not there. The directory is gone at the end, and after an
    error the target too, where it was made here and is empty.

    Parameters
    ----------
    target : Path
        Where the files are to go.
    """

    def __init__(self, target: Path) -> None:
        self.target = target

    def __enter__(self) -> "Staging":
        self.made = [d for d in (self.target, *self.target.parents) if not d.exists()]
        self.target.mkdir(parents=True, exist_ok=True)
        self.directory = Path(tempfile.mkdtemp(prefix=PREFIX, dir=self.target))
        return self

    def moves(self) -> list[tuple[Path, Path]]:
        """Return each file of the staging directory and where it goes."""
        return [(file, self.target / file.name) for file in sorted(self.directory.iterdir())]

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        shutil.rmtree(self.directory, ignore_errors=True)
        for directory in self.made if kind is not None else ():
            if directory.exists() and not any(directory.iterdir()):
                directory.rmdir()
