"""What a file that somebody sent may do: have files written below its own directory alone."""

import os
from collections.abc import Iterable
from pathlib import Path

from ..errors import InputError
from ..tables import line_of_key
from .trusted import inside


def refuse_outside(file: Path, key: str, goals: Iterable[Path]) -> None:
    """Refuse directories of products outside of the directory of the file that names them.

    Parameters
    ----------
    file : Path
        The flight file or block file.
    key : str
        Its key, such as "output.directory".
    goals : iterable of Path
        The directories; they need not exist.

    Raises
    ------
    InputError
        At the line of the key, for the first that lies outside.
    """
    home = file.absolute().parent
    for goal in goals:
        if not inside(goal, home):
            problem = f"{key}: {os.path.realpath(goal)} is outside of {os.path.realpath(home)}"
            advice = f"give --out {goal} (out= in Python) if the products shall be written there"
            raise InputError.at_line(file, line_of_key(file, key), f"{problem}; {advice}")
