"""What the exports of attitude share: names that a format can hold, and standard deviations of angles.

With psi = E d(angles) the covariance of angles is E^-1 P E^-T, P the covariance of psi in the same axes.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError, InputError

Array = NDArray[np.float64]

LEAST_COSINE = 1e-6


def check_names(images: Sequence[str], separator: str | None) -> None:
    """Refuse image names that a table with this separator (None: blanks), or a comment sign, would not give back."""
    for name in images:
        broken = any(c.isspace() for c in name) if separator is None else separator in name or name != name.strip() or "\n" in name
        if not name or broken or name.startswith(("#", "%", "!", ";", "//", '"', "'")):
            what = "blanks" if separator is None else repr(separator)
            raise InputError(
                f"image name {name!r} is empty, has {what} or begins like a comment, which this format cannot hold; rename the image"
            )


def angle_sigma(
    angles: Array, jacobian: Callable[[Array], Array], middle: int, P: Array, who: Sequence[str] | Callable[[int], str], set_name: str
) -> Array:
    """Standard deviations (n, 3), rad, of angles (n, 3) whose psi has the covariances P (n, 3, 3).

    middle : index of the angle at whose right angles the set is singular there; DataError names the first, by `who`.
    """
    flat = np.cos(angles[:, middle]) < LEAST_COSINE
    if flat.any():
        row = int(np.argmax(flat))
        name = who(row) if callable(who) else f"image {who[row]}"
        degrees = np.degrees(angles[row, middle])
        raise DataError(f"{name}: the middle angle of {set_name} is {degrees:.4f} deg, where the set is singular; export eo_json instead")
    F = np.linalg.inv(jacobian(angles))
    return np.sqrt(np.einsum("nij,njk,nik->ni", F, P, F))
