"""Several observation files of one receiver, joined to one."""

from pathlib import Path

import numpy as np
import pytest
from written_rinex import header2, header3

from insgnss.base.errors import InputError
from insgnss.cli import build_parser
from insgnss.cli import ppk as verb
from insgnss.flight.config.load import load_flight
from insgnss.gnss import from_flight_file as flown
from insgnss.gnss.rinex.joined import join_observations
from insgnss.gnss.rinex.observations import read_observations

TYPES = ("C1", "L1")


def hour(path: Path, first: int, count: int, head: str = header2(TYPES), k: float = 0.0) -> Path:
    """A file of epochs every second from 13 h 5 min `first` s."""
    rows = [
        f" 18 10  4 13  5{second:11.7f}  0  1G05\n{2e7 + second + k:14.3f}  {1e8 + second:14.3f}\n"
        for second in range(first, first + count)
    ]
    path.write_text(head + "".join(rows))
    return path


def test_files_become_one_in_order_of_time(tmp_path):
    """Oracle: one file of all the epochs; the epoch that two files share counts once."""
    whole = read_observations(hour(tmp_path / "whole.18o", 0, 30))
    files = [
        hour(tmp_path / f"{name}.18o", *span)
        for name, span in (("z", (0, 11)), ("a", (20, 10)), ("m", (10, 10)))
    ]
    one = join_observations(files, tmp_path / "out")
    read = read_observations(one.path)
    np.testing.assert_array_equal(read.time, whole.time)
    np.testing.assert_array_equal(read.values, whole.values)
    assert one.checks[0].found == "3 of rover over 0.01 hours, at most 1 s between them"
    assert join_observations(files[:1], tmp_path / "out").path == files[0]


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"first": 5, "count": 10}, "begins 4.000 s before"),
        ({"first": 20, "count": 3, "head": header2(("C1", "L2"))}, "the kinds of observations"),
        ({"first": 9, "count": 3, "k": 1.0}, "time must increase"),
    ],
)
def test_files_that_do_not_follow_each_other_are_refused(tmp_path, second, message):
    """Oracle: the file and what is wrong; another epoch under the same stamp is no repetition."""
    files = [hour(tmp_path / "a.18o", 0, 10), hour(tmp_path / "b.18o", **second)]
    with pytest.raises(InputError, match=message):
        read_observations(join_observations(files, tmp_path / "out").path)


def test_another_version_is_refused(tmp_path):
    """Oracle: both versions in the message."""
    epoch = "> 2018 10 04 13 06 00.0000000  0  1\nG05  20000000.000  100000000.000\n"
    other = tmp_path / "b.rnx"
    other.write_text(header3({"G": ("C1C", "L1C")}) + epoch)
    with pytest.raises(InputError, match="RINEX version is not that of"):
        join_observations([hour(tmp_path / "a.18o", 0, 10), other], tmp_path / "out")


def test_lists_and_patterns_name_them(tmp_path, monkeypatch):
    """Oracle: the files by name, on the command line and in the flight file."""
    files = [hour(tmp_path / f"cors{k}.18o", 10 * k, 10) for k in range(3)]
    words = ["ppk", "r1", "r2", "--base", str(tmp_path / "cors*.18o"), "--navigation", "n"]
    given = verb.input_of(build_parser().parse_args(words))
    assert given.rover == (Path("r1"), Path("r2"))
    assert given.base == tuple(files)
    (tmp_path / "imu.csv").write_text("tow,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,-9.8\n")
    (tmp_path / "flight.toml").write_text(
        'gps_week = 2021\n[imu]\nfile = "imu.csv"\n[gnss]\nrover = "cors0.18o"\n'
        'base = ["cors1.18o", "cors2*"]\nnavigation = ["cors0.18o"]\n'
    )
    raw = load_flight(tmp_path / "flight.toml").gnss.raw
    assert (raw.rover, raw.base) == (files[0], (files[1], files[2]))
    assert raw.files == (files[0], files[1], files[2], files[0])
    assert flown.ppk_input(raw).base == (files[1], files[2])
