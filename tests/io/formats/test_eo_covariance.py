"""eo_covariance.npz: what is written is read, and a file that does not belong is refused."""

import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from format_pages import on_page

from insgnss.base.errors import InputError
from insgnss.io.formats.orientation.eo_covariance import (
    read_common_errors,
    read_eo_covariance,
    write_eo_covariance,
)
from insgnss.records import ExteriorOrientation
from insgnss.records.strips import CommonErrors, StripCovariance

N = 9
STRIPS = (np.arange(1, 5), np.arange(5, 8))  # images 0 and 8 are in none
SIGMA = np.array([3e-3, 3e-3, 4e-3, 1e-4, 1e-4, 1e-3])


def covariance(rows: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(int(rows[0]))
    A = rng.standard_normal((6 * rows.size, 6 * rows.size)) + 3.0 * np.tile(
        np.eye(6), (rows.size, rows.size)
    )
    scale = np.tile(SIGMA, rows.size)
    return A @ A.T * np.outer(scale, scale)


def cameras_at(cov: np.ndarray) -> ExteriorOrientation:
    n = len(cov)
    return ExteriorOrientation(
        images=tuple(f"{k}.tif" for k in range(n)),
        time=2.0 * np.arange(n),
        gps_week=2008,
        origin=np.array([0.81, 0.11, 0.0]),
        position_m=np.zeros((n, 3)),
        C_mc=np.tile(np.eye(3), (n, 1, 1)),
        cov=cov,
        cross=None,
        boresight=np.eye(3),
        camera_from_body=np.eye(3),
    )


@pytest.fixture
def written(tmp_path: Path) -> tuple[ExteriorOrientation, tuple[StripCovariance, ...], Path]:
    given = tuple(StripCovariance(rows, covariance(rows)) for rows in STRIPS)
    cov = np.tile(np.diag(SIGMA**2), (N, 1, 1))
    for strip in given:
        for a, row in enumerate(strip.rows):
            cov[row] = strip.blocks[a, a]
    eo = cameras_at(cov)
    write_eo_covariance(eo, given, tmp_path / "eo_covariance.npz")
    return eo, given, tmp_path / "eo_covariance.npz"


def test_what_is_written_is_read(written, tmp_path: Path) -> None:
    """Oracle: the records, bit by bit; numpy on the file as its page says; the same bytes twice."""
    eo, given, path = written
    for found, strip in zip(read_eo_covariance(path, eo), given, strict=True):
        np.testing.assert_array_equal(found.rows, strip.rows)
        np.testing.assert_array_equal(found.cov, strip.cov)
    with np.load(path, allow_pickle=False) as file:
        assert list(file["images"]) == list(eo.images)
        assert file["strip"].tolist() == [-1, 0, 0, 0, 0, 1, 1, 1, -1]
        assert file["cov_1"].shape == (18, 18)
    write_eo_covariance(eo, given, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"again.npz", "eo_covariance.npz"}
    write_eo_covariance(eo[:0], (), tmp_path / "none.npz")
    assert read_eo_covariance(tmp_path / "none.npz", eo[:0]) == ()


def test_the_file_is_never_whole_in_memory(tmp_path: Path) -> None:
    """Oracle: bytes allocated at once, counted: one strip's, not those of all eight."""
    strips = tuple(StripCovariance(np.arange(40 * k, 40 * k + 40), np.eye(240)) for k in range(8))
    eo = cameras_at(np.tile(np.eye(6), (320, 1, 1)))
    tracemalloc.start()
    write_eo_covariance(eo, strips, tmp_path / "eo_covariance.npz")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * strips[0].cov.nbytes


def test_a_choice_of_images_has_its_blocks(written) -> None:
    """Oracle: blocks of the whole, by name."""
    eo, given, path = written
    first, second = read_eo_covariance(path, eo[["4.tif", "2.tif", "6.tif", "0.tif"]])
    assert first.rows.tolist() == [0, 1]
    assert second.rows.tolist() == [2]
    np.testing.assert_array_equal(first.blocks[0, 1], given[0].blocks[3, 1])
    np.testing.assert_array_equal(first.blocks[1, 1], given[0].blocks[1, 1])
    np.testing.assert_array_equal(second.cov, given[1].blocks[1, 1])
    assert read_eo_covariance(path, eo[[0, 8]]) == ()


def test_common_errors_are_read_by_name_where_the_file_has_them(written, tmp_path: Path) -> None:
    """Oracle: the record, bit by bit; None of a file of before; the page's array on the file."""
    eo, given, path = written
    assert read_common_errors(path, eo) is None
    factor = np.full((N, 6, 2), 1e-6) * (1.0 + np.arange(N))[:, None, None]
    factor[5:, :, 1] = 0.0
    segment = np.repeat([0, 1], [5, 4])
    write_eo_covariance(eo, given, path, CommonErrors(segment, factor))
    found = read_common_errors(path, eo)
    np.testing.assert_array_equal(found.factor, factor)
    np.testing.assert_array_equal(found.segment, segment)
    assert len(read_eo_covariance(path, eo)) == 2
    part = read_common_errors(path, eo[["4.tif", "2.tif", "6.tif"]])
    np.testing.assert_array_equal(part.factor, factor[[4, 2, 6]])
    assert part.segment.tolist() == [0, 0, 1]
    rows = np.array([0, 1])
    A = part.factor[:2].reshape(12, 2)
    np.testing.assert_allclose(part.rest(rows, np.eye(12)), np.eye(12) - A @ A.T, rtol=1e-15)
    with np.load(path) as file:
        content = {name: file[name] for name in file.files}
    assert content["common"].shape == (N, 6, 2)
    large = factor.copy()
    large[3, 0, 0] = 1.01 * np.sqrt(eo.cov[3, 0, 0])
    for change, message in (
        ({"common": factor[:3]}, r"common: shape \(3, 6, 2\) of 9 images"),
        ({"common": large}, r"image 3\.tif shares with other images exceeds its cov6"),
        ({"common": factor * np.nan}, "is not finite"),
        ({"segment": segment - 1}, "a segment number from 0"),
        ({"segment": None}, "no segment; process the flight again"),
    ):
        other = {k: v for k, v in (content | change).items() if v is not None}
        np.savez(tmp_path / "other.npz", **other)
        with pytest.raises(InputError, match=message):
            read_common_errors(tmp_path / "other.npz", eo)


def test_a_file_of_another_run_is_refused(written) -> None:
    """Oracle: the page; a variance that differs by 1e-7, an image of another name."""
    eo, _, path = written
    message = on_page("eo_covariance", "message").strip()
    other = eo.cov.copy()
    other[3] *= 1.0 + 1e-7
    with pytest.raises(InputError, match=re.escape(message)):
        read_eo_covariance(path, replace(eo, cov=other))
    named = replace(eo, images=("a.tif", *eo.images[1:]))
    with pytest.raises(InputError, match=r"this eo\.json: image a\.tif is not in it; take the two"):
        read_eo_covariance(path, named)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": np.array("other")}, "is no covariance of strips; give the eo_covariance.npz"),
        ({"format_version": np.array(2)}, "format_version 2, this version reads 1; process"),
        ({"strip": None}, "no strip; process the flight again"),
        ({"cov_1": None}, "no cov_1; process the flight again"),
        ({"strip": np.zeros(3, dtype=int)}, "3 strip numbers of 9 images"),
        ({"cov_0": np.eye(6)}, r"cov_0: shape \(6, 6\) of 4 images"),
        ({"cov_0": np.full((24, 24), np.nan)}, "value in row 0 is not finite"),
        ({"cov_0": np.full((24, 24), "1.0")}, "a value is not what the format asks for"),
        ({"strip": np.array([-1, 0, 0, 0, 0, 1, 1, 1, -1.4])}, "a value is not what"),
    ],
)
def test_what_is_no_such_file_is_refused(written, change, message) -> None:
    """Oracle: data_specs/eo_covariance.md."""
    eo, _, path = written
    with np.load(path) as file:
        content = {name: file[name] for name in file.files} | change
    np.savez(path, **{name: value for name, value in content.items() if value is not None})
    with pytest.raises(InputError, match=message):
        read_eo_covariance(path, eo)


def test_files_that_are_no_archives_are_refused(written, tmp_path: Path) -> None:
    """Oracle: every length of a file that is cut off, text, a single array, nothing."""
    eo, _, path = written
    whole = path.read_bytes()
    for size in range(0, len(whole), 997):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match="is no whole numpy archive"):
            read_eo_covariance(path, eo)
    path.write_text("{}")
    with pytest.raises(InputError, match="is no whole numpy archive"):
        read_eo_covariance(path, eo)
    np.save(tmp_path / "a.npy", np.eye(3))
    with pytest.raises(InputError, match="is no whole numpy archive"):
        read_eo_covariance(tmp_path / "a.npy", eo)
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_eo_covariance(tmp_path / "missing.npz", eo)
