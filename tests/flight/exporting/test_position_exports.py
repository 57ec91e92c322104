"""Camera positions of PPK in the files of bundle adjustments."""

import json

import numpy as np
import pytest

from insgnss.cli import main
from insgnss.io.formats.positions.camera_positions import write_camera_positions
from insgnss.records.cameras.camera_positions import CameraPositions


@pytest.fixture
def file(tmp_path):
    cov = np.tile(np.diag([0.03, 0.04, 0.05]) ** 2, (2, 1, 1))
    lat, lon = np.radians([46.57, 46.571]), np.radians([6.54, 6.541])
    positions = CameraPositions(
        ("a.jpg", "b.jpg"),
        np.array([10.0, 12.0]),
        lat,
        lon,
        np.array([700.0, 701.0]),
        cov,
        np.ones(2),
        np.array([1.0, 0.0]),
        2024,
    )
    write_camera_positions(positions, tmp_path / "camera_positions.csv")
    return tmp_path / "camera_positions.csv"


@pytest.mark.parametrize(
    ("form", "product", "line"),
    [
        (
            "metashape",
            "metashape_positions.csv",
            "a.jpg,6.5400000000,46.5700000000,700.0000,0.04000,0.03000,0.05000",
        ),
        (
            "pix4d_matic",
            "pix4d_positions.csv",
            "a.jpg,46.5700000000,6.5400000000,700.0000,0.03536,0.05000",
        ),
        (
            "odm",
            "geo.txt",
            "a.jpg 6.5400000000 46.5700000000 700.0000 NaN NaN NaN 0.03536 0.05000",
        ),
        (
            "realitycapture_accuracy",
            "realitycapture_positions.csv",
            "a.jpg,46.5700000000,6.5400000000,700.0000,0.04000,0.03000,0.05000",
        ),
        (
            "generic_ascii",
            "positions.csv",
            "a.jpg,6.5400000000,46.5700000000,700.0000,0.04000,0.03000,0.05000",
        ),
    ],
)
def test_each_program_gets_its_columns(file, capsys, form, product, line):
    """Oracle: the lines by hand, of what the programs' manuals state of their columns."""
    assert main(["export", str(file), form]) == 0
    assert line in (file.parent / product).read_text().splitlines()
    assert "1 of 2 positions are of the antenna" in capsys.readouterr().out


def test_a_projected_system_takes_them_along(file):
    """Oracle: the approximate formulas of swisstopo by hand, to a metre."""
    assert main(["export", str(file), "odm", "--crs", "EPSG:2056"]) == 0
    head, line = (file.parent / "geo.txt").read_text().splitlines()[:2]
    assert head == "EPSG:2056"
    phi, lam = (46.57 * 3600 - 169028.66) / 1e4, (6.54 * 3600 - 26782.5) / 1e4
    east = (
        2600072.37 + 211455.93 * lam - 10938.51 * lam * phi - 0.36 * lam * phi**2 - 44.54 * lam**3
    )
    north = 1200147.07 + 308807.95 * phi + 3745.25 * lam**2 + 76.63 * phi**2
    north += 119.79 * phi**3 - 194.56 * lam**2 * phi
    assert [float(word) for word in line.split()[1:3]] == pytest.approx([east, north], abs=2.0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["colmap"], "needs attitudes"),
        (["metashape", "--frame", "tangent"], "geographic coordinates or a projected CRS"),
        (["metashape", "--set", "a=b"], "--set has no effect on camera positions"),
    ],
)
def test_what_positions_cannot_be_is_refused(file, capsys, words, message):
    """Oracle: one line, exit code 2, nothing written."""
    before = sorted(file.parent.iterdir())
    assert main(["export", str(file), *words]) == 2
    assert message in capsys.readouterr().err
    assert sorted(file.parent.iterdir()) == before


def test_other_programs_are_told_the_columns(file, capsys):
    """Oracle: GeoJSON by hand; the order of the log's header in the description of the program."""
    assert main(["export", str(file), "geojson"]) == 0
    point = json.loads((file.parent / "positions.geojson").read_text())["features"][0]
    assert point["geometry"] == {"type": "Point", "coordinates": [6.54, 46.57, 700.0]}
    assert point["properties"] == {"image": "a.jpg", "sigma_enu_m": [0.04, 0.03, 0.05]}
    assert main(["export", str(file), "geojson", "--crs", "EPSG:2056", "--force"]) == 2
    assert main(["export", str(file), "realitycapture_accuracy", "--crs", "EPSG:2056"]) == 0
    text = (file.parent / "realitycapture_positions_format.xml").read_text()
    places = [text.index(f"<{name} ") for name in ("Image", "X", "Y", "Altitude", "XAccuracy")]
    assert places == sorted(places)
    assert "EPSG:2056" in text


@pytest.mark.parametrize(
    ("words", "crs"), [([], "EPSG::4979"), (["--crs", "EPSG:2056"], "EPSG::2056")]
)
def test_metashape_gets_a_script_of_its_columns(file, capsys, monkeypatch, words, crs):
    """Oracle: the letters of Metashape's importReference over the header of the csv."""
    from test_import_helpers import run_in_metashape

    assert main(["export", str(file), "metashape", *words, "--json"]) == 0
    script = file.parent / "metashape_positions_import.py"
    assert str(script) in capsys.readouterr().out
    calls = run_in_metashape(script, monkeypatch)
    assert calls["crs"] == calls["chunk_crs"] == ("CRS", crs)
    assert calls["angles"] is None
    header = (file.parent / "metashape_positions.csv").read_text().splitlines()[0].split(",")
    assert len(calls["columns"]) == len(header)
    assert header[calls["columns"].index("X")] == "X_acc"


def test_a_system_of_another_place_is_told(file, capsys):
    """Oracle: the area of use of EPSG:32732 in the registry, which is south of the equator."""
    assert main(["export", str(file), "odm", "--crs", "EPSG:32732", "-q"]) == 0
    assert "2 of 2 images lie outside of the area of" in capsys.readouterr().out


MRK = "".join(
    f"{k}\t{10 + k}.000000\t[2024]\t0,N\t0,E\t0,V\t46.570{k},Lat\t6.54,Lon\t700.5,Ellh"
    "\t0.030000, 0.040000, 0.050000\t50,Q\n"
    for k in (1, 2, 3)
)
POS = (
    "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)"
    "  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"
)
POS += "".join(
    f"2024 {10 + k}.000 46.570{k} 6.54 700.5 1 9 0.0300 0.0400 0.0500 0 0 0 0 9\n" for k in range(6)
)


@pytest.mark.parametrize(
    ("name", "text", "words", "of_antenna"),
    [
        ("Timestamp.MRK", MRK, [], False),
        ("rover_events.pos", POS, [], True),
        (
            "stamps.txt",
            "10.5\n11.5\n12.5\n",
            ["--fixes", "antenna.pos", "--camera-delay", "0.5"],
            True,
        ),
    ],
)
def test_exposures_without_an_imu_are_exported(
    tmp_path, capsys, monkeypatch, name, text, words, of_antenna
):
    """Oracle: the lines by hand: images in the order of the exposures, positions and deviations of
    the file, or of fixes on a straight line half a second behind the stamps."""
    monkeypatch.chdir(tmp_path)
    rows = text.splitlines(keepends=True)
    text = text if name != "rover_events.pos" else "".join(rows[:1] + rows[2:5])
    (tmp_path / name).write_text(text)
    (tmp_path / "antenna.pos").write_text(POS)
    (tmp_path / "names.txt").write_text("c.jpg\nb.jpg\na.jpg\n")
    assert main(["export", name, "metashape", "--images", "names.txt", *words]) == 0
    lines = (tmp_path / "metashape_positions.csv").read_text().splitlines()[1:]
    assert lines == [
        f"{image},6.5400000000,46.570{k}000000,700.5000,0.04000,0.03000,0.05000"
        for image, k in (("c.jpg", 1), ("b.jpg", 2), ("a.jpg", 3))
    ]
    assert ("of the antenna" in capsys.readouterr().out) == of_antenna


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["Timestamp.MRK", "odm", "--camera-delay", "0.1"], 2, "give the antenna positions by"),
        (["times.MRK", "odm"], 3, "has no standard deviations of positions"),
        (
            ["eo.json", "metashape", "--fixes", "antenna.pos"],
            2,
            "--fixes is only for positions without",
        ),
        (
            ["stamps.csv", "odm", "--fixes", "antenna.pos"],
            3,
            "dates do not say whether they are UTC or GPS",
        ),
    ],
)
def test_exposures_that_have_no_position_are_refused(
    tmp_path, capsys, monkeypatch, words, code, message
):
    """Oracle: one line that names what to give; nothing written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Timestamp.MRK").write_text(MRK)
    (tmp_path / "times.MRK").write_text(MRK.replace("\t0.030000, 0.040000, 0.050000", ""))
    (tmp_path / "antenna.pos").write_text(POS)
    (tmp_path / "stamps.csv").write_text("image,datetime\na.jpg,2018-10-21 00:00:11.5\n")
    before = sorted(tmp_path.iterdir())
    assert main(["export", *words]) == code
    assert message in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before
