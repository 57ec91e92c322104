"""Files that appear together: every step of the moves fails once, is killed once, gets a signal
once; the directories are the old ones or the new ones, or their readers are told.
"""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.base.files import atomic_write
from insgnss.base.interrupts import ENDING, Terminated, raise_on_termination
from insgnss.base.output.scratch import (
    PREFIX,
    Scratch,
    refuse_cut_off,
    scratch_directory,
    sweep,
)
from insgnss.base.output.staging import is_vacant, staged_path, together
from insgnss.base.output.unfinished import (
    UNFINISHED_MARK,
    is_unfinished,
    marked_names,
    refuse_unfinished,
)

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


STEPS = ("rename", "replace", "link", "unlink", "mkdir", "rmdir")


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
        for directory in (root, root / "out", root / "out/Ori"):  # one that could not be removed
            sweep(directory)
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

            real = os.replace

            def replace(*values: object) -> None:
                interrupt(*values)
                real(*values)

            patch.setattr(os, "replace", replace)
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


MARKED = {f"out/{name}" for name in NEW} | {"noise.toml", "made"}
"""What changes, by the directory that was there before."""


@EVERY
def test_after_a_kill_a_mixture_is_told(tmp_path: Path, every: int) -> None:
    """Oracle: each file is the old one or the new one, whole; where they are of both kinds, every
    file of the run is refused by readers, and files of others are not; the next run cures it.
    """
    command = [sys.executable, "-c", KILLED, str(Path(__file__).parent), str(tmp_path), str(every)]
    subprocess.run(command, check=True, timeout=60)
    outcomes = []
    for killed in sorted(tmp_path.iterdir(), key=lambda path: int(path.name)):
        files = {k: v for k, v in content(killed).items() if "/." not in f"/{k}"}
        assert set(BEFORE) <= set(files), killed.name
        assert all(text in (BEFORE.get(name), AFTER[name]) for name, text in files.items())
        told = {name for name in (*files, "made") if is_unfinished(killed / name)}
        assert "out/own.txt" not in told
        if files not in (BEFORE, AFTER):
            assert told >= MARKED & set(files), killed.name
            with pytest.raises(InputError, match=r"killed while it moved its files into .*again"):
                refuse_unfinished(killed / "out/eo.json")
        outcomes.append("told" if told else files == AFTER)
        move(killed)
        assert content(killed) == AFTER, killed.name
        assert not list(killed.rglob(".*")), killed.name
    order = [False, "told", True]
    assert [o for i, o in enumerate(outcomes) if i == 0 or outcomes[i - 1] != o] == order


def test_a_mark_keeps_names_until_they_are_written_anew(root: Path) -> None:
    """Oracle: the names; one that is gone is not named by what is read."""
    (root / "out" / UNFINISHED_MARK).write_text('["eo.json", "old.csv", "report.json"]')
    atomic_write(root / "out" / "own.txt", "another export")
    assert marked_names(root / "out") == {"eo.json", "old.csv", "report.json"}
    atomic_write(root / "out" / "eo.json", "new")
    assert [is_unfinished(root / "out" / name) for name in ("eo.json", "report.json")] == [0, 1]
    move(root)
    assert marked_names(root / "out") == {"old.csv"}


@pytest.mark.parametrize("planted", ["{", "[" * 100_000, "5", "null"])
def test_what_others_planted_for_a_mark_refuses_and_does_nothing_else(
    root: Path, planted: str
) -> None:
    """Oracle: the files; the link is replaced and not followed."""
    (root / "victim").write_text(planted)
    (root / "out" / UNFINISHED_MARK).symlink_to(root / "victim")
    assert marked_names(root / "out") is None
    assert is_unfinished(root / "out" / "eo.json")
    move(root)
    assert content(root) == AFTER | {"victim": planted}
    assert not is_unfinished(root / "out" / "eo.json")


def test_a_file_beside_a_mark_that_cannot_be_rewritten_stays_as_it_was(root: Path) -> None:
    """Oracle: the message, and the file; a directory stands where the mark should go."""
    (root / "out" / UNFINISHED_MARK).mkdir()
    with pytest.raises(UsageError, match="all files are as they were"):
        atomic_write(root / "out" / "eo.json", "new")
    assert content(root) == BEFORE


def planted_scratch(directory: Path, victim: Path) -> None:
    """What was believed once: a journal that moves files, a lead to a directory to be removed."""
    for name in ("dead", "run-dead1234", "run-"):
        folder = directory / f".insgnss-{name}"
        folder.mkdir(mode=0o700)
        victim.mkdir(exist_ok=True)
        (victim / "precious").write_text("of the user")
        moves = [[os.path.relpath(victim, folder) + "/new", f"{victim}/precious", None]]
        (folder / "journal.json").write_text(json.dumps({"made": [], "moves": moves}))
        (folder / "lead").write_text(json.dumps(os.path.relpath(victim, folder)))
        (folder / "owner").write_text("nowhere 1")
        (folder / "link").symlink_to(victim)


def test_planted_scratch_directories_have_no_effect(root: Path) -> None:
    """Oracle: the files of a directory that they lead to."""
    for directory in (root, root / "out"):
        planted_scratch(directory, root.parent / "victim")
    (root / f"{PREFIX}12345678").symlink_to(root.parent / "victim")
    move(root)
    assert content(root.parent / "victim") == {"precious": "of the user"}
    assert {k: v for k, v in content(root).items() if "/." not in f"/{k}"} == AFTER


def test_links_below_an_output_directory_are_not_followed(root: Path) -> None:
    """Oracle: the files of the directory and of the file that the links lead to."""
    victim = write(root.parent / "victim", {"a.xml": "of the user", "eo.json": "of the user"})
    before = content(victim)
    (root / "out" / "eo.json").unlink()
    (root / "out" / "eo.json").symlink_to(victim / "eo.json")
    move(root)
    assert content(victim) == before
    assert (root / "out" / "eo.json").read_text() == "new"
    for path in (root / "out" / "Ori").iterdir():
        path.unlink()
    (root / "out" / "Ori").rmdir()
    (root / "out" / "Ori").symlink_to(victim)
    with pytest.raises(
        UsageError, match="Ori: is a symbolic link where a directory must be written"
    ):
        move(root)
    assert content(victim) == before


def test_only_directories_of_dead_runs_are_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: a lock that is held, one that is not, names that are like these, and directories
    that are open to others, of another user or links.
    """
    living = Scratch(tmp_path)
    stay = [".insgnss-backup", ".insgnss", "of the user", f"{PREFIX}UPPER678", f"{PREFIX}open5678"]
    for name in (f"{PREFIX}dead5678", *stay):
        (tmp_path / name).mkdir(mode=0o755 if "open" in name else 0o700)
        (tmp_path / name / "file").write_text("x")
    (tmp_path / f"{PREFIX}link5678").symlink_to(tmp_path / "of the user")
    (tmp_path / f"{PREFIX}file5678").write_text("of the user")
    stay += [living.path.name, f"{PREFIX}link5678", f"{PREFIX}file5678"]
    with monkeypatch.context() as patch:
        patch.setattr(os, "geteuid", lambda: os.getuid() + 1)
        sweep(tmp_path)
    assert (tmp_path / f"{PREFIX}dead5678").exists()
    other = Scratch(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*stay, other.path.name}
    assert (tmp_path / "of the user" / "file").exists()
    living.close()
    other.close()
    assert not living.path.exists()
    assert not other.path.exists()


@pytest.mark.parametrize("room", [0, 1000, None])
def test_what_another_program_wrote_on_a_full_disk_is_refused(
    tmp_path: Path, room: int | None
) -> None:
    """Oracle: a limit to the size of files, as a full disk has it; the file stays as it was."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "forward.pos"
    path.write_bytes(b"x" * 5000)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    limit = before[0] if room is None else 5000 + room
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        if room is None:
            refuse_cut_off(path)
        else:
            with pytest.raises(OSError, match="large"):
                refuse_cut_off(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == b"x" * 5000


def test_a_directory_is_vacant_but_for_what_dead_runs_left(tmp_path: Path) -> None:
    """Oracle: directories made here."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / f"{PREFIX}dead5678").mkdir(0o700)
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
        with staged_path(tmp_path / "b") as work:
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
    with pytest.raises(UsageError, match=r"eo\.json: is a directory where a file must be written"):
        atomic_write(tmp_path / "out" / "eo.json", "x")
    for files in ({"eo.json": "x", "b": "x"}, {"Ori/a.xml": "x", "b": "x"}):
        with (
            pytest.raises(UsageError, match=r"where a (file|directory) must be written"),
            together() as staging,
        ):
            write(staging.tree(tmp_path / "out"), files)
    with (
        pytest.raises(UsageError, match="is a file, but a directory must be written"),
        together() as staging,
    ):
        staging.tree(tmp_path / "out" / "Ori")
    assert sorted(tmp_path.rglob("*")) == before


def test_two_runs_do_not_move_at_the_same_time(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a lock of the directory that another run holds, by the system's own call."""
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr("insgnss.base.output.scratch.MOST_WAIT_S", 0.02)
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


def test_what_cannot_be_put_back_is_kept_and_named(root: Path) -> None:
    """Oracle: the old text, in the directory that the message names; no run sweeps it."""
    with pytest.MonkeyPatch.context() as patch:
        replace, calls = os.replace, 0

        def failing(*values: object) -> None:
            nonlocal calls
            calls += 1
            if calls > 6:
                full(*values)
            replace(*values)

        patch.setattr(os, "replace", failing)
        with pytest.raises(
            UsageError, match=r"some earlier files could not be restored .* in .*insgnss-kept-"
        ):
            move(root)
    sweep(root)
    sweep(root / "out")
    kept = [path for path in root.rglob("old*") if "insgnss-kept-" in str(path)]
    assert {path.read_text() for path in kept if path.is_file()} == {"old"}
    assert is_unfinished(root / "out" / "eo.json")


@pytest.mark.parametrize("locks", ["none", "fail"])
def test_without_locks_the_age_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locks: str
) -> None:
    """Oracle: which directories stay: of this run, and one that somebody changed today."""
    fcntl = pytest.importorskip("fcntl")

    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    if locks == "fail":
        monkeypatch.setattr(fcntl, "flock", flock)
    else:
        monkeypatch.setattr("insgnss.base.output.scratch.fcntl", None)
    for name in ("new45678", "old45678"):
        (tmp_path / f"{PREFIX}{name}").mkdir(0o700)
    os.utime(tmp_path / f"{PREFIX}old45678", (1.0, 1.0))
    scratch = Scratch(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {f"{PREFIX}new45678", scratch.path.name}
    sweep(tmp_path)
    assert scratch.path.is_dir()
    scratch.close()
    assert not scratch.path.exists()
