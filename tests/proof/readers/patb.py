"""PATB, formats.md B10: I16,16X,3F16.5; 5F16.12; 4F16.12. That the matrix is image to ground is the
assumption under test there [U].
"""

from pathlib import Path

import numpy as np

from .geometry import D, Frame, Poses, Table


def _fields(line: str, count: int, start: int = 0) -> list[float]:
    return [float(line[start + 16 * k : start + 16 * (k + 1)]) for k in range(count)]


def read(path: Path) -> Table:
    """Numbers of photos become names by the table beside the file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    beside = path.with_name(f"{path.stem}_ids.txt").read_text(encoding="utf-8").splitlines()
    name = dict(line.split(" ", 1) for line in beside if not line.startswith("#"))
    names, x, R = [], [], []
    for one, two, three in zip(lines[::3], lines[1::3], lines[2::3], strict=True):
        names.append(name[str(int(one[:16]))])
        assert one[16:32].isspace()
        x.append(_fields(one, 3, 32))
        R.append(_fields(two, 5) + _fields(three, 4))
    return Table(
        names, dict(zip("xyz", np.array(x).T, strict=True)) | {"R": np.array(R).reshape(-1, 3, 3)}
    )


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(table.names, frame.ecef(x), frame.axes(x) @ table["R"] @ D)
