"""The axes of an IMU in words: the body directions of its x, y and z.

The body frame b is x forward, y right, z down. A word names a direction of it, so column k of

    C_b_imu = [dir(word_1)  dir(word_2)  dir(word_3)]                                       (A.1)

is the k-th IMU axis in b, and ``v_b = C_b_imu @ v_imu``. The axes must be a right-handed triple,
det C_b_imu = +1, of which there are 24. A left-handed one has no meaning for angular rates (a
sensor of that kind has a sign error in its data sheet).
"""

import numpy as np

from ..base.errors import InputError, near
from .rotation import Array

DIRECTIONS: dict[str, tuple[int, int]] = {
    "forward": (0, 1),
    "backward": (0, -1),
    "back": (0, -1),
    "right": (1, 1),
    "left": (1, -1),
    "down": (2, 1),
    "up": (2, -1),
}
"""Body axis (0 forward, 1 right, 2 down) and sense of each word."""

_LINES = ("forward or backward", "right or left", "down or up")


def parse_axes(text: str) -> Array:
    """Return the matrix that takes components in IMU axes into body forward-right-down.

    Parameters
    ----------
    text : str
        The body directions of the IMU's x, y and z, such as ``"right backward down"``, with blanks
        or commas between.

    Returns
    -------
    C_b_imu : ndarray, shape (3, 3)
        A signed permutation with determinant +1; ``v_b = C_b_imu @ v_imu``.

    Raises
    ------
    InputError
        Where a word is unknown, there are not three words, two of them lie along one line, or the
        triple is left-handed (the message gives the right-handed one).
    """
    named = text.lower().replace(",", " ").split()
    for word in named:
        if word not in DIRECTIONS:
            raise InputError.of_value(
                f"axes {text!r}", f"{word!r} is no direction; {near(word, DIRECTIONS)}"
            )
    if len(named) != 3:
        raise InputError.of_value(
            f"axes {text!r}",
            f"{len(named)} directions, expected 3 (of the IMU's x, y and z), e.g."
            " 'forward right down'",
        )
    C_b_imu = np.zeros((3, 3))
    for k, word in enumerate(named):
        line, sense = DIRECTIONS[word]
        C_b_imu[line, k] = sense  # (A.1)
    missing = [_LINES[line] for line in range(3) if not C_b_imu[line].any()]
    if missing:
        raise InputError.of_value(
            f"axes {text!r}",
            f"two directions lie along one line and {' and '.join(missing)} is missing",
        )
    if np.linalg.det(C_b_imu) < 0:
        x, y, _ = named
        right_handed = f"{x} {y} {_word(np.cross(C_b_imu[:, 0], C_b_imu[:, 1]))}"
        raise InputError.of_value(
            f"axes {text!r}",
            f"left-handed (determinant -1); with x {x} and y {y} it would be {right_handed!r}",
        )
    return C_b_imu


def axes_words(C_b_imu: Array) -> str:
    """Return the words of the axes of an IMU, which `parse_axes` reads.

    Parameters
    ----------
    C_b_imu : ndarray, shape (3, 3)
        A signed permutation.

    Returns
    -------
    str
        The body directions of x, y and z, such as ``"right backward down"``.
    """
    return " ".join(map(_word, C_b_imu.T))


def _word(direction: Array) -> str:
    """Word for a unit vector along a body axis."""
    line = int(np.argmax(np.abs(direction)))
    return next(
        word
        for word, (of, sense) in DIRECTIONS.items()
        if of == line and sense == np.sign(direction[line])
    )
