"""Options of formats as the verb gets them: taken as the writer means them, or refused in one line
with what to give instead.
"""

from pathlib import Path

import numpy as np
import pytest

from insgnss.cli import main
from insgnss.flight.exporting.options import typed_options
from insgnss.flight.proof.scene import make_scene
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.orientation.eo_json import write_eo_json

CAMERA = "camera=PINHOLE 1280 960 1400 1400 640 480"


@pytest.fixture
def eo(tmp_path: Path) -> Path:
    """The master of four images."""
    write_eo_json(make_scene().eo, tmp_path / "eo.json")
    return tmp_path / "eo.json"


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (
            ["generic_ascii", "--set", "decimals_m=abc"],
            "generic_ascii: decimals_m = 'abc': must be a whole number",
        ),
        (
            ["generic_ascii", "--set", "decimals_m=2.5"],
            "generic_ascii: decimals_m = '2.5': must be a whole number",
        ),
        (
            ["generic_ascii", "--set", "decimals_m=-3"],
            "decimals_m -3 is no whole number from 0 to 12",
        ),
        (
            ["generic_ascii", "--set", "decimals_m=400"],
            "decimals_m 400 is no whole number from 0 to 12",
        ),
        (
            ["generic_ascii", "--set", "decimals_angle=13"],
            "decimals_angle 13 is no whole number from 0 to 12",
        ),
        (
            ["inpho_prj", "--set", "focal_mm=abc", "--set", "ground_m=500"],
            "inpho_prj: focal_mm = 'abc': must be a number",
        ),
        (
            ["inpho_prj", "--set", "focal_mm=nan", "--set", "ground_m=500"],
            "inpho_prj: focal_mm = 'nan': must be a number",
        ),
        (
            ["inpho_prj", "--set", "focal_mm=35", "--set", "ground_m=inf"],
            "inpho_prj: ground_m = 'inf': must be a number",
        ),
        (["tum", "--set", "time=noon"], "tum: time = 'noon': must be tow or unix"),
        (["g2o", "--set", "max_gap_s=x"], "g2o: max_gap_s = 'x': must be a number"),
        (
            ["relative", "--set", "noise=navchip", "--set", "gap_s=x"],
            "relative: gap_s = 'x': must be a number",
        ),
        (
            ["image_tags", "--set", "rtk_flag=fix"],
            "image_tags: rtk_flag = 'fix': must be a whole number",
        ),
        (["inpho_prj"], "such as --set focal_mm=35 --set ground_m=500"),
        (["colmap"], "--set camera='PINHOLE 5120 3840 5607 5607 2560 1920'"),
        (["opf", "--set", CAMERA, "--crs", "EPSG:32632"], "--set pixel_size_um=3.76"),
        (
            ["bentley", "--set", "width_px=100"],
            "--set width_px=5120 --set height_px=3840 --set focal_px=5607",
        ),
        (["image_tags"], "--set images=DIR"),
        (["geopackage", "--out", "{}/x.db"], "such as --out eo.gpkg"),
    ],
)
def test_wrong_options_are_one_line(
    argv: list[str], says: str, eo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the exit code of a wrong command, the message, and the directory's listing."""
    assert main(["export", str(eo), *(word.format(tmp_path) for word in argv), "-q"]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["eo.json"]


def test_options_are_of_the_type_that_the_writer_takes() -> None:
    """Oracle: the annotations of the writers, read by eye."""
    assert typed_options(
        "generic_ascii", EXPORTS["generic_ascii"], {"decimals_m": "3", "columns": "7"}
    ) == {
        "decimals_m": 3,
        "columns": "7",
    }
    given = {"pixel_size_um": "4", "images": "2018"}
    found = typed_options("opf", EXPORTS["opf"], given)
    assert found == {"pixel_size_um": 4.0, "images": "2018"}
    assert isinstance(found["pixel_size_um"], float)
    assert typed_options("relative", EXPORTS["relative"], {"gap_s": "5", "form": "camera"}) == {
        "gap_s": 5.0,
        "form": "camera",
    }
    assert typed_options("metashape", EXPORTS["metashape"], {"unit": "gon"}) == {
        "unit": "gon"
    }  # refused by the export


def test_a_folder_named_like_a_number(eo: Path, tmp_path: Path) -> None:
    """Oracle: the URIs of the project."""
    out = tmp_path / "project"
    options = ["--set", CAMERA, "--set", "pixel_size_um=5.5", "--set", "images=2018"]
    assert (
        main(["export", str(eo), "opf", "--crs", "EPSG:32632", *options, "--out", str(out), "-q"])
        == 0
    )
    assert '"2018/8001.tif"' in (out / "camera_list.json").read_text()


def test_the_help_lists_the_options(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the registry."""
    assert main(["export", "--help"]) == 0
    listed = {
        line.split()[0]: line
        for line in capsys.readouterr().out.partition("formats:\n")[2].splitlines()
        if line.strip()
    }
    for name, form in EXPORTS.items():
        assert listed[name].endswith(f"(--set {', '.join(form.options)})") == bool(form.options)


OLDER = {
    "micmac_xml": ([], "Orientation-9999.tif.xml"),
    "colmap": (["--set", CAMERA], "images.bin"),
    "opf": (
        ["--set", CAMERA, "--set", "pixel_size_um=5.5", "--crs", "EPSG:2056"],
        "projected_input_cameras.json",
    ),
    "image_tags": (["--set", "images={}/photos"], "9999.tif"),
}


@pytest.mark.parametrize("name", OLDER)
def test_an_older_result_is_not_mixed_with_this_one(
    name: str, eo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the listing of the directory, untouched; written again into the own result, and into
    one without such files.
    """
    settings, stale = OLDER[name]
    (tmp_path / "photos").mkdir()
    for image in make_scene().eo.images:
        (tmp_path / "photos" / image).write_bytes(_jpeg())
    argv = ["export", str(eo), name, *(word.format(tmp_path) for word in settings), "-q"]
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / stale).touch()
    assert main([*argv, "--out", str(tmp_path / "old")]) == 2
    error = capsys.readouterr().err
    assert f"of another export ({stale}); give a new directory" in error
    assert error.count("\n") == 1
    assert [path.name for path in (tmp_path / "old").iterdir()] == [stale]
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "notes.md").touch()
    for _ in range(2):
        assert main([*argv, "--out", str(tmp_path / "new")]) == 0
    assert main([*argv, "--out", str(eo.with_name("file"))]) == 0
    (tmp_path / "x.txt").touch()
    capsys.readouterr()
    assert main([*argv, "--out", str(tmp_path / "x.txt")]) == 2
    assert "is a file, but the export writes a directory" in capsys.readouterr().err


def _jpeg() -> bytes:
    """The head of one, which is all that a writer of tags looks at."""
    return (
        b"\xff\xd8\xff\xe0\0\x10JFIF\0\1\1\0\0\1\0\1\0\0\xff\xdb\0\x43\0"
        + np.arange(1, 65, dtype=np.uint8).tobytes()
        + b"\xff\xd9"
    )
