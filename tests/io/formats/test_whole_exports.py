"""Exports of several files on a disk that is full, and from images that are broken: what was there
stays, every file of it.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ba_scene import block
from PIL import Image

from insgnss.base.errors import InputError, UsageError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.io.formats import EXPORTS
from insgnss.records import ExteriorOrientation

resource = pytest.importorskip("resource")  # not on Windows
CAMERA = "PINHOLE 5120 3840 5607 5607 2560 1920"
OPTIONS: dict[str, dict[str, Any]] = {
    "colmap": {"camera": CAMERA},
    "opf": {"camera": CAMERA, "pixel_size_um": 3.3},
}
SEVERAL = (
    *("colmap", "opf", "micmac_xml", "image_tags", "metashape_offset", "opensfm"),
    "geopackage",
)
LIMITS = (0, 300, 700, 1500, 2500)  # bytes a file, behind which the system refuses to write


@contextmanager
def full(limit: int) -> Iterator[None]:
    """Let the system refuse to write behind so many bytes of any file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def content(root: Path) -> dict[str, bytes]:
    return {str(p.relative_to(root)): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def photographs(eo: ExteriorOrientation, folder: Path) -> Path:
    folder.mkdir()
    for image in eo.images:
        Image.fromarray(np.zeros((40, 40), dtype=np.uint8)).save(folder / image)
    return folder


@pytest.mark.parametrize("name", SEVERAL)
def test_a_full_disk_leaves_the_export_before_or_none(name: str, tmp_path: Path) -> None:
    """Oracle: the system's limit of a file's size; bytes of the export before."""
    eo = replace(block(), cross=np.zeros((2, 6, 6)))
    later = replace(eo, position_m=eo.position_m + 5.0)
    options = OPTIONS.get(name, {})
    if name == "image_tags":
        options = {"images": str(photographs(eo, tmp_path / "photographs"))}
    target = ExportFrame("EPSG:32632") if name == "opf" else ExportFrame()
    out = tmp_path / "out"
    out.mkdir()
    path = out / EXPORTS[name].product
    refused = 0
    for present in (False, True):
        before = content(out)
        for limit in LIMITS:
            error = ""
            try:
                with full(limit):
                    export(later, name, path, target, **options)
            except UsageError as refusal:
                error = str(refusal)
            if not error:
                break
            refused += 1
            assert "cannot be written" in error
            assert "\n" not in error
            assert content(out) == before, limit
            assert present or not list(out.iterdir())
        if not present:
            for file in sorted(out.rglob("*"), reverse=True):
                file.rmdir() if file.is_dir() else file.unlink()
        export(eo, name, path, target, **options)
    assert refused >= 4
    export(later, name, path, target, **options)
    assert content(out).keys() == before.keys()
    assert content(out) != before


def test_a_broken_image_leaves_the_copies_before(tmp_path: Path) -> None:
    """Oracle: the bytes of the copies before."""
    eo = replace(block(), cross=np.zeros((2, 6, 6)))
    images = photographs(eo, tmp_path / "photographs")
    export(eo, "image_tags", tmp_path / "out", None, images=str(images))
    before = content(tmp_path / "out")
    assert len(before) == len(eo.images)
    (images / eo.images[-1]).write_bytes(b"\xff\xd8\xff\xe1\x40\x00Exif")
    later = replace(eo, position_m=eo.position_m + 5.0)
    with pytest.raises(InputError, match=eo.images[-1]):
        export(later, "image_tags", tmp_path / "out", None, images=str(images))
    assert content(tmp_path / "out") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "photographs"]
