"""`insgnss calibrate tripod`: files of setups to mounting.toml, and that into a flight."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.cli import main
from insgnss.flight.config.load import load_flight
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.report.charts.files import charts_of

TABLE_1 = {  # paper 000: antenna and both IMUs, from the projection centre in camera axes, m
    "antenna": (0.462, -0.001, -0.065),
    "NC0": (0.133, 0.020, 0.000),
    "NC1": (0.113, 0.020, 0.000),
}
POSE_M, POSE_DEG, PIN_M = 1e-3, 0.05, (0.6e-3, 0.6e-3, 1e-3)
OTHER = np.diag([1.0, -1.0, -1.0])  # right up back, of which omega phi kappa are


def setups(arm, seed=0, n=8):
    """Projection centres, rotations (scipy's) and pins of a fuselage that is turned in roll."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_euler(
        "zyx", [[45.0 * j, 4.0 * (-1) ** j, 90.0 + 3.0 * (j % 3)] for j in range(n)], degrees=True
    )
    c = np.array([[2.0 + 0.3 * j, 1.0 - 0.2 * j, 1.2] for j in range(n)])
    p = c + turns.apply(arm) + rng.normal(0.0, PIN_M, (n, 3))
    errors = Rotation.from_rotvec(rng.normal(0.0, np.radians(POSE_DEG), (n, 3)))
    return c + rng.normal(0.0, POSE_M, (n, 3)), (errors * turns).as_matrix(), p


def write(directory, c, C, p, angles=lambda opk: opk):
    """Write poses.csv and pin.csv; angles by scipy's intrinsic x-y-z."""
    opk = angles(Rotation.from_matrix(C @ OTHER).as_euler("XYZ", degrees=True))
    head = "image,x,y,z,omega,phi,kappa,sd_x,sd_y,sd_z,sd_omega,sd_phi,sd_kappa\n"
    sigma = ",0.001,0.001,0.001,0.05,0.05,0.05\n"
    rows = [
        f"S{k + 1}.jpg," + ",".join(f"{v:.7f}" for v in (*c[k], *opk[k])) + sigma
        for k in range(len(c))
    ]
    (directory / "poses.csv").write_text(head + "".join(rows))
    rows = [
        f"S{k + 1}," + ",".join(f"{v:.5f}" for v in p[k]) + ",0.0006,0.0006,0.001\n"
        for k in range(len(p))
    ]
    (directory / "pin.csv").write_text("setup,x,y,z,sd_x,sd_y,sd_z\n" + "".join(rows))


def run(directory, *more):
    words = [str(directory / name) for name in ("poses.csv", "pin.csv")]
    out = ["--out", str(directory / "mounting.toml")]
    return main(["calibrate", "tripod", *words, *out, "-q", *more])


@pytest.mark.parametrize("origin", TABLE_1)
def test_table_1_comes_back_and_a_flight_takes_it(tmp_path, capsys, origin) -> None:
    """Oracle: Table 1 of paper 000; within four of its own standard errors, below a millimetre."""
    write(tmp_path, *setups(TABLE_1[origin]))
    assert run(tmp_path, "--date", "2018-07-06") == 0
    text = capsys.readouterr().out
    assert "antenna_m  determined" in text
    assert "8 of 8 setups" in text
    got, _ = read_mounting_file(tmp_path / "mounting.toml")
    sigma = got.sigma("antenna_m")
    assert (np.abs(got.antenna_m - TABLE_1[origin]) < 4.0 * sigma).all()
    assert sigma.max() < 0.8e-3
    assert (got.date, got.imu_m, [name for name, _ in got.inputs]) == (
        "2018-07-06",
        None,
        ["poses.csv", "pin.csv"],
    )
    for name in ("imu.csv", "gnss.txt", "events.txt"):
        (tmp_path / name).write_text("1 2 3\n")
    (tmp_path / "flight.toml").write_text(
        '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n[camera]\nevents = "events.txt"\n'
        '[mounting]\nfile = "mounting.toml"\nimu_m = [0.113, 0.02, 0.0]\n'
    )
    assert_allclose(load_flight(tmp_path).mounting.antenna_m, got.antenna_m, atol=1e-9)
    (chart,) = charts_of(tmp_path / "mounting.html")[1]
    assert chart.title.startswith("Lever arm of each setup")
    for k, panel in enumerate(chart.panels):
        (mean,) = (layer.name for layer in panel.layers if layer.name.startswith("mean"))
        assert float(mean.split()[1]) == pytest.approx(got.antenna_m[k], abs=5.1e-5)


def test_json_has_every_setup(tmp_path, capsys) -> None:
    """Oracle: the names in the files; one pin knocked by 30 mm."""
    c, C, p = setups(TABLE_1["antenna"])
    p[3] += [0.0, 0.03, 0.0]
    write(tmp_path, c, C, p)
    assert run(tmp_path, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert [s["left_out"] for s in document["setups"]] == [k == 3 for k in range(8)]
    assert document["mounting"]["antenna_m"] == pytest.approx(TABLE_1["antenna"], abs=3e-3)
    assert document["not_determined"].keys() == {"imu_m"}


GOOD = setups(TABLE_1["antenna"])
C, ROT, P = GOOD
WRONG = {
    "pins of a surveyor's axes": (
        (C, ROT, P[:, [1, 0, 2]]),
        None,
        "pin.csv has x and y exchanged",
    ),
    "pins mirrored": ((C, ROT, P * [1, -1, 1]), None, "pin.csv has y with the other sign"),
    "pins in mm": ((C, ROT, 1e3 * P), None, "pin.csv has coordinates in millimetres"),
    "pins one too late": (
        (C, ROT, np.roll(P, 1, axis=0)),
        None,
        "pin.csv has its rows one too late",
    ),
    "poses mirrored": ((C * [1, 1, -1], ROT, P), None, "poses.csv has z with the other sign"),
    "poses in mm": ((1e3 * C, ROT, P), None, "poses.csv has coordinates in millimetres"),
    "angles in radians": (GOOD, np.radians, "has angles in radians"),
    "angles in gon": (GOOD, lambda a: a / 0.9, "has angles in gon"),
    "angles exchanged": (GOOD, lambda a: a[:, ::-1], "has omega and kappa exchanged"),
    "rotations transposed": (
        (C, ROT.transpose(0, 2, 1), P),
        None,
        "that take the axes into the camera",
    ),
    "other flight": ((C + np.arange(24).reshape(8, 3), ROT, P), None, "limit 5 m"),
}


@pytest.mark.parametrize("name", WRONG)
def test_files_that_do_not_belong_together_are_refused_by_name(tmp_path, capsys, name) -> None:
    """Oracle: what was done to the files."""
    data, angles, words = WRONG[name]
    write(tmp_path, *data, *([] if angles is None else [angles]))
    assert run(tmp_path) == 3
    error = capsys.readouterr().err
    assert words in error, error
    assert error.count("\n") == 1
    assert re.search(r"limit (5 m|20 mm)", error)
    assert not (tmp_path / "mounting.toml").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("S2.jpg,2.", "S2.jpg,nan.", r"poses.csv:3: 'nan"),
        ("S2.jpg,", "S1.jpg,", r"poses.csv:3: 'S1.jpg' is there twice, before in line 2"),
        ("sd_phi", "sphi", r"poses.csv:1: column 'sphi' is unknown"),
        (",0.05,0.05,0.05\n", ",0.05,0.05,0\n", r"poses.csv:2: sigma_kappa 0 deg"),
    ],
)
def test_wrong_tables_are_refused_with_their_line(tmp_path, capsys, old, new, words) -> None:
    """Oracle: the line that was changed."""
    write(tmp_path, *GOOD)
    path = tmp_path / "poses.csv"
    path.write_text(path.read_text().replace(old, new))
    assert run(tmp_path) == 3
    assert re.search(words, capsys.readouterr().err)


def test_files_without_partners_and_empty_ones_are_refused(tmp_path, capsys) -> None:
    """Oracle: the names, and the design's exit codes."""
    write(tmp_path, *GOOD)
    pins = tmp_path / "pin.csv"
    text = pins.read_text()
    pins.write_text(re.sub(r"^S(\d)", r"T\1", text, flags=re.MULTILINE))
    assert run(tmp_path) == 3
    error = capsys.readouterr().err
    assert "0 of its 8 names, such as 'T1'" in error
    assert "are images named alike" in error
    pins.write_text("")
    assert run(tmp_path) == 3
    assert "pin.csv" in capsys.readouterr().err
    pins.unlink()
    assert run(tmp_path) == 3
    assert "does not exist" in capsys.readouterr().err


@pytest.mark.slow
def test_one_setup_is_not_determined_and_two_are(tmp_path, capsys) -> None:
    """Oracle: nothing checks a single setup; exit code 4 is that of data that support no answer."""
    for count, code in ((1, 4), (2, 0)):
        write(tmp_path, *(part[:count] for part in GOOD))
        assert run(tmp_path, "--force") == code
        got, _ = read_mounting_file(tmp_path / "mounting.toml")
        assert (got.antenna_m is None) == (count == 1)
    write(tmp_path, *(part[:1] for part in GOOD))
    run(tmp_path, "--force")
    assert "which nothing checks; add two setups" in capsys.readouterr().err
    assert "# antenna_m: from one setup" in Path(tmp_path / "mounting.toml").read_text()


def test_an_input_is_not_overwritten(tmp_path, capsys) -> None:
    """Oracle: the inputs' bytes."""
    write(tmp_path, *GOOD)
    (tmp_path / "pin.csv").rename(tmp_path / "pin.toml")
    before = (tmp_path / "pin.toml").read_bytes()
    words = [str(tmp_path / name) for name in ("poses.csv", "pin.toml")]
    assert main(["calibrate", "tripod", *words, "--out", words[1], "-q"]) == 2
    assert "would overwrite an input; give another --out FILE" in capsys.readouterr().err
    assert (tmp_path / "pin.toml").read_bytes() == before


@pytest.mark.parametrize("name", ["mounting.html", "none/mounting.toml"])
def test_a_name_that_cannot_be_is_refused_before_the_work(tmp_path, capsys, name) -> None:
    write(tmp_path, *GOOD)
    words = [str(tmp_path / given) for given in ("poses.csv", "pin.csv")]
    assert main(["calibrate", "tripod", *words, "--out", str(tmp_path / name), "-q"]) == 2
    assert "--out" in capsys.readouterr().err
