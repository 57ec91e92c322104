"""What an export takes the place of: scripts beside the one before, a run's tables, other files."""

import json
from pathlib import Path

import pytest

from insgnss.base.output.staging import together
from insgnss.cli import main
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.flight.proof.scene import make_scene
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.orientation.eo_json import write_eo_json


def listing(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def eo(tmp_path: Path) -> Path:
    """The products of a run that wrote metashape.csv in WGS 84."""
    scene = make_scene().eo
    write_eo_json(scene, tmp_path / "eo.json")
    with together():
        done = export(scene, "metashape", tmp_path / "metashape.csv")
    exports = [{"format": "metashape", "file": "metashape.csv", "frame": done.frame}]
    (tmp_path / "report.json").write_text(json.dumps({"exports": exports}))
    return tmp_path / "eo.json"


def test_a_script_belongs_to_its_table(tmp_path: Path) -> None:
    """Oracle: the CRS in the script is that of the table which a run writes over it; a description
    of another program, the tangent plane of a table without one, and names that hold no more, go;
    files of the user stay.
    """
    scene = make_scene().eo
    out = tmp_path / "out"
    out.mkdir()
    export(scene, "metashape", out / "t.csv", ExportFrame("EPSG:2056"), ["safe", "8001.tif=a.tif"])
    assert listing(out) == {"t.csv", "t_import.py", "t_names.csv"}
    with together() as staging:  # as a run writes
        export(scene, "metashape", staging.tree(out) / "t.csv")
    assert listing(out) == {"t.csv", "t_import.py"}
    assert "EPSG::4979" in (out / "t_import.py").read_text()
    export(scene, "realitycapture", out / "t.csv")
    assert listing(out) == {"t.csv", "t_format.xml"}
    export(scene, "micmac", out / "t.txt")
    assert listing(out) == {"t.csv", "t.txt", "t_SysCoRTL.xml"}
    (out / "t_import.py").write_text("print('of the user')")
    export(scene, "micmac", out / "t.txt", ExportFrame(frame="geocentric"))
    assert listing(out) == {"t.csv", "t.txt", "t_import.py"}


def test_a_table_of_the_run_stays_in_its_frame(
    eo: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: bytes and listing before; both frames in the line, whose advice works."""
    before = {path: path.read_bytes() for path in eo.parent.iterdir()}
    argv = ["export", str(eo), "metashape", "--crs", "EPSG:2056", "-q"]
    other = eo.with_name("metashape_EPSG2056.csv")
    assert main(argv) == 2
    error = capsys.readouterr().err
    assert (
        "metashape.csv is a product of the flight in EPSG:4979 WGS 84, and this export is in"
        in error
    )
    assert f"EPSG:2056 CH1903+ / LV95; give --out {other}, or --force" in error
    assert {path: path.read_bytes() for path in eo.parent.iterdir()} == before
    assert main(["export", str(eo), "metashape", "-q"]) == 0  # the same frame
    assert main([*argv, "--out", str(other)]) == 0
    assert main([*argv, "--force"]) == 0
    assert "EPSG::2056" in eo.with_name("metashape_import.py").read_text()


def test_what_is_named_is_replaced_by_the_same_only(
    eo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the bytes of the file, of others or of an export with other options."""
    table = tmp_path / "table.txt"
    table.write_text("of the user")
    argv = ["export", str(eo), "generic_ascii", "--out", str(table), "-q"]
    assert main(argv) == 2
    assert "table.txt exists and differs from this export" in capsys.readouterr().err
    assert table.read_text() == "of the user"
    assert main([*argv, "--force"]) == 0
    assert main(argv) == 0
    assert main([*argv, "--set", "unit=gon"]) == 2
    model = ["export", str(eo), "colmap", "--out", str(tmp_path / "cm1"), "-q", "--set"]
    assert main([*model, "camera=PINHOLE 1280 960 1400 1400 640 480"]) == 0
    assert main([*model, "camera=PINHOLE 1280 960 1400 1400 640 480"]) == 0
    assert main([*model, "camera=PINHOLE 1280 960 1500 1500 640 480"]) == 2
    assert "cameras.txt exists and differs" in capsys.readouterr().err
    noise = ["export", "navchip", "kalibr", "--out", str(tmp_path / "imu.yaml"), "--set"]
    assert [main([*noise, f"rate={rate}", "-q"]) for rate in (200, 200, 100)] == [0, 0, 2]


OPTIONS = {
    "micmac_xml": {},
    "bentley": {"width_px": 1280, "height_px": 960, "focal_px": 1400.0},
    "inpho_prj": {"focal_mm": 35.0, "ground_m": 400.0},
    "relative": {"noise": "navchip"},
    "kml": {"altitude": "clamped"},
    "opf": {"camera": "PINHOLE 1280 960 1400 1400 640 480", "pixel_size_um": 5.5},
    "colmap": {"camera": "PINHOLE 1280 960 1400 1400 640 480"},
    "rtklib_pos": {"lever_m": (0.1, 0.0, 0.0)},
}


@pytest.mark.parametrize("name", sorted(EXPORTS.keys() - {"image_tags", "colmap_priors"}))
def test_the_same_export_is_the_same_bytes(name: str, tmp_path: Path) -> None:
    """Oracle: the files of a first export; so the same command may be repeated without --force."""
    scene = make_scene().eo
    target = ExportFrame("EPSG:32632") if EXPORTS[name].frames == ("projected",) else ExportFrame()
    files = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        export(scene, name, folder / EXPORTS[name].product, target, **OPTIONS.get(name, {}))
        own = (path for path in folder.rglob("*") if path.is_file())
        files.append({str(path.relative_to(folder)): path.read_bytes() for path in own})
    assert files[0] == files[1]
    assert files[0]
