"""Files that appear together: all of them, or none.

They are written into scratch directories beside their places, on the same file system, and moved at
the end, while signals wait. After an error the moves are undone. After a kill each file is the old
one or the new one, and a mark (`base.output.unfinished`) names those that may not belong together:
whoever reads one of them is told.
"""

import errno
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from filecmp import cmp
from functools import partial
from pathlib import Path

from ..errors import UsageError, unwritten_error, writing
from ..inputs import forget_content
from ..interrupts import defer_signals
from .scratch import SCRATCH_NAME, Scratch, alone, sweep
from .unfinished import UNFINISHED_MARK, flush_directory, mark, marked_names

MOST_FLUSHED = 100  # files that are flushed one by one: each takes the disk some ms (chosen)
OTHER_DIRECTORY, FREE = "give another directory", "check permission and free space"
DISK_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)

Move = tuple[Path | None, Path]
"""Source and goal; without a source the goal is removed."""


class Staging:
    """Files and directories that `together` moves into their places.

    Attributes
    ----------
    scratch : dict
        The scratch directory of each directory that gets files or is made.
    """

    def __init__(self) -> None:
        self.scratch: dict[Path, Scratch] = {}
        self._files: dict[Path, Path] = {}  # goal: where it is written
        self._trees: dict[Path, Path] = {}  # target: the directory that stands for it
        self._stale: dict[Path, Path] = {}  # to be removed: the scratch that keeps it
        self._count = 0

    def file(self, goal: Path) -> Path:
        """Return where to write a file that goes to `goal`, whose directory must exist.

        A goal within a directory of `tree` is written at once: it is moved with that directory.
        """
        if self.holds(goal) or not (goal.is_file() or goal.is_dir() or not goal.exists()):
            return goal  # a device or a pipe holds nothing that could be kept
        if goal not in self._files:
            if not goal.parent.is_dir():
                number = errno.ENOTDIR if goal.parent.exists() else errno.ENOENT
                raise OSError(number, os.strerror(number), str(goal))
            self._count += 1
            folder = self._within(goal.parent) / f"file{self._count}"
            folder.mkdir()  # one each, as a library may write others beside its own
            self._files[goal] = folder / goal.name
        return self._files[goal]

    def tree(self, target: Path) -> Path:
        """Return an empty directory whose content goes into the directory `target`.

        The target is made with it where it is missing; files that are there already and are not
        written again stay.
        """
        if self.holds(target):
            target.mkdir(parents=True, exist_ok=True)
            return target
        if target not in self._trees:
            if target.exists() and not target.is_dir():
                raise UsageError(
                    f"{target}: is a file, but a directory must be written there; give another name"
                )
            above = next(d for d in (target, *target.absolute().parents) if d.exists())
            with writing(target, OTHER_DIRECTORY):
                new = self._within(above) / f"new{len(self._trees)}"
                new.mkdir()
            self._trees[target] = new
        return self._trees[target]

    def holds(self, path: Path) -> bool:
        """Tell whether a path is within a directory that `tree` returned, or is it."""
        return any(path == tree or tree in path.parents for tree in self._trees.values())

    def destination(self, path: Path) -> Path:
        """Return where `path`, within a directory of `tree`, goes to; others stay."""
        for target, tree in self._trees.items():
            if path == tree or tree in path.parents:
                return target / path.relative_to(tree)
        return path

    def written(self, goal: Path) -> Path:
        """Return where the content of `goal` stands before it is moved; others stay."""
        if goal in self._files:
            return self._files[goal]
        for target, tree in self._trees.items():
            if target in goal.parents and (path := tree / goal.relative_to(target)).exists():
                return path
        return goal

    def forget(self, goal: Path) -> None:
        """Leave a file out that could not be written."""
        written = self._files.pop(goal, goal if self.holds(goal) else None)
        if written is not None:
            written.unlink(missing_ok=True)

    def remove(self, goal: Path) -> None:
        """Remove a file with the moves, unless it is written again; none need be there."""
        goal = self.destination(goal)
        if goal.is_file():
            self._stale[goal] = self._within(goal.parent)

    def goals(self) -> tuple[Path, ...]:
        """Return the places of all files, those of directories in order of their names."""
        of_trees = (
            target / file.relative_to(tree)
            for target, tree in self._trees.items()
            for file in sorted(tree.rglob("*"))
            if file.is_file()
        )
        return (*of_trees, *self._files)

    def _within(self, directory: Path) -> Path:
        if directory not in self.scratch:
            self.scratch[directory] = Scratch(directory)
        return self.scratch[directory].path

    def moves(self) -> tuple[list[Path], list[Move]]:
        """Return the directories to be made, in order, and what goes where."""
        new_directories: list[Path] = []
        moves: list[Move] = []
        for target, tree in self._trees.items():
            missing = [d for d in (target, *target.parents) if not d.exists()]
            new_directories += [d for d in reversed(missing[1:]) if d not in new_directories]
            moves += _moves_into(tree, target)
        moves += [(file, goal) for goal, file in self._files.items() if file.exists()]
        goals = {goal for _, goal in moves}
        moves += [(None, goal) for goal in self._stale if goal not in goals]
        for source, goal in moves:
            if source is None:
                continue
            if goal.is_dir() and not source.is_dir():
                raise UsageError(
                    f"{goal}: is a directory where a file must be written; {OTHER_DIRECTORY}"
                )
            if source.is_dir() and os.path.lexists(goal):
                kind = "a symbolic link" if goal.is_symlink() else "a file"
                raise UsageError(
                    f"{goal}: is {kind} where a directory must be written; {OTHER_DIRECTORY}"
                )
        return new_directories, moves

    def changed(self) -> list[tuple[Path, Path]]:
        """Return where it is written and where it goes, of each file that replaces another one.

        Files that will be what they are, byte by byte, are none of these.
        """
        return [
            (source, goal)
            for source, goal in self.moves()[1]
            if source is not None and goal.is_file() and not cmp(source, goal, shallow=False)
        ]

    def commit(self) -> None:
        """Move everything into its place, or leave everything as it was.

        Raises
        ------
        UsageError
            Where something cannot be moved.
        """
        with defer_signals():
            new_directories, moves = self.moves()
            names: dict[Path, set[str]] = {}  # of what changes, by the directory that is there
            for _, goal in moves:
                if goal.parent.is_dir():
                    names.setdefault(goal.parent, set()).add(goal.name)
            undo: list[Callable[[], None]] = []
            with alone({*self.scratch, *names}):
                marks_before = {directory: marked_names(directory) or set() for directory in names}
                try:
                    _flush([source for source, _ in moves if source is not None])
                    marked_before = any(os.path.lexists(d / UNFINISHED_MARK) for d in names)
                    if len(moves) > 1 or new_directories or marked_before:
                        self._move(new_directories, moves, names, marks_before, undo)
                    elif moves:
                        _move_or_remove(*moves[0])
                    for directory, new in names.items():  # from here on the new files stand
                        self._mark(directory, marks_before[directory] - new)
                    for _, goal in moves:
                        forget_content(goal)
                except BaseException as error:
                    self._put_back(undo, error)
                    raise

    def _move(
        self,
        new_directories: list[Path],
        moves: list[Move],
        names: dict[Path, set[str]],
        marks_before: dict[Path, set[str]],
        undo: list[Callable[[], None]],
    ) -> None:
        """Mark what changes, make directories and move files; `undo` gets how to undo each step."""
        for directory, new in names.items():
            self._mark(directory, marks_before[directory] | new)
            undo.append(partial(self._mark, directory, marks_before[directory]))
        replaced = {goal for _, goal in moves if os.path.lexists(goal)}
        for directory in new_directories:  # one of them may be a goal, of a move that comes later
            directory.mkdir()
            undo.append(partial(_remove_empty, directory))
        for i, (source, goal) in enumerate(moves):
            if goal in replaced:
                aside = self._owner(source, goal) / f"old{i}"
                _keep(goal, aside, is_replaced=source is not None)
                undo.append(partial(os.replace, aside, goal))
            elif source is not None:
                undo.append(partial(_take_back, goal, source))
            if source is not None:
                os.replace(source, goal)
        for directory in names:
            flush_directory(directory)

    def _mark(self, directory: Path, names: set[str]) -> None:
        if names or os.path.lexists(directory / UNFINISHED_MARK):
            mark(directory, names, self._within(directory) if names else directory)

    def _owner(self, source: Path | None, goal: Path) -> Path:
        """Return the scratch directory on the file system of a goal."""
        if source is None:
            return self._stale[goal]
        return next(s.path for s in self.scratch.values() if s.path in source.parents)

    def _put_back(self, undo: list[Callable[[], None]], error: BaseException) -> None:
        """Undo what has been done, the last first; UsageError for an error of the system."""
        reason = getattr(error, "strerror", None) or str(error)
        path = getattr(error, "filename2", None) or getattr(error, "filename", None)
        message = f"{path or next(iter(self.scratch))}: cannot be written: {reason}"
        try:
            for step in reversed(undo):
                step()
        except OSError as second:
            for scratch in self.scratch.values():
                scratch.keep()
            kept = ", ".join(str(scratch.path) for scratch in self.scratch.values())
            raise UsageError(
                f"{message}; some earlier files could not be restored ({second.strerror}) and are "
                f"kept in {kept}"
            ) from None
        if isinstance(error, OSError):
            raise UsageError(f"{message}; all files are as they were") from None

    def close(self) -> None:
        """Remove the scratch directories."""
        with defer_signals():
            for scratch in self.scratch.values():
                scratch.close()


def _moves_into(source: Path, target: Path) -> list[Move]:
    """Return the moves that bring a directory into another one, new branches as a whole.

    A symbolic link below the target is not followed: it may lead to files of others.
    """
    if not os.path.lexists(target):
        return [(source, target)]
    moves: list[Move] = []
    for entry in sorted(source.iterdir()):
        goal = target / entry.name
        if SCRATCH_NAME.fullmatch(entry.name):
            continue
        merges = entry.is_dir() and goal.is_dir() and not goal.is_symlink()
        moves += _moves_into(entry, goal) if merges else [(entry, goal)]
    return moves


def _keep(goal: Path, aside: Path, is_replaced: bool) -> None:
    """Keep a file under a second name; in its place, too, where the next step replaces it there."""
    if not is_replaced:
        os.rename(goal, aside)
        return
    try:
        os.link(goal, aside, follow_symlinks=False)
    except (OSError, NotImplementedError):  # a file system without links, a file of others
        shutil.copy2(goal, aside, follow_symlinks=False)


def _take_back(goal: Path, source: Path) -> None:
    if os.path.lexists(goal) and not os.path.lexists(source):
        os.replace(goal, source)


def _remove_empty(directory: Path) -> None:
    with suppress(OSError):  # in use by now
        directory.rmdir()


def _flush(sources: list[Path]) -> None:
    """Have files on the disk before they take names, so that a power loss leaves no empty ones.

    Not of very many, such as copies of all images, where it would take as long as the rest.
    """
    files: list[Path] = []
    for source in sources:
        files += [path for path in source.rglob("*") if path.is_file()] if source.is_dir() else []
        files += [source] if source.is_file() else []
    for file in files if len(files) <= MOST_FLUSHED else ():
        descriptor = os.open(file, os.O_RDWR)
        try:
            os.fsync(descriptor)
        except OSError as error:
            if error.errno in DISK_FULL:
                raise
        finally:
            os.close(descriptor)


def _move_or_remove(source: Path | None, goal: Path) -> None:
    """Move one file or directory, which takes the place of a file at once, or remove a file."""
    with writing(goal, FREE):
        if source is None:
            os.unlink(goal)
        else:
            os.replace(source, goal)


_OPEN: ContextVar[Staging | None] = ContextVar("open staging", default=None)


@contextmanager
def together() -> Iterator[Staging]:
    """Give the staging whose files move when the block is over, and not after an error in it.

    A block within another one has the staging of that, and its files move with those.

    Raises
    ------
    UsageError
        Where a file cannot be written or moved, such as on a full disk.
    """
    if (outer := _OPEN.get()) is not None:
        yield outer
        return
    staging = Staging()
    token = _OPEN.set(staging)
    try:
        try:
            yield staging
        except OSError as error:
            if (path := _location(staging, error)) is None:
                raise
            raise unwritten_error(path, error, FREE) from None
        staging.commit()
    finally:
        _OPEN.reset(token)
        staging.close()


def _location(staging: Staging, error: OSError) -> Path | None:
    """Return what could not be written; None where the error is of something else."""
    candidates = (*staging._trees, *staging._files, *staging.scratch)
    path = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else None
    if path is not None and staging.holds(path):
        return staging.destination(path)
    return candidates[0] if error.errno in DISK_FULL and candidates else None


@contextmanager
def staged_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path for a library that writes a file itself; what it wrote there goes to `path`."""
    with together() as staging:
        with writing(path, "does the directory exist?"):
            temporary = staging.file(Path(path))
        yield temporary


def destination(path: Path) -> Path:
    """Return where a path goes to that may be within a directory of the open staging."""
    staging = _OPEN.get()
    return path if staging is None else staging.destination(path)


def written_path(path: Path) -> Path:
    """Return where a file stands now that the open staging may still have to move to `path`."""
    staging = _OPEN.get()
    return path if staging is None else staging.written(path)


def is_vacant(directory: Path) -> bool:
    """Tell whether a directory is missing or empty, but for what dead runs left in it."""
    sweep(directory)
    return not directory.exists() or (directory.is_dir() and not any(directory.iterdir()))
