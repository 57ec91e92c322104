"""Completion in a shell, as argcomplete asks for it in the environment."""

import os
import subprocess
import sys

import pytest


def _offered(line, tmp_path):
    answer = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SHELL": "bash",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }
    command = [sys.executable, "-m", "insgnss"]
    subprocess.run(command, env=os.environ | asked, cwd=tmp_path, timeout=60, check=False)
    return {word.strip() for word in answer.read_text().split("\n")}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("insgnss pro", {"process"}),
        ("insgnss export eo.json metashape_o", {"metashape_offset", "metashape_opk"}),
        ("insgnss calibrate similarity --geo", {"--geoid"}),
    ],
)
def test_a_shell_is_offered_how_a_word_goes_on(line, words, tmp_path):
    """Oracle: the verbs, formats and options of that beginning, by hand."""
    assert _offered(line, tmp_path) == words


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_the_shells_part_names_the_program(shell, capsys):
    """Oracle: how argcomplete binds a program in that shell."""
    from insgnss.cli import main

    assert main(["--completion", shell]) == 0
    code = capsys.readouterr().out
    assert "insgnss" in code
    assert "complete -o nospace" in code
