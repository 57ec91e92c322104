"""The one door for files that are read: what is refused, and what has to stay as it was."""

import hashlib
import os
import time
from pathlib import Path

import pytest

from insgnss.base.beside import Beside
from insgnss.base.errors import InputError
from insgnss.base.files import atomic_write
from insgnss.base.inputs import check_input, open_bytes, read_bytes, read_text, reading, sha256
from insgnss.base.output.unfinished import UNFINISHED_MARK
from insgnss.cli.main import main

CHANGED = "changed after it was read; wait"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "imu.csv"
    path.write_text("1.0 2.0\n")
    return path


def swap(path: Path) -> None:
    """Another file of the same size takes the place of this one."""
    beside = path.with_name("beside")
    beside.write_bytes(b"x" * path.stat().st_size)
    os.replace(beside, path)


def rewrite(path: Path) -> None:
    """The same file holds something else, of the same size, a second later."""
    size, changed = path.stat().st_size, path.stat().st_mtime_ns
    path.write_bytes(b"y" * size)
    os.utime(path, ns=(changed, changed + 10**9))


@pytest.mark.parametrize("change", [swap, rewrite])
def test_a_file_that_changed_after_it_was_read_is_refused(file: Path, change) -> None:
    """Oracle: a file that was changed by the test; before and after the block it may change."""
    with reading():
        assert read_bytes(file) == b"1.0 2.0\n"
        assert sha256(file) == hashlib.sha256(b"1.0 2.0\n").hexdigest()
        change(file)
        for read in (read_bytes, sha256, check_input, open_bytes):
            with pytest.raises(InputError, match=CHANGED):
                read(file)
    content = file.read_bytes()
    with reading():
        assert sha256(file) == hashlib.sha256(content).hexdigest()


def test_blocks_within_each_other_and_threads_remember_together(file: Path) -> None:
    """Oracle: a file that was changed between two blocks, and between two threads."""
    with reading():
        with reading() as files:
            read_text(file)
        swap(file)
        with pytest.raises(InputError, match=CHANGED):
            Beside(lambda: sha256(file)).result()
    before = dict(files)
    with pytest.raises(InputError, match=CHANGED), reading(before):
        read_text(file)


def test_what_the_run_itself_wrote_may_be_read_again(file: Path) -> None:
    """Oracle: the text that was written."""
    with reading():
        read_text(file)
        atomic_write(file, "new")
        assert read_text(file) == "new"


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_a_pipe_or_a_device_is_refused_at_once(tmp_path: Path) -> None:
    """Oracle: the clock; a pipe without a writer would wait for ever."""
    pipe = tmp_path / "imu.csv"
    os.mkfifo(pipe)
    start = time.monotonic()
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(InputError, match=r"is not a regular file but a pipe or a device; save"):
            read_bytes(path)
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)
    assert time.monotonic() - start < 1.0


def test_a_file_of_a_killed_run_is_refused_and_others_are_not(file: Path) -> None:
    """Oracle: the names in the mark."""
    beside = file.with_name("own.csv")
    beside.write_text("x")
    file.with_name(UNFINISHED_MARK).write_text('["imu.csv"]')
    assert read_text(beside) == "x"
    with pytest.raises(InputError, match="a run was killed while it moved its files into"):
        read_text(file)


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize(
    "command",
    [
        *("inspect PIPE", "process PIPE", "verify PIPE", "batch PIPE", "adjust PIPE"),
        *("tune PIPE", "export PIPE metashape", "compare PIPE PIPE", "figures PIPE"),
        *("calibrate imu PIPE", "targets predict PIPE PIPE PIPE"),
        "ppk PIPE --base PIPE --navigation PIPE",
    ],
)
def test_every_verb_says_of_a_pipe_what_it_is(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the exit code of bad input; a verb that opened the pipe would wait for ever."""
    os.mkfifo(tmp_path / "pipe.csv")
    assert main(command.replace("PIPE", str(tmp_path / "pipe.csv")).split()) == 3
    assert "is not a regular file but a pipe or a device" in capsys.readouterr().err


READERS = ("export OUT/eo.json metashape --out X.csv", "compare OUT/eo.json OUT/eo.json")


@pytest.mark.parametrize("command", [*READERS, "figures OUT/report.html", "archive OUT"])
def test_verbs_that_read_products_are_told_of_a_killed_run(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the mark; the content of the files does not matter."""
    for name in ("eo.json", "report.json", "report.html"):
        (tmp_path / name).write_text('{"inputs_sha256": {}}')
    (tmp_path / UNFINISHED_MARK).write_text('["eo.json", "report.json", "report.html"]')
    assert main(command.replace("OUT", str(tmp_path)).replace("X", f"{tmp_path}/x").split()) == 3
    assert "a run was killed while it moved its files into" in capsys.readouterr().err
    assert not (tmp_path / "x.csv").exists()
