"""Keys that flights share: which file's count, whose line a message names, which chains end."""

from collections.abc import Callable
from pathlib import Path

import pytest

from insgnss.base.errors import InputError
from insgnss.base.received.trusted import SHOWN_VARIABLE
from insgnss.flight.config.flight_file import Flight
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.input_files import input_files

OWN = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
NOISE = (
    'name = "n"\nsource = "s"\n[gyro]\nwhite_noise = "10 deg/h/sqrt(Hz)"\n'
    '[accel]\nwhite_noise = "50 ug/sqrt(Hz)"\n'
)
Load = Callable[..., Flight]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Writes a flight in a directory of its own, and shared files above it; loads the flight."""
    (tmp_path / "f1").mkdir()
    for name in ("imu.csv", "gnss.txt"):
        (tmp_path / "f1" / name).write_text("1 2 3\n")
    (tmp_path / "noise.toml").write_text(NOISE)

    def write_and_load(flight: str, **shared: str) -> Flight:
        for name, text in shared.items():
            (tmp_path / f"{name}.toml").write_text(text)
        (tmp_path / "f1" / "flight.toml").write_text(flight)
        return load_flight(tmp_path / "f1")

    return write_and_load


def test_own_keys_go_before_shared_ones_key_by_key(load: Load, tmp_path: Path) -> None:
    """Oracle: the two files, read by eye; values are of one file as a whole."""
    flight = load(
        'include = "../wing.toml"\n'
        + OWN.replace("[gnss]", 'units = { gyro = "deg/s" }\n[gnss]')
        + "[mounting]\nantenna_m = [0.1, 0, 0]\nboresight_deg = { opk = [1, 0, 0] }\n",
        wing='[imu]\nnoise = "noise.toml"\nunits = { accel = "g" }\naxes = "right forward up"\n'
        "[mounting]\nantenna_m = [0.2, 0, 0]\nimu_m = [0.3, 0, 0]\n"
        "boresight = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n"
        '[output]\ndirectory = "out"\n',
    )
    assert flight.imu.units == {"gyro": "deg/s"}
    assert flight.imu.axes == "right forward up"
    assert flight.mounting.antenna_m.tolist() == [0.1, 0, 0]
    assert flight.mounting.imu_m.tolist() == [0.3, 0, 0]
    assert flight.mounting.boresight[1, 2] == pytest.approx(-0.0174524, abs=1e-7)
    assert isinstance(flight.imu.noise, Path)
    assert flight.imu.noise.samefile(tmp_path / "noise.toml")
    assert flight.output.directory == tmp_path / "f1" / "out"
    assert flight.resolved()["include"] == "../wing.toml"
    assert flight.resolved()["mounting"]["imu_m"] == [0.3, 0, 0]
    assert any(path.samefile(tmp_path / "wing.toml") for path in input_files(flight))


def test_a_chain_takes_the_nearest_and_hashes_all(load: Load, tmp_path: Path) -> None:
    """Oracle: the files; a: 1, b: 2 and 3."""
    flight = load(
        'include = "../a.toml"\n' + OWN,
        a='include = "b.toml"\n[gnss]\ngate_sigma = 4\n',
        b="[gnss]\ngate_sigma = 9\ntime_offset_s = 0.5\n",
    )
    assert (flight.gnss.gate_sigma, flight.gnss.time_offset_s) == (4.0, 0.5)
    assert [path.name for path in flight.included] == ["a.toml", "b.toml"]
    assert {"flight.toml", "a.toml", "b.toml"} <= {path.name for path in input_files(flight)}


@pytest.mark.parametrize(
    ("shared", "message"),
    [
        ({"wing": "[imu]\nnois = 1\n"}, r"wing\.toml:2: imu\.nois: unknown key; did you mean"),
        ({"wing": '[imu]\n\nnoise = "x.toml"\n'}, r"wing\.toml:3: imu\.noise: .*relative to wing"),
        (
            {"wing": "[gnss]\ngate_sigma = 1\n"},
            r"wing\.toml:2: gnss\.gate_sigma = 1: must be",
        ),
        ({"wing": 'accept = ["motion"]\n'}, r"wing\.toml:1: accept: belongs to a flight"),
        ({"wing": "[imu\n"}, r"wing\.toml:1: not TOML"),
        (
            {"wing": 'include = "wing.toml"\n'},
            r"wing\.toml:1: include: the files include each other in a circle, fl",
        ),
        ({}, r"flight\.toml:1: include: \.\./wing\.toml does not exist"),
        ({"wing": 'include = "b.toml"\n', "b": 'include = "f1/flight.toml"\n'}, "b.toml:1: .*circ"),
        ({"wing": "[wings]\n"}, r"wing\.toml:1: wings: unknown table"),
        ({"wing": '[gnss]\nengine = "/bin/sh"\n'}, r"wing\.toml:2: gnss\.engine: .*command line"),
    ],
)
def test_a_message_names_the_file_and_line_of_the_key(
    load: Load,
    shared: dict[str, str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: the lines of the files; what is none of ours is shown where that is trusted."""
    flight = 'include = "../wing.toml"\n' + OWN
    if "engine" in str(shared):
        flight = flight.replace(
            'file = "gnss.txt"', 'rover = "imu.csv"\nbase = "imu.csv"\nnavigation = ["imu.csv"]'
        )
    if "TOML" in message or "wings" in message:
        with pytest.raises(InputError, match=r"wing\.toml:1: has an .* which is not shown"):
            load(flight, **shared)
        monkeypatch.setenv(SHOWN_VARIABLE, str(tmp_path))
    with pytest.raises(InputError, match=message):
        load(flight, **shared)


def test_the_chain_has_a_limit(load: Load) -> None:
    """Oracle: four files are taken, a fifth is refused."""
    files = {f"e{k}": f'include = "e{k + 1}.toml"\n' for k in range(1, 4)} | {"e4": "[imu]\n"}
    assert len(load('include = "../e1.toml"\n' + OWN, **files).included) == 4
    files |= {"e4": 'include = "e5.toml"\n', "e5": "[imu]\n"}
    with pytest.raises(InputError, match=r"e4\.toml:1: include: more than 4 files"):
        load('include = "../e1.toml"\n' + OWN, **files)


def test_a_calibrated_mounting_of_the_flight_goes_before_its_equipment(
    load: Load, tmp_path: Path
) -> None:
    """Oracle: the file's lever arm; the reverse, a key of the flight beside a file of the
    equipment, is the contradiction that it is within one file.
    """
    made = "[mounting]\nantenna_m = [0.7, 0, 0]\n"
    (tmp_path / "made.toml").write_text(made)
    head, own = 'include = "../wing.toml"\n', '[mounting]\nfile = "../made.toml"\n'
    flight = load(head + OWN + own, wing="[mounting]\nantenna_m = [0.2, 0, 0]\n")
    assert flight.mounting.antenna_m.tolist() == [0.7, 0, 0]
    with pytest.raises(InputError, match=r"flight\.toml:7: mounting\.antenna_m: made\.toml"):
        load(
            head + OWN + "[mounting]\nantenna_m = [0.2, 0, 0]\n",
            wing='[mounting]\nfile = "made.toml"\n',
        )
