"""A flight file drafted from an inspection: every key with its evidence, unsure ones as comments.

Files are overwritten only on request; noise model, picture and page go beside the flight file, all
of them or none, so that it never names a file that does not exist.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...base.errors import UsageError
from ...base.files import atomic_write
from ...base.output.staging import together
from ...base.wording import relative, toml
from ...navigation.noise_model.model import NoiseModel, comment_lines, write_noise_model

NOISE_FILE, PICTURE_FILE, PAGE_FILE = "imu_noise.toml", "recognition.png", "inspect.html"
WRAPPED = 100  # a list longer than this takes a line an item


@dataclass(frozen=True)
class Entry:
    """One key of a flight file with the evidence for its value; an unsure one becomes a comment.

    Lines of a drawing stand above the evidence, as comments.
    """

    key: str
    value: Any
    why: str = ""
    sure: bool = True
    drawing: tuple[str, ...] = ()


@dataclass
class Draft:
    """Tables of a flight file in order, with noise model, picture (PNG) and page (HTML) beside it.

    The top table has an empty name.
    """

    tables: dict[str, list[Entry]] = field(default_factory=dict)
    noise: NoiseModel | None = None
    noise_why: tuple[str, ...] = ()
    picture: bytes | None = None
    page: str | None = None
    remarks: tuple[str, ...] = ()

    def add(
        self,
        table: str,
        key: str,
        value: Any,
        why: str = "",
        sure: bool = True,
        drawing: tuple[str, ...] = (),
    ) -> None:
        """Append an entry to a table."""
        self.tables.setdefault(table, []).append(Entry(key, value, why, sure, drawing))

    def value(self, table: str, key: str) -> Any:
        """Return the value of a key that was added, unsure ones as well; None for another."""
        return next((e.value for e in self.tables.get(table, []) if e.key == key), None)

    def text(self, folder: Path) -> str:
        """Return the text of the flight file for a path in `folder`.

        Paths below it are written relative to it, others in full.
        """
        lines: list[str] = []
        for remark in self.remarks:
            lines += comment_lines(remark)
        for table, entries in self.tables.items():
            lines += [""] if lines else []
            lines += [f"[{table}]"] if table else []
            for entry in entries:
                lines += _entry_lines(entry, folder)
        return "\n".join(lines) + "\n"


def write_draft(draft: Draft, path: Path, force: bool = False) -> list[Path]:
    """Write flight file, noise model, picture and page; return the files written.

    Beside another name than flight.toml the others bear it as well.

    Parameters
    ----------
    draft : Draft
    path : Path
        Of the flight file, or the directory that shall hold flight.toml.
    force : bool
        Whether to overwrite existing files.

    Raises
    ------
    UsageError
        Where one of them exists already and `force` is not given, and where they cannot be written.
    """
    path = path / "flight.toml" if path.is_dir() else path
    parts: dict[Path, Any] = {}
    prefix = "" if path.stem == "flight" else f"{path.stem}_"
    if draft.noise is not None:
        parts[path.with_name(prefix + NOISE_FILE)] = draft.noise
    if draft.picture is not None:
        parts[path.with_name(prefix + PICTURE_FILE)] = draft.picture
    if draft.page is not None:
        parts[path.with_name(prefix + PAGE_FILE)] = draft.page
    parts[path] = draft.text(path.absolute().parent).replace(
        f"noise = {toml(NOISE_FILE)}", f"noise = {toml(prefix + NOISE_FILE)}"
    )
    existing = [str(file) for file in parts if file.exists()]
    if existing and not force:
        verb = "exists" if len(existing) == 1 else "exist"
        raise UsageError(
            f"{', '.join(existing)} already {verb}, so nothing was written; give another path "
            "with --write FLIGHT, or overwrite with --force"
        )
    with together():
        for file, content in parts.items():
            if isinstance(content, NoiseModel):
                write_noise_model(content, file, draft.noise_why)
            else:
                atomic_write(file, content)
    return list(parts)


def _entry_lines(entry: Entry, folder: Path) -> Iterator[str]:
    yield from (f"# {line}".rstrip() for line in entry.drawing)
    yield from comment_lines(entry.why)
    value = entry.value
    if isinstance(value, Path):
        value = _relative(value, folder)
    elif isinstance(value, list):
        value = [_relative(item, folder) if isinstance(item, Path) else item for item in value]
    text = f"{entry.key} = {toml(value, WRAPPED)}"
    yield text if entry.sure else f"# {text}"


def _relative(path: Path, folder: Path) -> str:
    """Path relative to `folder` where it lies below it or below its parent; in full otherwise."""
    full = Path(os.path.abspath(path))
    if full.is_relative_to(folder):
        return full.relative_to(folder).as_posix()
    from_folder = relative(full, folder)
    return Path(from_folder).as_posix() if from_folder.count("..") == 1 else full.as_posix()
