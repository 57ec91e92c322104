"""What the exports of poses share: UTC instants, true north, heights above sea level, inverses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....base.errors import DataError, InputError, UsageError
from ....base.files import lines_of
from ....geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, leap_seconds
from ....geodesy.rotation import CV_RUB
from ....records import Array, FramedOrientation
from .ascii_columns import numbers_of
from .exported import YPR, angles_of, comment_lines

EPOCH = np.datetime64("1970-01-01", "us")
LARGEST_GEOID_M = 110.0  # geoid height (m): they lie within -107 and 86 m


def unix_seconds(eo: FramedOrientation) -> Array:
    """Return Unix times (n,), s, of the exposures: UTC, that is GPST less the leap seconds."""
    gps = GPS_EPOCH_UNIX_S + WEEK_S * eo.gps_week + eo.time
    return np.asarray(gps - leap_seconds(gps - leap_seconds(gps)))


def utc(eo: FramedOrientation, unit: str = "us") -> list[str]:
    """Return the exposures in UTC, ISO 8601 with Z; `unit` is the digits kept, "us" or "ms"."""
    stamp = EPOCH + np.round(1e6 * unix_seconds(eo)).astype("timedelta64[us]")
    digits = np.datetime_as_string(stamp, unit=unit)  # type: ignore[call-overload]
    text: list[str] = np.char.add(digits, "Z").tolist()
    return text


def sentences(eo: FramedOrientation, *more: str) -> list[str]:
    """Return what a file states of itself, line by line, where it has no comments."""
    return [line.removeprefix("# ") for line in lines_of(comment_lines(eo, *more))]


def positive(value: object, name: str, unit: str) -> float:
    """Return an option that is a positive number; UsageError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < np.inf:
        raise UsageError(f"{name}: {value!r} is no positive number of {unit}")
    return float(value)


def vector(value: str | Sequence[float] | Array, name: str) -> Array:
    """Return an option of three numbers in m, or of text with commas between them.

    Raises
    ------
    UsageError
        Anything else.
    """
    try:
        v = np.array(value.split(",") if isinstance(value, str) else value, dtype=np.float64)
    except (TypeError, ValueError):
        v = np.zeros(0)
    if v.shape != (3,) or not np.isfinite(v).all():
        raise UsageError(
            f"{name}: {value!r} is not three numbers in m, such as 0.462,-0.001,-0.065"
        )
    return v


def local_covariance(eo: FramedOrientation) -> Array:
    """Return covariances (n, 6, 6) in east, north, up at the images, true north."""
    C = eo.C_fE.swapaxes(1, 2)
    J = np.zeros((len(C), 6, 6))
    J[:, :3, :3] = J[:, 3:, 3:] = C
    return J @ eo.cov @ J.swapaxes(1, 2)


def local_sigma(eo: FramedOrientation) -> Array:
    """Return standard deviations (n, 3), m, of the positions in east, north, up at the images."""
    return np.sqrt(np.diagonal(local_covariance(eo), axis1=1, axis2=2)[:, :3])


def true_north_ypr(eo: FramedOrientation) -> tuple[Array, Array]:
    """Return yaw (0 to 2 pi), pitch, roll and their standard deviations, each (n, 3) rad.

    They are of the image's top to true north, with zero in the nadir.
    """
    ypr, sigma = angles_of(eo, eo.C_Ec @ CV_RUB, local_covariance(eo)[:, 3:, 3:], YPR)
    ypr[:, 0] %= 2.0 * np.pi
    return ypr, sigma


def all_angles(eo: FramedOrientation) -> Array:
    """Return `true_north_ypr` and omega, phi, kappa, each with its sigmas: (n, 12), deg."""
    return np.hstack([np.degrees(np.hstack(true_north_ypr(eo))), numbers_of(eo, "opk s_opk")])


def sea_level(
    eo: FramedOrientation, undulation_m: float | Sequence[float] | Array | None, name: str
) -> Array:
    """Return heights (n,), m, above mean sea level: those above the ellipsoid less the geoid's.

    Raises
    ------
    UsageError
        `undulation_m` is missing.
    InputError
        `undulation_m` is no height of a geoid, or of another number of images.
    """
    if undulation_m is None:
        raise UsageError(
            f"{name} takes heights above mean sea level; give the geoid's heights above the"
            " ellipsoid (undulation_m)"
        )
    try:
        N = np.asarray(undulation_m, dtype=np.float64)
    except ValueError:
        raise UsageError(f"undulation_m: {undulation_m!r} is no height of a geoid in m") from None
    if N.shape not in ((), (len(eo.images),)):
        raise InputError(
            f"undulation_m: {N.size} geoid heights for {len(eo.images)} images; give one for each,"
            " or one for all"
        )
    wrong = ~(np.abs(N) <= LARGEST_GEOID_M)
    if wrong.any():
        raise InputError(
            f"undulation_m: {N[wrong].flat[0]:g} m is no geoid height (limit {LARGEST_GEOID_M:g}"
            " m); give those of a geoid above WGS84"
        )
    return np.asarray(eo.geodetic[:, 2] - N)


def inverse_covariance(P: Array, description: str, who: Sequence[str]) -> Array:
    """Return the inverses (n, d, d) of covariances.

    Raises
    ------
    DataError
        The first covariance, by `who`, that is not positive definite.
    """
    scale: Array = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    if not len(P):
        return P
    safe: NDArray[np.float64] = np.where(scale > 0.0, scale, 1.0)
    R = P / safe[:, :, None] / safe[:, None, :]
    least = np.linalg.eigvalsh(R)[:, 0]
    bad = (least < 1e-12) | ~(scale > 0.0).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(
            f"{who[row]}: {description} is not positive definite, so that it has no inverse; export"
            " eo_json instead"
        )
    return np.linalg.inv(R) / safe[:, :, None] / safe[:, None, :]
