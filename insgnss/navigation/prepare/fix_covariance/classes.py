"""Covariances of an engine's positions, made to cover their errors.

An engine computes its covariance from what it assumes of white phase noise. What it leaves out
(multipath, the atmosphere between base and rover, coordinates of the base) grows neither with the
noise nor with its correlations, so that with K = diag(k), d the distance to the base and C the
covariance of the engine

    C' = K C K + diag(floor^2 + (ppm d)^2)                                                     (V.1)

which is sigma'^2 = (k sigma)^2 + floor^2 + (ppm d)^2 along each axis and keeps the engine's
correlations. k and floor are those of a class, and the class is the engine's quality flag as far as
it can be validated:

    fixed     by `least_satellites` satellites at least, where `support_share` of all epochs within
              `support_s`, and five, are so too (validated). Among buildings the ratio test accepts
              incorrect ambiguity fixes for single epochs and with few satellites.           (V.2)
    degraded  what is so, where fewer than `degraded_share` of all epochs within `degraded_s` are.
              Epochs before the first and after the last of them do not count.               (V.5)
    float     what is float, or is not validated as fixed, and has a validated epoch within
              `support_s`.
    isolated  the same without one: ambiguities that nothing confirms, code multipath in full.
    unsupported  the same by fewer than `unsupported_satellites`: nothing in the epoch itself
                 contradicts a reflected signal.

An island of fixes, a run of validated ones without a gap of more than `support_s`, is believed only
where

    the runs forward and backward both have it fixed, five epochs of it at least and without
    contradiction; or of the epochs within `island_s` of one of its own `island_share` are fixed,
    over as much of that time (half as much of a ready solution, whose runs nobody knows).   (V.6)

A float run within its decimetres or metres confirms nothing. A walking single-frequency receiver
had one island of 11 epochs with 6, 5, 10 mm, by one run alone, that were 2.6 m off. The epochs of
an island that is not believed are no longer fixed. Of every fix that is not validated (V.3) covers
the difference of the two runs, where both have it.

A fix that is not validated is handed on as float (quality 2). Where the engine ran forward and
backward by itself, and the two differ by s with s^T (C'_f + C'_b)^-1 s above `gate`, one of them
has wrong ambiguities: the epoch is no longer fixed, and

    C'' = C' + s s^T                                                                           (V.3)

covers the whole difference. The same holds for an outlier, a single fixed epoch that lies s off the
line between the fixed ones before and after it, times T1 and T2 away, by more than an acceleration
a of the vehicle and three sigma explain: on any axis

    |s| > a T1 T2 / 2 + 3 sigma_s                                                              (V.4)

Both runs see the same noise, so that s of two right ones is far smaller than its covariance here.

What keeps ambiguities from being fixed (reflections, diffraction, an atmosphere that differs) also
lengthens the phases of those that are, by up to a quarter of a wavelength (5 cm) each, and lasts
for minutes where the antenna stands: the integers are right, the position is off by centimetres,
and nothing in the epoch shows it. How many epochs of the minutes around are fixed does, but for
those before integers are found at first, or after they are given up: a filter's first minutes are
float under an open sky, too. Phases of degraded epochs are taken to be off by 1 to 2 cm where the
engine has 3 to 6 mm (k = 4); the floor is for what does not shrink with the geometry. Validation
and (V.4) are judged with k of fixed epochs, since time-correlated errors do not part neighbours;
nor do they part two runs of one receiver, and runs that are to be compared are calibrated by a
model whose `degraded_share` is 0.

The numbers (`numbers`) are measured. Fixed epochs, none of them degraded, after the corrections of
`troposphere` and `ionosphere` (errors rms, north, east, down, and their mean normalised square,
which is 1 where sigmas are right):

    10 simulated flights of 45 minutes, 1 to 2.5 km          2.8, 2.2, 5.4 mm    0.53 to 0.76
    2 held out, with other seeds                             2.7, 1.9, 5.0 mm    0.53, 0.59
    the ten without the correction of the ionosphere         3.2, 2.4, 5.9 mm    0.68 to 1.01
    simulated flight by others, 1.4 km, 6 minutes *          2.3, 3.3, 4.3 mm    1.09
    standing antenna solved as moving, 5.3 km, 60 epochs *   1.2, 0.8, 4.8 mm    0.17

(* too short for the correction of the ionosphere.)

With the engine's own sigmas (k = 1, a floor of 2 mm down) the ten have 0.36 to 0.53: it takes
phases for worse than they are, more so where the sky is open. k of 0.7 would bring them to 0.6 to
0.9, but k is also what forward and backward runs are compared with: of a rover that moves slowly
among houses (5.3 km, 360 epochs) 0.75 validates 351 fixes, 0.7 349, 0.65 340, and half the ppm 336.
The ppm stays what the air leaves where it is not corrected, and for orbits and coordinates of the
base.

The others: a car in a city (5 Hz, 9 km from its base, an inertial reference beside it). Of its 1793
fixed epochs 108 are off by 0.6 to 52 m, and none of these is validated; 1464 are, so that the
validation costs 221 right ones (1405 and 280 with (V.6), which came later than the figures that
follow). Of the epochs within 180 s of these 1464 (28 % of the drive) 4 to 82 % are validated: all
are degraded, and have 33, 33, 58 mm instead of 11, 11, 14 mm (medians). Against the reference,
taken as exact and no datum removed, 0.4 % of all 5213 epochs lie beyond three sigma on any axis;
without the class 28 % do. The normalised square of the validated is 1.5.

Rule and numbers were chosen on this one drive. Much of what the class covers there may be the
reference's or the base's: the median error is 8 mm south, 55 mm east, 48 mm down, and two
standstills of minutes, each steady to 4 mm horizontally, differ by 28 mm east and 79 mm down. Of
the floors tried with k = 4 the least that serves the second half (10, 10, 20 mm: 1.1 %) leaves 7.7
% of the first; the least that serves the first (20, 20, 40 mm: 0.4 %) leaves 0.5 % of the second.
The numbers here leave 0.3 and 0.5 %, and of a second solution of the drive (1 Hz, integers of each
epoch by itself, 110 of 531 epochs validated) nothing. k of isolated epochs is that of its worse
half (20 would do for the other, and leave 17 % of this one), and (V.2) asks for five epochs since
that second solution had a wrong one.

Errors of fixed epochs are time-correlated (0.3 to 0.8 over 10 s): (V.1) is of one epoch, and a
filter that takes many must estimate that part as a Gauss-Markov process (`gnss.gm_sigma` of the
flight file). In sigmas that RTKLIB claims, errors of standing antennas are (total, white by
differences of neighbours; horizontal / down):

    1 m, 301 epochs at 1 Hz *        0.22, 0.16 / 0.21, 0.18    0.34 left after 10, 0.07 after 60 s
    5.2 km, 51 epochs at 1 Hz *      0.16, 0.15 / 0.71, 0.39    0.16 after 10 s
    GEONET, 105 epochs of 30 s **    0.68, 0.46 / 0.61, 0.41    0.52 after 30 s, 0.27 after 120

(* against the published truth; ** about their own median.) That is a lasting share of 0.1 to 0.6,
too few recordings for a class by baseline; what is carried a priori where a flight shows such an
error, and what the headline says where it shows none, stands in `navigation.diagnosis.variances`.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....geodesy.frames import geodetic_to_ecef, rotation_en
from ....records import Array, Finding, GnssFixes, Question
from .numbers import FIX_CLASSES, MEASURED, CalibrationNumbers

Index = NDArray[np.int64]

# indices of `FIX_CLASSES`
FIXED, DEGRADED, FLOAT, ISOLATED, UNSUPPORTED, SBAS, DGPS, SINGLE, PPP = range(len(FIX_CLASSES))
VALIDATED = (FIXED, DEGRADED)
# RTKLIB's 0 to 7; of what is unknown the largest
CLASS_OF_QUALITY = SINGLE, FIXED, FLOAT, SBAS, DGPS, SINGLE, PPP, SINGLE
FLOAT_QUALITY = 2  # RTKLIB's code of float solutions
# fixed ones that are needed, and epochs to either side that count where they are rarer than in
# `support_s`
SUPPORT_EPOCHS = 5
# half the last digit of RTKLIB's standard deviations: one that is written as zero is below it
SMALLEST_M = 5e-5
# s, between times of one epoch in two solutions of one rover: engines write them to a millisecond
SAME_EPOCH_S = 1e-3


@dataclass(frozen=True, eq=False)
class Separation:
    """Separation of two runs of the engine: the backward position minus the forward one.

    Parameters
    ----------
    ned : ndarray, shape (n, 3)
        m, north, east, down; NaN where one of the runs has no epoch.
    cov : ndarray, shape (n, 3, 3)
        m^2, C'_f + C'_b at these epochs.
    fixed : ndarray of bool, shape (n,)
        Where the fixes of both runs are validated.
    """

    ned: Array
    cov: Array
    fixed: NDArray[np.bool_]

    def beyond(self, gate: float) -> NDArray[np.bool_]:
        """Return (n,) where s^T cov^-1 s exceeds `gate`."""
        finite: NDArray[np.bool_] = np.asarray(np.isfinite(self.ned).all(axis=1))
        s = np.where(finite[:, None], self.ned, 0.0)
        cov = np.where(finite[:, None, None], self.cov, np.eye(3))
        return np.asarray(
            np.einsum("ni,ni->n", s, np.linalg.solve(cov, s[:, :, None])[:, :, 0]) > gate
        )


def calibrate(
    fixes: GnssFixes,
    satellites: ArrayLike | None,
    distance_m: ArrayLike,
    separation: Separation | None = None,
    model: CalibrationNumbers = MEASURED,
) -> tuple[GnssFixes, Index]:
    """Calibrate the covariances of fixes by (V.1) to (V.6).

    Parameters
    ----------
    fixes : GnssFixes
        The engine's positions, with its own covariances.
    satellites : array_like, shape (n,), optional
        Number of satellites used in each epoch, None where nothing says it.
    distance_m : array_like, shape (n,)
        Distance to the base, m.
    separation : Separation, optional
        Separation of the two runs at the fixes, from `forward_backward`.
    model : CalibrationNumbers
        Scale factors, floors and limits of the classes.

    Returns
    -------
    fixes : GnssFixes
        The fixes with calibrated covariances, those that are not validated with quality 2 (float),
        and a note of how many these are.
    kind : ndarray of int, shape (n,)
        The class of each fix, as its index in `FIX_CLASSES`.
    """
    quality = np.zeros(fixes.time.size, dtype=np.int64) if fixes.quality is None else fixes.quality
    fixed = quality == 1

    def classes_without(incorrect: NDArray[np.bool_]) -> Index:
        as_float = np.where(fixed & incorrect, FLOAT_QUALITY, quality)
        return classes(fixes.time, as_float, satellites, model)

    apart, doubtful = np.zeros(fixes.time.size, dtype=np.bool_), np.zeros((fixes.time.size, 3))
    if separation is not None:
        apart = separation.beyond(model.gate)
        doubtful[apart] = separation.ned[apart]
    kind = classes_without(apart)
    off, outlier = outliers(
        fixes, kind == FIXED, scale_covariances(fixes.cov_ned, kind, distance_m, model), model
    )
    if outlier.any():
        doubtful[outlier] = off[outlier]
        kind = classes_without(apart | outlier)
    supported = confirmed_fixes(fixes.time, kind == FIXED, separation, apart, model)
    if (island := (kind == FIXED) & ~supported).any():
        kind = classes_without(apart | outlier | island)
    rejected = fixed & (kind != FIXED)
    if separation is not None:
        separated = rejected & ~outlier & np.isfinite(separation.ned).all(axis=1)
        doubtful[separated] = separation.ned[separated]
    kind = mark_degraded(fixes.time, kind, model)
    cov = (
        scale_covariances(fixes.cov_ned, kind, distance_m, model)
        + doubtful[:, :, None] * doubtful[:, None, :]
    )
    trusted = None if fixes.quality is None else np.where(rejected, FLOAT_QUALITY, quality)
    note = _note(fixed, rejected, apart, outlier, island, kind, model)
    return replace(fixes, cov_ned=cov, quality=trusted, notes=(*fixes.notes, note)), kind


def outliers(
    fixes: GnssFixes, validated: NDArray[np.bool_], cov: Array, model: CalibrationNumbers = MEASURED
) -> tuple[Array, NDArray[np.bool_]]:
    """Find the outliers (V.4) among validated fixes.

    Of neighbours that are both off the line only the one that is farther off is named: the other
    may be so for its sake.

    Parameters
    ----------
    fixes : GnssFixes
        The fixes to judge.
    validated : ndarray of bool, shape (n,)
        Which of them are validated.
    cov : ndarray, shape (n, 3, 3)
        m^2, their covariances, north, east, down.
    model : CalibrationNumbers
        Holds the largest acceleration of the vehicle.

    Returns
    -------
    off : ndarray, shape (n, 3)
        m, north, east, down, from the line between the validated neighbours; zero elsewhere.
    outlier : ndarray of bool, shape (n,)
        Which of the fixes are outliers.
    """
    off, worst = np.zeros((fixes.time.size, 3)), np.zeros(fixes.time.size)
    rows = np.flatnonzero(validated)
    if rows.size < 3:
        return off, worst > 0.0
    t = fixes.time[rows]
    position = geodetic_to_ecef(fixes.lat[rows], fixes.lon[rows], fixes.height[rows])
    before, after = (t[1:-1] - t[:-2])[:, None], (t[2:] - t[1:-1])[:, None]
    share = before / (before + after)
    middle = rows[1:-1]
    line = (1.0 - share) * position[:-2] + share * position[2:]
    off[middle] = np.einsum(
        "nji,nj->ni", rotation_en(fixes.lat[middle], fixes.lon[middle]), position[1:-1] - line
    )
    variance = np.diagonal(cov[rows], axis1=1, axis2=2)
    sigma = np.sqrt(variance[1:-1] + (1.0 - share) ** 2 * variance[:-2] + share**2 * variance[2:])
    limit = 0.5 * np.array(model.acceleration_mps2) * before * after + 3.0 * sigma
    worst[middle] = (np.abs(off[middle]) / limit).max(axis=1)
    size = worst[rows]
    beside = np.maximum(np.append(size[1:], 0.0), np.append(0.0, size[:-1]))
    outlier = np.zeros(fixes.time.size, dtype=np.bool_)
    outlier[rows] = (size > 1.0) & (size >= beside)
    return off, outlier


def classes(
    time: Array, quality: Index, satellites: ArrayLike | None, model: CalibrationNumbers = MEASURED
) -> Index:
    """Return the class (n,) of each epoch by (V.2), as its index in `FIX_CLASSES`.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    quality : ndarray of int, shape (n,)
        RTKLIB's codes of quality.
    satellites : array_like, shape (n,), optional
        Number of satellites used in each epoch, None where nothing says it.
    model : CalibrationNumbers
        Limits of the classes.
    """
    kind = np.array(CLASS_OF_QUALITY, dtype=np.int64)[
        np.clip(quality, 0, len(CLASS_OF_QUALITY) - 1)
    ]
    fixed = kind == FIXED
    count = np.full(time.size, 99) if satellites is None else np.asarray(satellites)
    reach = _reach(time, model.support_s)
    supporting, share = _support(time, fixed, reach)
    validated = (
        fixed
        & (count >= model.least_satellites)
        & (supporting >= SUPPORT_EPOCHS)
        & (share >= model.support_share)
    )
    ambiguous = (fixed | (kind == FLOAT)) & ~validated
    alone = np.where(count < model.unsupported_satellites, UNSUPPORTED, ISOLATED)
    kind[ambiguous] = np.where(_support(time, validated, reach)[0] > 0, FLOAT, alone)[ambiguous]
    return kind


def confirmed_fixes(
    time: Array,
    validated: NDArray[np.bool_],
    separation: Separation | None,
    apart: NDArray[np.bool_],
    model: CalibrationNumbers = MEASURED,
) -> NDArray[np.bool_]:
    """Return which validated fixes (n,) lie on an island that is believed (V.6).

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    validated : ndarray of bool, shape (n,)
        Which fixes are validated by (V.2).
    separation : Separation, optional
        Of the two runs; None where there is one solution only.
    apart : ndarray of bool, shape (n,)
        Where the two runs contradict each other.
    model : CalibrationNumbers
        Holds the times and the share of (V.6).
    """
    rows = np.flatnonzero(validated)
    if rows.size == 0 or model.island_s == 0.0:
        return validated
    both = np.zeros(time.size, dtype=np.bool_) if separation is None else separation.fixed & ~apart
    reach, around = _reach(time, model.support_s), _reach(time, model.island_s)
    _, share = _support(time, validated, around)
    fixed = time[rows]
    first = fixed[np.minimum(np.searchsorted(fixed, time - around), rows.size - 1)]
    last = fixed[np.maximum(np.searchsorted(fixed, time + around, side="right") - 1, 0)]
    window = np.minimum(time + around, time[-1]) - np.maximum(time - around, time[0])
    least = model.island_share * (0.5 if separation is None else 1.0)
    minutes = (share >= least) & (last - first + 2.0 * SAME_EPOCH_S >= least * window)
    out = np.zeros(time.size, dtype=np.bool_)
    for island in np.split(rows, np.flatnonzero(np.diff(fixed) > reach) + 1):
        out[island] = minutes[island].any() or both[island].sum() >= SUPPORT_EPOCHS
    return out


def mark_degraded(time: Array, kind: Index, model: CalibrationNumbers = MEASURED) -> Index:
    """Return the classes (n,) with the degraded ones among the fixed marked (V.5).

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    kind : ndarray of int, shape (n,)
        The classes that `classes` returns.
    model : CalibrationNumbers
        Holds the share and the time of (V.5).
    """
    rows = np.flatnonzero(kind == FIXED)
    if rows.size == 0:
        return kind
    within = slice(rows[0], rows[-1] + 1)
    fixed = kind[within] == FIXED
    _, share = _support(time[within], fixed, model.degraded_s + SAME_EPOCH_S)
    out = kind.copy()
    out[within][fixed & (share < model.degraded_share)] = DEGRADED
    return out


def scale_covariances(
    cov_ned: Array, kind: Index, distance_m: ArrayLike, model: CalibrationNumbers = MEASURED
) -> Array:
    """Return covariances (n, 3, 3) m^2 of (V.1) from those of the engine and the classes (n,).

    None is smaller than what the engine can write.
    """
    k = np.array([model.scale[name] for name in FIX_CLASSES])[kind]
    floor = np.array([model.floor_m[name] for name in FIX_CLASSES])[kind]
    added = (
        floor**2
        + (1e-6 * np.asarray(distance_m, dtype=np.float64)[:, None] * np.array(model.ppm)) ** 2
    )
    missing = np.maximum(SMALLEST_M**2 - np.diagonal(cov_ned, axis1=1, axis2=2), 0.0)
    return np.asarray(
        k[:, :, None] * (cov_ned + missing[:, :, None] * np.eye(3)) * k[:, None, :]
        + added[:, :, None] * np.eye(3)
    )


def base_distance(fixes: GnssFixes, base_ecef: ArrayLike) -> Array:
    """Return the distance (n,) m of the fixes from the base, ECEF (3,) m."""
    ecef = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    return np.asarray(np.linalg.norm(ecef - np.asarray(base_ecef), axis=1))


def forward_backward(time: Array, forward: GnssFixes, backward: GnssFixes) -> Separation:
    """Return the separation of two runs, each calibrated by itself, at `time` (n,) s."""
    ned, cov = np.full((time.size, 3), np.nan), np.full((time.size, 3, 3), np.nan)
    i, j = (_rows_at(time, run.time) for run in (forward, backward))
    both = (i >= 0) & (j >= 0)
    f, b = i[both], j[both]
    apart = geodetic_to_ecef(backward.lat[b], backward.lon[b], backward.height[b])
    apart -= geodetic_to_ecef(forward.lat[f], forward.lon[f], forward.height[f])
    ned[both] = np.einsum("nji,nj->ni", rotation_en(forward.lat[f], forward.lon[f]), apart)
    cov[both] = forward.cov_ned[f] + backward.cov_ned[b]
    fixed = np.zeros(time.size, dtype=np.bool_)
    fixed[both] = _are_fixed(forward, f) & _are_fixed(backward, b)
    return Separation(ned, cov, fixed)


def _are_fixed(fixes: GnssFixes, rows: Index) -> NDArray[np.bool_]:
    if fixes.quality is None:
        return np.zeros(rows.size, dtype=np.bool_)
    return np.asarray(fixes.quality[rows] == 1)


def _rows_at(time: Array, of: Array) -> Index:
    """Row of `of` at each `time`, -1 where there is none within `SAME_EPOCH_S`."""
    row = np.clip(np.searchsorted(of, time), 1, max(of.size - 1, 1))
    row = np.where(
        np.abs(of[row - 1] - time) <= np.abs(of[np.minimum(row, of.size - 1)] - time), row - 1, row
    )
    row = np.minimum(row, of.size - 1)
    return np.where(np.abs(of[row] - time) <= SAME_EPOCH_S, row, -1)


def _reach(time: Array, support_s: float) -> float:
    """Half the window of support, s."""
    interval = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    return max(support_s, SUPPORT_EPOCHS * interval) + SAME_EPOCH_S


def _support(time: Array, which: NDArray[np.bool_], reach: float) -> tuple[Index, Array]:
    """Number (n,) of `which`, and their share (n,), among the epochs within `reach` s of each."""
    count = np.concatenate([[0], np.cumsum(which)])
    first = np.searchsorted(time, time - reach)
    after = np.searchsorted(time, time + reach, side="right")
    supporting = count[after] - count[first]
    return supporting, np.asarray(supporting / (after - first))


def _note(
    fixed: NDArray[np.bool_],
    rejected: NDArray[np.bool_],
    apart: NDArray[np.bool_],
    outlier: NDArray[np.bool_],
    island: NDArray[np.bool_],
    kind: Index,
    model: CalibrationNumbers,
) -> Finding:
    ask = Question("GNSS covariance", "fixed epochs that others confirm")
    validated = int(fixed.sum() - rejected.sum())
    finding = f"{validated} of {int(fixed.sum())} fixed epochs are validated"
    counts = {
        "because forward and backward runs contradict each other": rejected & apart,
        "because they are outliers from the path": rejected & outlier & ~apart,
        "as short spans that only one run has fixed, within minutes that are not fixed": rejected
        & island,
        f"for fewer than {model.least_satellites} satellites or because fewer than"
        f" {100 * model.support_share:.0f} % of the epochs around them are fixed": (
            rejected & ~apart & ~outlier & ~island
        ),
    }
    reasons = ", ".join(f"{int(which.sum())} {why}" for why, which in counts.items() if which.any())
    advice = []
    if reasons:
        finding += f"; not {reasons}"
        advice.append(
            "epochs that are not validated are taken as float, with suitable standard deviations"
        )
    if of_them := int((kind == DEGRADED).sum()):
        finding += (
            f"; {of_them} of the validated are degraded: of the epochs within {model.degraded_s:g}"
            f" s fewer than {100 * model.degraded_share:g} % are fixed"
        )
        advice.append(
            "degraded epochs get standard deviations of centimetres, for multipath that nothing"
            " else shows"
        )
    remedy = f"{'; '.join(advice)}; look at the figure of satellites and ratio"
    return ask.note(finding, remedy, when=advice)
