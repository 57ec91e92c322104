"""What images tell of themselves: names in order, and their own times."""

from pathlib import Path

import numpy as np
import pytest
from photographs import photograph

from insgnss.base.errors import InputError
from insgnss.io.exposures.images import image_names, image_times
from insgnss.io.exposures.naming import ImageMatch, named
from insgnss.io.formats.events.events import numbered_names
from insgnss.records import CameraEvents


def test_names_of_a_directory_are_in_the_order_of_their_numbers(tmp_path):
    """Oracle: the numbers."""
    for name in ("IMG_10.JPG", "IMG_9.JPG", "IMG_101.JPG", "notes.txt", ".hidden.jpg"):
        (tmp_path / name).touch()
    assert image_names(tmp_path) == ("IMG_9.JPG", "IMG_10.JPG", "IMG_101.JPG")
    (tmp_path / "IMG_9.ARW").touch()
    with pytest.raises(InputError, match=r"\.ARW and \.JPG; choose one by camera\.image_ending"):
        image_names(tmp_path)
    assert image_names(tmp_path, "arw") == ("IMG_9.ARW",)
    with pytest.raises(InputError, match="holds no image"):
        image_names(tmp_path, ".png")


def test_names_of_a_list_stand_as_they_are(tmp_path):
    """Oracle: the list."""
    path = tmp_path / "images.txt"
    path.write_text("\ufeff# in order\nB.tif\n\nA.tif\r\n", encoding="utf-8")
    assert image_names(path) == ("B.tif", "A.tif")
    path.write_text("A.tif\nA.tif\n")
    with pytest.raises(InputError, match=r"image 'A.tif' occurs twice"):
        image_names(path)
    with pytest.raises(InputError, match="cannot be read"):
        image_names(tmp_path / "none.txt")


def test_times_of_images_are_those_of_their_exif(tmp_path: Path) -> None:
    """Oracle: Pillow, which writes the Exif; one image without a time, or a list instead of a
    directory, tells nothing.
    """
    for name, second in {"a.jpg": 3.25, "b.dng": 5.5, "c.jpg": 7.0, "d.jpg": None}.items():
        photograph(tmp_path / name, second)
    found = image_times(tmp_path, ("a.jpg", "b.dng", "c.jpg"))
    assert found is not None
    assert found.tolist() == [0.0, 2.25, 3.75]
    assert image_times(tmp_path, ("a.jpg", "d.jpg")) is None
    (tmp_path / "e.jpg").write_bytes(b"no picture")
    assert image_times(tmp_path, ("a.jpg", "e.jpg")) is None
    assert image_times(tmp_path / "a.jpg", ("a.jpg",)) is None


@pytest.mark.parametrize("text", ["    :  :     :  :  ", "0000:00:00 00:00:00"])
def test_a_time_that_exif_calls_unknown_is_none(tmp_path: Path, text: str) -> None:
    """Oracle: Exif 2.32: an unknown date has blanks between its colons; cameras write zeros."""
    stamped(tmp_path / "a.jpg", text)
    assert image_times(tmp_path, ("a.jpg",)) is None


@pytest.mark.parametrize(
    ("text", "fraction"),
    [
        ("2018:13:04 12:00:01", "5"),
        ("2018:10:04 12:61:01", "5"),
        ("yesterday", "5"),
        ("2018:10:04 12:00:01", "5%"),
        ("2018:10:04 12:00:01", "-5"),
    ],
)
def test_a_time_that_is_written_and_is_none_is_named(
    tmp_path: Path, text: str, fraction: str
) -> None:
    """Oracle: the image and what stands there; once the times of all images were left out."""
    stamped(tmp_path / "a.jpg", text, fraction)
    with pytest.raises(InputError, match=f"a.jpg: DateTimeOriginal '{text}' .*'{fraction}' is no"):
        image_times(tmp_path, ("a.jpg",))


def test_raw_files_of_another_kind_have_no_time(tmp_path: Path) -> None:
    """Oracle: how files of Panasonic and Olympus begin, which are no TIFF."""
    for head in (b"IIU\0", b"IIRO", b"MMOR"):
        (tmp_path / "a.rw2").write_bytes(head + bytes(64))
        assert image_times(tmp_path, ("a.rw2",)) is None


def stamped(path: Path, text: str, fraction: str = "") -> None:
    """A picture of one pixel with these texts for DateTimeOriginal and its fraction."""
    image = pytest.importorskip("PIL.Image")
    exif = image.Exif()
    exif.get_ifd(0x8769).update({0x9003: text, 0x9291: fraction})
    image.new("L", (1, 1)).save(path, exif=exif)


def exposed(times):
    """Events with numbers alone."""
    names, told = numbered_names(len(times))
    return CameraEvents(names, 1000.0 + np.asarray(times), 2008, "rover.rnx", (told,))


def test_images_of_a_directory_are_matched_by_their_own_times_also_where_counts_agree(
    tmp_path: Path,
) -> None:
    """Oracle: of ten exposures the eighth event and the second image were taken away; the names are
    letters, without gaps to see. Without times, from a list of the names, the counts are all there
    is."""
    shots = np.round(np.cumsum([2.0, 2.3, 1.9, 2.1, 2.2, 1.8, 2.4, 2.0, 1.7, 2.1]), 3)
    letters = [f"{letter}.jpg" for letter in "acdefghij"]
    for name, second in zip(letters, np.delete(shots, 1), strict=True):
        photograph(tmp_path / name, second)
    with pytest.raises(
        InputError,
        match=(
            r"9 camera events and 9 images, but .* event 2 and no event to image h\.jpg; .*'h\.jpg'"
        ),
    ) as told:
        named(exposed(np.delete(shots, 7)), ImageMatch(tmp_path))
    assert "give a list of the names" in str(told.value)
    found = named(
        exposed(np.delete(shots, 7)), ImageMatch(tmp_path, skip_events=(2,), skip_images=("h.jpg",))
    )
    assert found.images == tuple(name for name in letters if name != "h.jpg")
    assert found.notes == ()
    assert named(exposed(np.delete(shots, 1)), ImageMatch(tmp_path)).images == tuple(letters)
    (tmp_path / "list.txt").write_text("\n".join(letters))
    assert named(exposed(np.delete(shots, 7)), ImageMatch(tmp_path / "list.txt")).images == tuple(
        letters
    )
