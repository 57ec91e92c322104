"""Image observations of BINGO, data_specs/bingo.md.

    image [camera]
    point x y
    ...
    -99

Photo coordinates count from the image's centre, x right and y up, in millimetres or micrometres.
Files in pixels, as ODyN has them, count from the outer corner of the upper left pixel, x right and
y down. That y runs up, and that the image's centre rather than the principal point is meant, no
file of the program could confirm.
"""

from dataclasses import replace

import numpy as np

from ....base.errors import DataError, InputError, near
from ..text.layout import quote
from ..text.text import Source, decode_text, numbered_lines
from ..text.text import number as number_in
from .image_points import SIGMA_PX, positive_sigma
from .measured_block import MeasuredBlock, check_once, file_names, image_points, of_table

END_MARK = "-99"
MICROMETRES = {"mm": 1e3, "um": 1.0, "px": 0.0}  # micrometres


def read_bingo(
    path: Source,
    sigma_px: float = SIGMA_PX,
    unit: str = "mm",
    pixel_um: float | None = None,
    width: int | None = None,
    height: int | None = None,
) -> MeasuredBlock:
    """Read image observations.

    Parameters
    ----------
    path : path
        The file.
    sigma_px : float
        Standard deviation of the observations, pixels.
    unit : str
        "mm" or "um", y up from the image's centre; "px", y down from the upper left corner.
    pixel_um : float
        Size of a pixel, micrometres; needed but for "px".
    width, height : int
        Size of the images, pixels; needed but for "px".

    Returns
    -------
    MeasuredBlock
        The observations; without cameras, poses and ground points. Images have the names of the
        file, which have no ending as a rule.

    Raises
    ------
    InputError
        A line that is neither head nor observation, an image or a point that is there twice, with
        file and line.
    DataError
        A unit that is unknown, a size that is missing, a standard deviation that is not positive.
    """
    positive_sigma(sigma_px, "BINGO")
    if unit not in MICROMETRES:
        raise DataError(f"BINGO: unit {unit!r}; {near(unit, MICROMETRES)}")
    if unit != "px" and not (pixel_um and width and height and min(pixel_um, width, height) > 0):
        raise DataError(
            f"BINGO: coordinates in {unit} need pixel_um, width and height of the camera; name them"
        )
    images: list[str] = []
    lines, image_row, point, xy = [], [], [], []
    inside, ended, line, within = False, False, 0, 0
    for line, row in numbered_lines(decode_text(path)):
        fields = row.split()
        if fields[0] == END_MARK:
            inside, ended = False, True
        elif len(fields) <= 2:
            if fields[0] in images:
                raise InputError.at_line(
                    path, line, f"image {quote(fields[0])} occurs in two blocks; join them into one"
                )
            images.append(fields[0])
            within = line if inside and not within else within
            inside = True
        elif inside:
            lines.append(line)
            image_row.append(len(images) - 1)
            point.append(fields[0])
            xy.append([number_in(word, path, line) for word in fields[1:3]])
        else:
            raise InputError.at_line(
                path,
                line,
                f"{quote(row)}: stands before the first image; begin each block with image and"
                " camera",
            )
    if ended and (within or inside):
        problem = f"the previous image lacks its final {END_MARK}, or this line lacks a number"
        if inside:
            problem = f"truncated: the file ends before the {END_MARK} of image {quote(images[-1])}"
        raise InputError.at_line(path, line if inside else within, problem)
    if not image_row:
        raise InputError.in_file(
            path,
            "no image observation; write a block of each image: image and camera, lines point x y,"
            " -99",
        )
    check_once(path, lines, [images[k] for k in image_row], point)
    uv = np.array(xy)
    if unit != "px":
        scale = MICROMETRES[unit] / float(pixel_um or 1.0)
        uv = 0.5 * np.array([width, height], dtype=np.float64) + scale * uv * (1.0, -1.0)
    names = file_names(images, path)
    measured, _ = image_points(names, image_row, point, uv, np.full(len(image_row), sigma_px))
    unverified = "BINGO: y is taken to run upwards from the image centre, which is unverified"
    return replace(of_table(measured), notes=() if unit == "px" else (unverified,))
