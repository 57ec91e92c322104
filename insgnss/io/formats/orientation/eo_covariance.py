"""eo_covariance.npz: the covariance of all poses of a flight line at once, and the errors that all
lines share, beside eo.json; data_specs/eo_covariance.md.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, legible
from ....base.inputs import open_bytes, readable
from ....base.output.staging import staged_path
from ....base.unpacking import check_archive
from ....records import ExteriorOrientation
from ....records.rows import covariance_of_rows
from ....records.strips import CommonErrors, StripCovariance
from ..text.text import Source

FILE = "eo_covariance.npz"
COVARIANCE_FORMAT = "insgnss strip covariance"
FORMAT_VERSION = 1  # version of the arrays in the file: the reader refuses another one
NONE = -1  # strip of an image that is in none: rows count from 0
AGAIN = "process the flight again"
SMALL_ARRAYS = ("format", "format_version", "images", "segment", "common")
PART_TOLERANCE = 1e-6  # share of a variance by which a part of it may exceed it: rounding
AGREEMENT = 1e-9  # share of the sigmas between a strip's block and cov6: rounding


def write_eo_covariance(
    eo: ExteriorOrientation,
    strips: Sequence[StripCovariance],
    path: Source,
    common: CommonErrors | None = None,
) -> None:
    """Write the file, the same bytes for the same content.

    Parameters
    ----------
    eo : ExteriorOrientation
        The images.
    strips : sequence of StripCovariance
        The strips, of which no two have an image in common.
    path : path
        The file.
    common : CommonErrors, optional
        The errors that all strips share.
    """
    number = np.full(len(eo), NONE, dtype=np.int64)
    for k, strip in enumerate(strips):
        number[strip.rows] = k
    arrays: dict[str, Any] = {
        "format": np.array(COVARIANCE_FORMAT),
        "format_version": np.array(FORMAT_VERSION),
        "images": np.array(eo.images),
        "strip": number,
    }
    arrays |= {f"cov_{k}": strip.cov for k, strip in enumerate(strips)}
    if common is not None:
        arrays |= {"segment": common.segment, "common": common.factor}
    with staged_path(path) as work, work.open("wb") as stream:  # not in memory: up to 256 MB
        np.savez(stream, allow_pickle=False, **arrays)


def read_eo_covariance(path: Source, eo: ExteriorOrientation) -> tuple[StripCovariance, ...]:
    """Read the covariances of the images of an orientation.

    Parameters
    ----------
    path : path
        The file.
    eo : ExteriorOrientation
        The images of its eo.json, all of them or a choice.

    Returns
    -------
    tuple of StripCovariance
        The strips that have images in `eo`, of these images alone.

    Raises
    ------
    InputError
        The file cannot be read, is another one, or does not belong to these images.
    """
    content = _content(path)
    with refusing(path, AGAIN):
        images = [str(name) for name in content["images"]]
        number = content["strip"].astype(np.int64, casting="safe")
        if number.shape != (len(images),):
            raise ValueError(f"{number.size} strip numbers of {len(images)} images")
        in_file = _rows_in_file(path, images, eo)
        strips = []
        for k in range(int(number.max(initial=NONE)) + 1):
            whole = np.flatnonzero(number == k)
            rows = np.flatnonzero(np.isin(in_file, whole))
            if rows.size:
                cov = content[f"cov_{k}"].astype(np.float64, casting="safe")
                if cov.shape != (6 * whole.size, 6 * whole.size):
                    raise ValueError(f"cov_{k}: shape {cov.shape} of {whole.size} images")
                index = np.searchsorted(whole, in_file[rows])
                strips.append(StripCovariance(rows, covariance_of_rows(cov, index)))
    for strip in strips:
        _refuse_other_covariances(path, eo, strip)
    return tuple(strips)


def read_common_errors(path: Source, eo: ExteriorOrientation) -> CommonErrors | None:
    """Read the errors that all strips share, of the images of an orientation.

    Parameters
    ----------
    path : path
        The file.
    eo : ExteriorOrientation
        The images of its eo.json, all of them or a choice.

    Returns
    -------
    CommonErrors or None
        The errors; None of a file that has none, such as an older one.

    Raises
    ------
    InputError
        The file cannot be read, is another one, or does not belong to these images.
    """
    content = _content(path, SMALL_ARRAYS)
    if "common" not in content:
        return None
    with refusing(path, AGAIN):
        images = [str(name) for name in content["images"]]
        segment = content["segment"].astype(np.int64, casting="safe")
        factor = content["common"].astype(np.float64, casting="safe")
        if factor.shape[:2] != (len(images), 6) or segment.shape != (len(images),):
            raise ValueError(f"common: shape {factor.shape} of {len(images)} images")
        rows = _rows_in_file(path, images, eo)
        common = CommonErrors(segment[rows], factor[rows])
    variance = np.diagonal(eo.cov, axis1=1, axis2=2)
    too_large = (common.factor**2).sum(axis=2) > variance * (1.0 + PART_TOLERANCE)
    if (excessive := too_large.any(axis=1)).any():
        name = eo.images[int(np.argmax(excessive))]
        raise _foreign(
            path, f"the covariance that image {name} shares with other images exceeds its cov6"
        )
    return common


@contextmanager
def refusing(path: Source, advice: str) -> Iterator[None]:
    """Turn what is missing or of another kind into a refusal of the file."""
    try:
        yield
    except KeyError as error:
        raise InputError.in_file(path, f"no {error.args[0]}; {advice}") from None
    except (TypeError, ValueError) as error:
        message = f"a value is not what the format asks for ({error}); {advice}"
        raise InputError.in_file(path, message) from None


@contextmanager
def opened_archive(path: Source, damaged: str) -> Iterator[Any]:
    """Open an archive of numpy whose content may be taken; InputError says `damaged`."""
    with (
        readable(path),
        legible(path, damaged, OSError),
        open_bytes(path) as stream,
        np.load(stream, allow_pickle=False) as file,
    ):
        check_archive(path, file.zip)
        yield file


def _rows_in_file(
    path: Source, images: Sequence[str], eo: ExteriorOrientation
) -> NDArray[np.int64]:
    """Return the row in the file of each image of the orientation."""
    file_row = {name: row for row, name in enumerate(images)}
    if missing := [name for name in eo.images if name not in file_row]:
        raise _foreign(path, f"image {missing[0]} is not in it")
    return np.array([file_row[name] for name in eo.images], dtype=np.int64)


def _foreign(path: Source, why: str) -> InputError:
    """Return the refusal of a file that does not belong to the orientation."""
    message = (
        f"does not belong to this eo.json: {why}; take the two files of one run (`insgnss process`"
        " writes both), or remove this one"
    )
    return InputError.in_file(path, message)


def _refuse_other_covariances(
    path: Source, eo: ExteriorOrientation, strip: StripCovariance
) -> None:
    """Raise InputError where blocks on the diagonal are not those of the orientation."""
    m, cov = strip.rows.size, eo.cov[strip.rows]
    of_strip = strip.blocks[np.arange(m), np.arange(m)]
    sigma = np.sqrt(np.maximum(np.diagonal(cov, axis1=1, axis2=2), 0.0))
    limit = AGREEMENT * sigma[:, :, None] * sigma[:, None, :]
    if (differs := (np.abs(of_strip - cov) > limit).any(axis=(1, 2))).any():
        name = eo.images[int(strip.rows[int(np.argmax(differs))])]
        raise _foreign(path, f"the covariance of image {name} differs from its cov6 in eo.json")


def _content(path: Source, names: Sequence[str] | None = None) -> dict[str, NDArray[Any]]:
    """Return arrays of the file, once it is clear that it is one of this format.

    names : those that are wanted, if they are there; by default all.
    """
    with opened_archive(path, f"is no whole numpy archive; is it an {FILE}?") as file:
        wanted = [name for name in file.files if names is None or name in names]
        content = {name: file[name] for name in wanted}
    if str(content.get("format")) != COVARIANCE_FORMAT:
        raise InputError.in_file(
            path, f"is no covariance of strips; give the {FILE} of an output directory"
        )
    if (version := content.get("format_version")) != FORMAT_VERSION:
        raise InputError.in_file(
            path, f"format_version {version}, this version reads {FORMAT_VERSION}; {AGAIN}"
        )
    return content
