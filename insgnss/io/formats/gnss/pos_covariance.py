"""Covariances of RTKLIB's signed roots, in the order of its columns."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.errors import InputError
from ....records import Array, Finding
from ..text.order import note
from ..text.sentences import BAD_SHARE_LIMIT
from ..text.text import NumberTable

SIGMAS_ASSUMED = "sigma_m"  # topic of notes on fixes that got the caller's sigmas

SINGULAR = 1e-12  # of the trace: an eigenvalue below is rounding
# between north-east-up and north-east-down: the third axis reversed
DOWN_FROM_UP = np.diag([1.0, 1.0, -1.0])
LARGEST_ROOT = 1e7  # largest signed root (m): more than the radius of the Earth is no accuracy


def covariances(
    table: NumberTable,
    cols: dict[str, Array],
    names: tuple[str, ...],
    C: Array,
    notes: list[Finding],
    sigma: ArrayLike | None,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return covariances (n, 3, 3) of signed roots, taken by C (n, 3, 3) into north, east, down.

    Roots that are all zero have those of `sigma`; the second of the results is where (n,).
    """
    if missing := [name for name in names if name not in cols]:
        message = f"the header does not name {' '.join(missing)}; let RTKLIB write standard"
        raise InputError.in_file(table.path, f"{message} deviations (out-outstd)")
    roots = np.column_stack([cols[name] for name in names])
    unknown = np.asarray(
        (roots == 0.0).all(axis=1) if sigma is not None else np.zeros(len(roots)), dtype=np.bool_
    )
    zero = (
        ((roots[:, :3] <= 0.0) & ~unknown[:, None])
        | (np.abs(roots[:, 3:]) > LARGEST_ROOT)
        | (roots[:, :3] > LARGEST_ROOT)
    )
    if zero.any():
        row, k = (int(i) for i in np.argwhere(zero)[0])
        message = (
            f"standard deviation {names[k]} is {roots[row, k]:g}; it must be positive; did"
            " RTKLIB write the standard deviations (out-outstd)?"
        )
        raise table.error_at(row, message)
    P = covariance_of_roots(roots)
    P[unknown] = np.eye(3)
    _drop_odd_correlations(table, P, names, notes)
    P = np.asarray(C @ P @ np.swapaxes(C, 1, 2))
    if unknown.any():
        P[unknown] = np.diag(np.asarray(sigma, dtype=np.float64) ** 2)
        finding = f"sigma_m used for {unknown.sum()} of {len(P)} epochs without standard deviations"
        advice = "check sigma_m for them"
        notes.append(note("GNSS rows", finding, "a covariance each", advice, SIGMAS_ASSUMED))
    return P, unknown


def _drop_odd_correlations(
    table: NumberTable, P: Array, names: tuple[str, ...], notes: list[Finding]
) -> None:
    """Take the correlations out of matrices that are not positive definite, where they are few."""
    bad = without_inverse(P)
    if not bad.any():
        return
    row = int(np.argmax(bad))
    summary = (
        f"{bad.sum()} of {len(P)} covariances of {names[0]} ... {names[5]} are not positive"
        " definite"
    )
    if bad.mean() > BAD_SHARE_LIMIT:
        advice = "write more decimals or check the columns"
        raise table.error_at(row, f"{summary} (limit {BAD_SHARE_LIMIT:.0%}); {advice}")
    P[bad] *= np.eye(3)
    where = f"the first in line {table.lines[row]}; their correlations were left out"
    expected = "covariances that are positive definite"
    notes.append(note("GNSS rows", f"{summary}, {where}", expected, "write more decimals"))


def covariance_of_roots(roots: Array) -> Array:
    """Return covariances (n, 3, 3) of signed roots (n, 6), in the order of the file's axes."""
    c = np.sign(roots) * roots**2
    return np.ascontiguousarray(c[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]])


def without_inverse(P: Array) -> NDArray[np.bool_]:
    """Tell where covariances (n, 3, 3) are not positive definite (n,).

    The least eigenvalue of a singular matrix is rounding of either sign, so that the limit is
    `SINGULAR` of the trace and not zero.
    """
    return np.asarray(np.linalg.eigvalsh(P)[:, 0] <= SINGULAR * np.trace(P, axis1=1, axis2=2))


def signed_roots(P: Array) -> Array:
    """Return signed roots (n, 6) of covariances (n, 3, 3) in north, east, down.

    Their order is RTKLIB's over north, east, up.
    """
    U = DOWN_FROM_UP @ P @ DOWN_FROM_UP
    c = U[:, [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    return np.sign(c) * np.sqrt(np.abs(c))
