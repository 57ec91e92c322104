"""Paths and commands as the system's shell takes them; Windows by its own rules in the library."""

import ntpath
import subprocess

import pytest

from insgnss.base import wording
from insgnss.cli.main import expand_arguments


def test_a_path_on_another_drive_is_written_in_full(monkeypatch):
    """Oracle: ntpath, which has no way from one drive to another. A flight on D: processed into C:
    ended in an internal error.
    """
    monkeypatch.setattr(wording.os, "path", ntpath)
    assert wording.relative(r"C:\data\flight\imu.csv", r"C:\data") == r"flight\imu.csv"
    with pytest.raises(ValueError, match="mount"):
        ntpath.relpath(r"D:\data\imu.csv", r"C:\out")
    assert wording.relative(r"D:\data\imu.csv", r"C:\out") == r"D:\data\imu.csv"


@pytest.mark.parametrize(
    ("system", "written"),
    [("posix", "insgnss ppk 'a b/rover.18o'"), ("nt", 'insgnss ppk "a b/rover.18o"')],
)
def test_a_command_has_the_quotation_marks_of_the_shell(system, written, monkeypatch):
    """Oracle: shlex and `subprocess.list2cmdline`: cmd takes single ones for letters."""
    monkeypatch.setattr(wording.os, "name", system)
    assert wording.command_line(["insgnss", "ppk", "a b/rover.18o"]) == written
    plain = r"C:\data\rover.18o"
    assert (wording.command_line([plain]) == plain) == (system == "nt")
    assert subprocess.list2cmdline([plain]) == plain


def test_patterns_of_files_are_expanded_where_the_shell_does_not(tmp_path, monkeypatch):
    """Oracle: the directory's listing; options and patterns that fit nothing stay."""
    for name in ("s2.csv", "s1.csv", "x.txt"):
        (tmp_path / name).write_text("", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    words = ["tune", "s*.csv", "--columns=*", "none*.csv", "x.txt"]
    assert expand_arguments(words) == [
        "tune",
        "s1.csv",
        "s2.csv",
        "--columns=*",
        "none*.csv",
        "x.txt",
    ]
