"""PIX4Dmapper's geolocation with accuracies, data_specs/pix4d.md.

Where mapper expects accuracies behind angles, and what its omega, phi, kappa count from with
latitude and longitude, is not documented.
"""

import numpy as np

from ...base.files import atomic_write
from ...records import FramedOrientation
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ..orientation.exported import (
    OPK,
    angles_of,
    check_frame,
    check_names,
    frame_attitude,
    frame_words,
    one_line,
    place_form,
    places,
    plan_and_height_sigma,
    table_text,
)
from ..text.text import Source


def write_pix4d_mapper_accuracy(eo: FramedOrientation, path: Source) -> None:
    """Write as `write_pix4d_mapper` does, with horizontal and vertical accuracy at the end.

    Geographic frames are written as well, as latitude, longitude, height.
    """
    check_frame(eo, "pix4d_mapper_accuracy", PROJECTED, TANGENT, GEOGRAPHIC)
    check_names(eo.images, ",")
    opk, _ = angles_of(eo, *frame_attitude(eo), OPK)
    order = [1, 0, 2] if eo.frame.kind == GEOGRAPHIC else [0, 1, 2]
    table = np.hstack([places(eo)[:, order], np.degrees(opk), plan_and_height_sigma(eo)])
    form = f"%s,{place_form(eo, ',')}" + ",%.6f" * 3 + ",%.5f" * 2 + "\n"
    head = f"#experimental: place of the accuracies unverified; {one_line(frame_words(eo))}\n"
    atomic_write(path, table_text(head, eo.images, form, table))
