"""A calibrated mounting against the flight that takes it: camera, lens, date."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.flight.config.mounting_options import MountingSource
from insgnss.flight.processing.checks import check_mounting_files
from insgnss.geodesy.gpstime import gps_from_calendar
from insgnss.io.formats.images.exif import camera_tags
from insgnss.io.formats.orientation.mounting_file import MountingFile
from insgnss.io.options.camera_options import ImageMatch
from insgnss.records.cameras.mounting import Mounting
from insgnss.records.verdicts import CHECKS

MADE = MountingFile(
    antenna_m=np.array([0.4, 0.0, 0.0]),
    date="2018-07-06",
    camera="FC6310, 8.8 mm",
    image_size=(40, 30),
    focal_px=28.0,
)


@pytest.fixture
def images(tmp_path: Path) -> Path:
    """Two images of 40 x 30 pixels by a lens of 24 mm in 35 mm film: 24 x 50 / 43.27 = 27.7 px."""
    image = pytest.importorskip("PIL.Image")
    exif = image.Exif()
    exif[0x0110] = "FC6310"
    exif.get_ifd(0x8769).update({0xA002: 40, 0xA003: 30, 0xA405: 24})
    for name in ("1.jpg", "2.jpg"):
        image.new("L", (40, 30)).save(tmp_path / name, exif=exif)
    return tmp_path


def check(made: MountingFile, images: Path | None, flown: str = "2018-08-01") -> Any:
    from datetime import datetime

    source = MountingSource(Path("mounting.toml"), ("antenna_m",), 365.0, made)
    camera = SimpleNamespace(match=ImageMatch(images=images))
    flight: Any = SimpleNamespace(
        camera=camera, mounting_files=(source,), mounting=Mounting(antenna_m=[0.4, 0.0, 0.0])
    )
    (check,) = check_mounting_files(flight, *gps_from_calendar(datetime.fromisoformat(flown)))
    return check


def test_the_camera_of_an_image_is_read(images: Path) -> None:
    """Oracle: the tags that PIL wrote; the diagonal of film, 43.27 mm."""
    with (images / "1.jpg").open("rb") as stream:
        got = camera_tags(stream, "1.jpg")
    assert (got.model, got.image_size) == ("FC6310", (40, 30))
    assert got.focal_px == pytest.approx(24.0 * 50.0 / 43.2666, rel=1e-4)


def test_a_tag_that_is_no_number_is_named(images: Path) -> None:
    """Oracle: Exif, PixelXDimension is SHORT or LONG; such an image once had no size."""
    image = pytest.importorskip("PIL.Image")
    exif = image.Exif()
    exif.get_ifd(0x8769).update({0xA002: "forty", 0xA003: 30})
    image.new("L", (40, 30)).save(images / "1.jpg", exif=exif)
    with (
        (images / "1.jpg").open("rb") as stream,
        pytest.raises(InputError, match=r"1\.jpg: tag 40962 holds no number"),
    ):
        camera_tags(stream, "1.jpg")


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"camera": "camera 1"},
        {"camera": "camera"},
        {"camera": ""},
        {"image_size": (30, 40)},
        {"focal_px": 30.5},
        {"focal_px": None, "image_size": None, "date": ""},
        {"date": "2019-07-31"},
    ],
)
def test_a_mounting_that_fits_is_silent(images: Path, changes: dict[str, Any]) -> None:
    """Oracle: what the images and the flight say of themselves."""
    assert check(replace(MADE, **changes), images).verdict == "ok"


@pytest.mark.parametrize(
    ("changes", "flown", "words"),
    [
        ({"camera": "ILCE-7RM2"}, "2018-08-01", "the images are of 'FC6310'"),
        (
            {"image_size": (60, 40)},
            "2018-08-01",
            "image sizes of calibration and flight differ, 60 x 40 and 40 x 30 pixels",
        ),
        ({"focal_px": 40.0}, "2018-08-01", "(-31 %, limit 15 %)"),
        ({}, "2019-07-07", "is 366 days after the calibration data of 2018-07-06 (limit 365"),
        ({}, "2017-07-05", "is 366 days before the calibration data"),
        (
            {"not_determined": {"imu_m": "-"}},
            "2018-08-01",
            "the calibration did not determine imu_m",
        ),
    ],
)
def test_a_mounting_of_another_camera_or_time_is_told(
    images: Path, changes: dict[str, Any], flown: str, words: str
) -> None:
    """Oracle: the numbers that were written."""
    got = check(replace(MADE, **changes), images, flown)
    assert got.verdict == "note"
    assert words in got.found
    assert CHECKS[got.name] >= 1.0  # stands out


def test_what_cannot_be_known_is_not_told(tmp_path: Path) -> None:
    """Oracle: images without Exif, a list of names, and no images at all."""
    (tmp_path / "1.jpg").write_bytes(b"\xff\xd8\xff\xd9")
    (tmp_path / "list.txt").write_text("1.jpg\n")
    other = replace(MADE, camera="ILCE-7RM2", image_size=(6, 4), focal_px=99.0)
    for source in (tmp_path, tmp_path / "list.txt", None):
        assert check(other, source).verdict == "ok"
