"""Left-handed axes: of two axes that are exchanged in gyros and accelerometers alike, which two.

Such readings are those of a mirror image E of the sensor. A force is a vector and a rate of turn a
pseudovector, but what the columns hold is exchanged in both alike: f' = E f, omega' = E omega with
det E = -1. No rotation takes f' to what GNSS saw; the rotation -C E' takes -f' to it, and carries
it with -omega'. So the relation finds gyros and force reversed (`is_mirrored`), whichever of the
three exchanges, single signs or all six signs it was: all differ by rotations, that is by the axes.
Each exchange is therefore tried, and recognised again as a recording of its own; the flight file's
axes tell which of the three it is.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from ...geodesy.axes import parse_axes
from ...records import Array, GnssFixes, ImuSamples
from .axes import imu_word
from .recognition import Exchange, Recognition

AXIS_PAIRS = ((0, 1), (0, 2), (1, 2))  # axes that may be exchanged
MIRRORED = "gyro -x -y -z"  # of the words of `verdict.triads_words`
# a confidence beyond which a trial explains the motion, and a claim is contradicted
SURE_OF_EXCHANGE = 0.99
AXIS_LETTERS_TURNED = "xyz"
LEFT_HANDED = "the readings are of left-handed axes"


def order(pair: tuple[int, int]) -> tuple[int, ...]:
    """Return the order of three columns in which two have changed places."""
    columns = [0, 1, 2]
    columns[pair[0]], columns[pair[1]] = pair[1], pair[0]
    return tuple(columns)


def exchange_axes(imu: ImuSamples, pair: tuple[int, int], accel_sign: int = 1) -> ImuSamples:
    """Return samples with two axes exchanged in both triads.

    Parameters
    ----------
    imu : ImuSamples
    pair : tuple of int
    accel_sign : int
        What the accelerations were multiplied by beforehand, which is taken back.
    """
    columns = list(order(pair))
    return replace(imu, gyro=imu.gyro[:, columns], accel=accel_sign * imu.accel[:, columns])


def is_mirrored(recognition: Recognition, accel_sign: int = 1) -> bool:
    """Tell whether the readings are those of left-handed axes.

    Parameters
    ----------
    recognition : Recognition
    accel_sign : int
        What the accelerations were multiplied by beforehand.
    """
    triads = recognition.finding("gyro triad")
    return (
        triads.found == MIRRORED
        and recognition.finding("force sign").confidence > 0.0
        and recognition.accel_sign * accel_sign < 0
    )


def with_exchanges(
    recognition: Recognition,
    imu: ImuSamples,
    gnss: GnssFixes,
    recogniser: Callable[[ImuSamples, GnssFixes], Recognition],
    accel_sign: int = 1,
) -> Recognition:
    """Try the exchanges of two axes on readings that look mirrored.

    Parameters
    ----------
    recognition : Recognition
        What `recogniser` says of the readings as they are.
    imu : ImuSamples
    gnss : GnssFixes
    recogniser : callable
        `recognise` or `recognise_liveliest`.
    accel_sign : int
        What the accelerations were multiplied by beforehand; the trials take it back.

    Returns
    -------
    Recognition
        With those exchanges that explain the motion, or as it was.
    """
    if not is_mirrored(recognition, accel_sign):
        return recognition
    trials = (
        Exchange(pair, recogniser(exchange_axes(imu, pair, accel_sign), gnss))
        for pair in AXIS_PAIRS
    )
    return replace(recognition, exchanges=tuple(t for t in trials if explains(t.recognition)))


def explains(recognition: Recognition) -> bool:
    """Tell whether a trial is a recording of aligned triads and specific force, for sure."""
    triads, sign = (recognition.finding(name) for name in ("gyro triad", "force sign"))
    return (
        triads.found == "aligned"
        and recognition.accel_sign > 0
        and min(triads.confidence, sign.confidence) > SURE_OF_EXCHANGE
    )


def of_axes(exchanges: Iterable[Exchange], C_b_imu: Array) -> Exchange | None:
    """Return the exchange with which the data show the axes that are claimed.

    Where they do not show which axis is forward, it is the one that keeps the vertical in place.

    Parameters
    ----------
    exchanges : iterable of Exchange
    C_b_imu : ndarray, shape (3, 3)
        The claimed axes.
    """
    for exchange in exchanges:
        trial = exchange.recognition
        if trial.axes is not None:
            if np.array_equal(parse_axes(trial.axes), C_b_imu):
                return exchange
            continue
        moved = int(np.argmax(np.abs(C_b_imu[2]))) in exchange.pair
        if trial.down == imu_word(C_b_imu[2]) and not moved:
            return exchange
    return None


def what_is_wrong(exchange: Exchange, C_b_imu: Array) -> str:
    """Say what takes the readings that the claimed axes would give into those of the file.

    Parameters
    ----------
    exchange : Exchange
        One whose trial shows the axes.
    C_b_imu : ndarray, shape (3, 3)
        The claimed axes.
    """
    axes = exchange.recognition.axes
    if axes is not None:
        F = C_b_imu.T @ parse_axes(axes) @ np.eye(3)[list(order(exchange.pair))]
        if not (F - np.diag(np.diag(F))).any():
            reversed_axes = [AXIS_LETTERS_TURNED[k] for k in range(3) if F[k, k] < 0.0]
            if len(reversed_axes) == 3:
                return "all six readings have the reversed sign"
            return f"gyro and accelerometer of {reversed_axes[0]} have the reversed sign"
    return LEFT_HANDED
