"""Files that appear together: every step of the moves fails once, is killed once, gets a signal
once; the directories are the old ones or the new ones, never a mixture.
"""

import errno
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from insgnss.base.errors import UsageError
from insgnss.base.files import atomic_write
from insgnss.base.interrupts import ENDING, Terminated, raise_on_termination
from insgnss.base.scratch import ENGINE, OWNER, PREFIX, Scratch, scratch_directory, sweep
from insgnss.base.staging import is_vacant, staged, together

OLD = {"eo.json": "old", "report.json": "old", "Ori/a.xml": "old", "own.txt": "of the user"}
NEW = {"eo.json": "new", "report.json": "new", "Ori/a.xml": "new", "Ori/b.xml": "new"}
BESIDE = {"made/here/ppk.pos": "new"}


def write(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def content(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): path.read_text() for path in root.rglob("*") if path.is_file()
    }


def move(root: Path) -> None:
    """Two directories, one of which is not there, and a file."""
    with together() as staging:
        write(staging.tree(root / "out"), NEW)
        write(staging.tree(root / "made/here"), {"ppk.pos": "new"})
        atomic_write(root / "noise.toml", "new")


BEFORE = {f"out/{name}": text for name, text in OLD.items()} | {"noise.toml": "old"}
AFTER = {
    **BEFORE,
    **{f"out/{name}": text for name, text in NEW.items()},
    **BESIDE,
    "noise.toml": "new",
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write(tmp_path / "root", BEFORE)


STEPS = ("rename", "replace", "unlink", "mkdir", "rmdir")


class Faults:
    """Calls of the operating system, of which one fails or runs something first."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, at: int, action) -> None:
        self.calls, self.at, self.action = 0, at, action
        for name in STEPS:
            monkeypatch.setattr(os, name, self.counted(getattr(os, name)))

    def counted(self, function):
        def call(*values, **options):
            self.calls += 1
            if self.calls == self.at:
                self.action(*values)
            return function(*values, **options)

        return call


def full(*values) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), *map(str, values[:1]))


def test_the_files_are_moved_together_and_nothing_is_left_beside_them(root: Path) -> None:
    """Oracle: the names and texts that were written; files that are not written again stay."""
    move(root)
    assert content(root) == AFTER
    assert not [path for path in root.rglob("*") if path.name.startswith(".")]


EVERY = pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 5])


@EVERY
def test_every_step_of_the_moves_fails_once(root: Path, every: int) -> None:
    """Oracle: the files before and after; a step that is not reached ends the loop."""
    outcomes = set()
    for at in range(1, 100, every):
        write(root, BEFORE)
        with pytest.MonkeyPatch.context() as patch:
            faults = Faults(patch, at, full)
            try:
                move(root)
                error = None
            except UsageError as refusal:
                error = str(refusal)
                assert "No space left on device" in error
        sweep(root, root / "out")  # of a directory that could not be removed
        assert content(root) == (AFTER if error is None else BEFORE), (at, error)
        assert (root / "made").exists() == (error is None)
        assert not list(root.rglob(".*")), at
        outcomes.add(error is None)
        if faults.calls < at:
            break
        for name in ("out/Ori/b.xml", *BESIDE):
            (root / name).unlink(missing_ok=True)
        for name in ("made/here", "made"):
            if (root / name).exists():
                (root / name).rmdir()
    assert outcomes == {True, False}
    assert at > 15


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_within_the_moves_waits_until_they_are_over(root: Path, number: int) -> None:
    """Oracle: the files after, and the exception that the handler raises then."""
    handler = signal.getsignal(number)
    if handler is signal.SIG_IGN:
        pytest.skip("the signal is ignored here, as under nohup")
    raise_on_termination()
    try:
        with pytest.MonkeyPatch.context() as patch:
            done: list[str] = []

            def interrupt(*values: object) -> None:
                done.append(str(values[0]))
                os.kill(os.getpid(), number)

            real = os.rename

            def rename(*values: object) -> None:
                interrupt(*values)
                real(*values)

            patch.setattr(os, "rename", rename)
            with pytest.raises(KeyboardInterrupt):
                move(root)
            assert len(done) > 5
    finally:
        signal.signal(number, handler)
    assert content(root) == AFTER


def ended(root: Path) -> None:
    with together() as staging:
        write(staging.tree(root / "made/here"), {"ppk.pos": "new"})
        atomic_write(root / "noise.toml", "new")
        os.kill(os.getpid(), signal.SIGTERM)


def test_sigterm_before_the_moves_leaves_no_trace(root: Path) -> None:
    """Oracle: the files before; the exit code of a shell for a signal, 128 + its number."""
    before = signal.getsignal(signal.SIGTERM)
    raise_on_termination()
    try:
        with pytest.raises(Terminated) as end:
            ended(root)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert end.value.exit_code == 143
    assert content(root) == BEFORE
    assert not (root / "made").exists()


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import test_staging as t
import pytest
for at in range(1, 100, int(sys.argv[3])):
    root = t.write(Path(sys.argv[2]) / str(at), t.BEFORE)
    child = os.fork()
    if child == 0:
        with pytest.MonkeyPatch.context() as patch:
            faults = t.Faults(patch, at, lambda *values: os.kill(os.getpid(), signal.SIGKILL))
            t.move(root)
            os._exit(0)
    if os.waitpid(child, 0)[1] == 0:
        break
"""


@EVERY
def test_a_kill_within_the_moves_is_undone_by_the_next_run(tmp_path: Path, every: int) -> None:
    """Oracle: the files before, or after where the journal was gone; whichever of the directories
    the next run writes to.
    """
    command = [sys.executable, "-c", KILLED, str(Path(__file__).parent), str(tmp_path), str(every)]
    subprocess.run(command, check=True, timeout=60)
    mixed, outcomes = 0, []
    for killed in sorted(tmp_path.iterdir(), key=lambda path: int(path.name)):
        mixed += {k: v for k, v in content(killed).items() if "/." not in f"/{k}"} not in (
            BEFORE,
            AFTER,
        )
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            for name in ("out", ".") if int(killed.name) % 2 else (".", "out"):
                sweep(killed / name)
        assert all("files from before it were put back" in str(note.message) for note in notes)
        files = content(killed)
        assert files in (BEFORE, AFTER), killed.name
        assert not list(killed.rglob(".*")), killed.name
        outcomes.append(files == AFTER)
    assert mixed > 1  # else nothing had to be undone
    assert outcomes == sorted(outcomes)  # first the old files, then the new ones
    assert set(outcomes) == {True, False}


def test_only_directories_of_dead_runs_are_swept(tmp_path: Path) -> None:
    """Oracle: a lock that is held, one that is not, and names that are like these."""
    living = Scratch(tmp_path, ENGINE)
    for name in (f"{PREFIX}dead", f"{ENGINE}dead", ".insgnss", "of the user"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text("x")
    (tmp_path / f"{PREFIX}file").write_text("of the user")
    other = Scratch(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [living.path.name, other.path.name, ".insgnss", "of the user", f"{PREFIX}file"]
    )
    living.close()
    other.close()
    assert not living.path.exists()
    assert not other.path.exists()


def test_a_directory_is_vacant_but_for_what_dead_runs_left(tmp_path: Path) -> None:
    """Oracle: directories made here."""
    (tmp_path / "out" / f"{PREFIX}dead").mkdir(parents=True)
    assert is_vacant(tmp_path / "out")
    assert is_vacant(tmp_path / "missing")
    assert not is_vacant(tmp_path)


def test_a_block_within_another_one_moves_with_that(tmp_path: Path) -> None:
    """Oracle: an error after the inner block; a file that could not be written is left out."""

    def cut():
        yield "half"
        raise ValueError

    def inner() -> None:
        with together():
            with together():
                atomic_write(tmp_path / "a", "a")
            raise KeyError

    with pytest.raises(KeyError):
        inner()
    assert not list(tmp_path.iterdir())
    with together() as staging:
        with pytest.raises(ValueError):
            atomic_write(tmp_path / "a", cut())
        with staged(tmp_path / "b") as work:
            work.write_text("b")
        into = staging.tree(tmp_path / "new")
        with pytest.raises(ValueError):
            atomic_write(into / "c", cut())
    assert content(tmp_path) == {"b": "b"}


def test_what_is_in_the_way_is_refused_and_stays(tmp_path: Path) -> None:
    """Oracle: a directory in the place of a file, and the reverse."""
    (tmp_path / "out" / "eo.json").mkdir(parents=True)
    (tmp_path / "out" / "Ori").write_text("a file")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(UsageError, match=r"eo\.json: is a directory and in the way"):
        atomic_write(tmp_path / "out" / "eo.json", "x")
    for files in ({"eo.json": "x", "b": "x"}, {"Ori/a.xml": "x", "b": "x"}):
        with pytest.raises(UsageError, match="in the way"), together() as staging:
            write(staging.tree(tmp_path / "out"), files)
    with (
        pytest.raises(UsageError, match="is a file, a directory is written"),
        together() as staging,
    ):
        staging.tree(tmp_path / "out" / "Ori")
    assert sorted(tmp_path.rglob("*")) == before


def test_two_runs_do_not_move_at_the_same_time(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a lock of the directory that another run holds, by the system's own call."""
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr("insgnss.base.scratch.MOST_WAIT_S", 0.02)
    other = os.open(root, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    with pytest.raises(UsageError, match="another run has been moving its files there"):
        move(root)
    assert content(root) == BEFORE
    os.close(other)
    move(root)
    assert content(root) == AFTER


def test_files_within_a_scratch_directory_of_the_run_itself(tmp_path: Path) -> None:
    """Oracle: the files; its lock is the run's own."""
    with scratch_directory(tmp_path) as own:
        for text in ("old", "new"):
            with together():
                atomic_write(own / "a", text)
                atomic_write(own / "b", text)
            assert content(own) == {"a": text, "b": text}
    assert not list(tmp_path.iterdir())


def test_files_are_on_the_disk_before_they_take_names(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the calls of the operating system, by the numbers of the files afterwards."""
    flushed: set[int] = set()
    monkeypatch.setattr(os, "fsync", lambda number: flushed.add(os.fstat(number).st_ino))
    atomic_write(root / "one.txt", "new")
    assert flushed == {(root / "one.txt").stat().st_ino}
    move(root)
    assert {(root / name).stat().st_ino for name, text in AFTER.items() if text == "new"} < flushed


@pytest.mark.parametrize("locks", ["none", "fail"])
def test_without_locks_the_process_or_the_age_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locks: str
) -> None:
    """Oracle: which directories stay: of this process, of another machine, of one that ended long
    ago, and one that nobody changed for a year.
    """
    fcntl = pytest.importorskip("fcntl")

    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    if locks == "fail":
        monkeypatch.setattr(fcntl, "flock", flock)
    else:
        monkeypatch.setattr("insgnss.base.scratch.fcntl", None)
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], stdout=-1)
    host, number = os.uname().nodename, int(ended.stdout)
    for name, owner in {
        "dead": f"{host} {number}",
        "far": f"far {number}",
        "": "",
        "old": "",
    }.items():
        folder = tmp_path / f"{PREFIX}{name}"
        folder.mkdir()
        if owner:
            (folder / OWNER).write_text(owner)
    os.utime(tmp_path / f"{PREFIX}old", (1.0, 1.0))
    own = Scratch(tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {f"{PREFIX}far", PREFIX, own.path.name}
    sweep(tmp_path)
    assert own.path.is_dir()
    own.close()
    assert not own.path.exists()
