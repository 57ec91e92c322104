"""The photographs of a directory, read one at a time."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.inputs import open_bytes
from ...io.formats.blocks.joined import match_names

PHOTOGRAPH_ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff", ".png")
# pixels of a photograph; beyond, a damaged header is more likely
LARGEST_PHOTOGRAPH_PX = 400_000_000


@dataclass(frozen=True)
class Photographs:
    """Which file is which image.

    Parameters
    ----------
    files : tuple of Path or None
        One for each image of the orientation; None where it has none.
    strangers : tuple of Path
        Photographs without pose.
    """

    files: tuple[Path | None, ...]
    strangers: tuple[Path, ...]


def photographs_in(directory: Path, images: Sequence[str]) -> Photographs:
    """Find the photographs of some images.

    Parameters
    ----------
    directory : Path
        Where they are, or in its folders.
    images : sequence of str
        Names of the images.

    Returns
    -------
    Photographs
        Their files; names are the same where they differ by directory, ending or case alone.

    Raises
    ------
    InputError
        No directory, no photograph, none of these images, or two files for one image.
    """
    if not directory.is_dir():
        raise InputError.in_file(directory, "no directory; give that of the photographs")
    paths = sorted(
        path
        for path in directory.rglob("*")
        if path.suffix.lower() in PHOTOGRAPH_ENDINGS and not path.name.startswith(".")
    )
    if not paths:
        raise InputError.in_file(
            directory, f"no photograph ({' '.join(PHOTOGRAPH_ENDINGS)}) in it or in its folders"
        )
    names = [path.name for path in paths]
    wanted = {Path(name).stem.lower() for name in images}
    for name in names:
        if names.count(name) > 1 and Path(name).stem.lower() in wanted:
            twice = [path for path in paths if path.name == name][:2]
            raise InputError(
                f"{twice[0]} and {twice[1]} have the same name; give the directory of one flight"
            )
    rows = match_names(images, names)
    if not (rows >= 0).any():
        raise InputError.in_file(
            directory,
            f"none of its {len(paths)} photographs ({names[0]}, ...) is an image of the orientation"
            f" ({images[0]}, ...); both must use the same names",
        )
    taken = set(rows[rows >= 0].tolist())
    return Photographs(
        tuple(paths[row] if row >= 0 else None for row in rows),
        tuple(path for k, path in enumerate(paths) if k not in taken),
    )


def read_grey(path: Path, size: tuple[int, int] | None = None) -> NDArray[np.float32]:
    """Read the grey values of a photograph as it is stored: its Orientation tag is not obeyed.

    Parameters
    ----------
    path : Path
        The file.
    size : tuple of int, optional
        Width and height that it must have, pixels.

    Returns
    -------
    ndarray, (h, w)
        Grey values.

    Raises
    ------
    InputError
        It cannot be read, or has another size.
    """
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with open_bytes(path) as stream, Image.open(stream) as photograph:
                _refuse_size(path, photograph.size, size, photograph.getexif().get(0x0112, 1))
                if photograph.mode[:1] in ("I", "F"):  # 16 bits and more: one channel
                    return np.asarray(photograph, dtype=np.float32)
                if photograph.format == "JPEG":
                    photograph.draft("L", photograph.size)
                return np.asarray(photograph.convert("L"), dtype=np.float32)
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            reason = str(error).replace(str(path), "").strip(" '\"") or type(error).__name__
            raise InputError.in_file(
                path, f"not a photograph that can be read ({reason}); copy it again"
            ) from None


def _refuse_size(
    path: Path, has: tuple[int, int], wanted: tuple[int, int] | None, orientation: int
) -> None:
    """Refuse a photograph of another size than the camera."""
    if has[0] * has[1] > LARGEST_PHOTOGRAPH_PX:
        raise InputError.in_file(
            path, f"{has[0]} x {has[1]} pixels are not plausible; copy it again"
        )
    if wanted is None or tuple(has) == tuple(wanted):
        return
    advice = "give the photographs as the camera took them, or the calibration for these"
    if tuple(has) == wanted[::-1]:
        advice = (
            f"it was turned (Orientation {orientation}): give the photographs as the camera took"
            " them"
        )
    raise InputError.in_file(
        path, f"{has[0]} x {has[1]} pixels, the camera has {wanted[0]} x {wanted[1]}; {advice}"
    )
