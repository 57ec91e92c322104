"""Files that somebody sent: what they may have written where."""

from collections.abc import Callable
from pathlib import Path

import pytest

from insgnss.base.errors import InputError
from insgnss.flight.config.block_file import load_block
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.products import output_directory
from insgnss.photogrammetry.block_adjustment.run import directory_of

INPUTS = ("imu.csv", "fixes.csv", "rover.obs", "base.obs", "nav.rnx", "points.csv")
FIXES = 'file = "fixes.csv"'
RAW = 'rover = "rover.obs"\nbase = "base.obs"\nnavigation = ["nav.rnx"]'


@pytest.fixture
def received(tmp_path: Path) -> Callable[..., Path]:
    """Write flight.toml and block.toml with an output directory; return their directory."""

    def written(output: str, gnss: str = FIXES, formats: str = "[]", folder: str = "sent") -> Path:
        directory = tmp_path / folder
        directory.mkdir(exist_ok=True)
        for name in INPUTS:
            (directory / name).write_text("1 2 3\n")
        table = f"[output]\ndirectory = '{output}'\nformats = {formats}\n"
        (directory / "flight.toml").write_text(
            f'[imu]\nfile = "imu.csv"\nnoise = "navchip"\n[gnss]\n{gnss}\n{table}'
        )
        (directory / "block.toml").write_text(f'[images]\nfile = "points.csv"\n{table}')
        return directory

    return written


@pytest.mark.parametrize("name", ["{}/away", "..", "../sent2", "a/../../away", "link", "link/a"])
def test_products_go_below_the_file_that_names_them_unless_out_does(
    name: str, received: Callable[..., Path], tmp_path: Path
) -> None:
    """Oracle: the paths, by eye; a symbolic link in the received tree leads out of it."""
    directory = received(name.format(tmp_path))
    (directory / "link").symlink_to(tmp_path)
    flight, block = load_flight(directory), load_block(directory)
    with pytest.raises(InputError) as no:
        output_directory(flight, None)
    where = f"{directory / 'flight.toml'}:7: output.directory: "
    assert str(no.value).startswith(where), str(no.value)
    assert f"give --out {flight.output.directory} (out= in Python)" in str(no.value)
    with pytest.raises(InputError, match=r"block\.toml:4: output\.directory: .* give --out "):
        directory_of(block, None)
    chosen = flight.output.directory
    assert output_directory(flight, chosen) == directory_of(block, chosen) == chosen


@pytest.mark.parametrize("name", ["out", ".", "a/../b", "{}/sent/out", "../sent/out"])
def test_products_below_the_file_are_written(
    name: str, received: Callable[..., Path], tmp_path: Path
) -> None:
    """Oracle: the paths, by eye; the directory of the file may be reached by a link."""
    directory = received(name.format(tmp_path))
    (tmp_path / "by_link").symlink_to(directory)
    for place in (directory, tmp_path / "by_link"):
        flight, block = load_flight(place), load_block(place)
        assert output_directory(flight, None) == flight.output.directory
        assert directory_of(block, None) == block.output.directory


def test_the_solution_beside_the_output_directory_stays_inside_as_well(
    received: Callable[..., Path], tmp_path: Path
) -> None:
    """Oracle: GPS-PPK goes beside GPS-INS, here beside the directory that was sent; or a link."""
    directory = received(".", RAW, folder="GPS-INS")
    with pytest.raises(InputError, match=r"output\.directory: .*GPS-PPK is outside of "):
        output_directory(load_flight(directory), None)
    directory = received("out", RAW)
    (directory / "out").mkdir()
    (directory / "out" / "GPS-PPK").symlink_to(tmp_path)
    with pytest.raises(InputError, match="is outside of "):
        output_directory(load_flight(directory), None)


def test_a_shared_file_sends_products_nowhere_else_either(
    received: Callable[..., Path], tmp_path: Path
) -> None:
    """Oracle: the flight's own file is named, which has no line of the key."""
    directory = received("out")
    flight = directory / "flight.toml"
    text = flight.read_text().replace("[output]\ndirectory = 'out'\nformats = []\n", "")
    flight.write_text('include = "../wing.toml"\n' + text)
    (tmp_path / "wing.toml").write_text(f"[output]\ndirectory = '{tmp_path}'\n")
    with pytest.raises(InputError) as no:
        output_directory(load_flight(directory), None)
    assert str(no.value).startswith(f"{flight}: output.directory: {tmp_path} is outside of ")
