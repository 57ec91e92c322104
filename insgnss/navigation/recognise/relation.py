"""The search for the gyro unit and the lag at which IMU and GNSS fit together, coarse to fine.

Mathematics: the package's docstring, (R.4) to (R.7).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...geodesy.rotation import right_angle_rotations
from ...records import Array, GnssFixes
from .fit import RecognitionFit, Scan, fit, scan_lags
from .signal import Accelerations, ImuGrid, PropagatedForce, accelerations, propagate_force
from .units import ForceUnit, gyro_factors

# between IMU and GNSS (s): beyond the leap seconds, 18 s, and a clock set by hand (chosen)
MAX_LAG_S = 30.0
# least step of the search over lags (s): forces of half a second change no faster (chosen)
LAG_STEP_S = 0.25
HALVES_S = (0.5, 2.0)  # of the differences that are tried over all lags
FINE_HALVES_S = (0.2, 0.5, 1.0, 2.0)  # of those that are fitted at the end
# times that the right time offset leaves less unexplained than any far from it; motions of two
# flights leave less
RIVAL_MISFIT_RATIO = 1.3
LEAST_ACCELERATIONS = 10  # accelerations from which a relation is looked for (chosen)
# score above which no other arrangement of the gyro axes is looked for, and that one must have
CLEAR = 0.5
MANOEUVRE_MS2 = 0.3  # horizontal acceleration that a tenth of the fixes must show for it
LEAST_GAIN_SHARE = 0.3  # share of the largest gain that a fit needs to be accepted

Kind = Literal["position", "velocity"]


@dataclass(frozen=True, eq=False)
class Relation:
    """How IMU and GNSS fit together.

    Parameters
    ----------
    factors : tuple of float
        The h gyro factors tried.
    scans : tuple of Scan
        Their scans, of one kind of difference.
    best : int
        Index of the best factor.
    triads : ndarray, shape (3, 3)
        Signed permutation that takes gyro readings into the accelerometers' axes, the identity
        where both are aligned.
    rival : float
        Best score with the gyros' sense reversed.
    propagated : PropagatedForce
        With the best of all these.
    fit : RecognitionFit or None
        The most certain fit; None where the scans explain nothing.
    acc : Accelerations
        Those of the fit.
    lag_sigma : float, s
        Standard deviation of the lag, with the spread of the fits of other differences in it (R.7).
    """

    factors: tuple[float, ...]
    scans: tuple[Scan, ...]
    best: int
    triads: Array
    rival: float
    propagated: PropagatedForce
    fit: RecognitionFit | None
    acc: Accelerations
    lag_sigma: float

    @property
    def scan(self) -> Scan:
        """The scan of the best factor."""
        return self.scans[self.best]


def relate(
    grid: ImuGrid,
    gnss: GnssFixes,
    sound: NDArray[np.bool_],
    force: ForceUnit,
    reach: float = MAX_LAG_S,
) -> Relation | None:
    """Find the best relation over all gyro factors and lags.

    Parameters
    ----------
    grid : ImuGrid
    gnss : GnssFixes
    sound : ndarray of bool, shape (n,)
        The fixes that are used.
    force : ForceUnit
    reach : float, s
        The largest lag.

    Returns
    -------
    Relation or None
        None where there are too few fixes or readings to look for one.
    """
    if sound.sum() < LEAST_ACCELERATIONS:
        return None
    factors = gyro_factors(grid, force.quantity)
    halves = HALVES_S if reach <= MAX_LAG_S else HALVES_S[1:]
    candidates = _differences(gnss, sound, halves)
    if not factors or not candidates:
        return None
    triads = np.eye(3)
    chosen, best = _try_factors(grid, factors, force, candidates, reach)
    if _top(chosen[best]) < CLEAR:
        centred = replace(grid, dtheta=grid.dtheta - _usual_rate(grid))
        others, other = _try_factors(centred, factors, force, candidates, reach)
        if _top(others[other]) > max(_top(chosen[best]), 0.0):
            grid, chosen, best = centred, others, other
    if (
        _top(chosen[best]) < CLEAR
        and reach <= MAX_LAG_S
        and (turned := _turned_triads(grid, factors, force, candidates)) is not None
    ):
        triads = turned
        grid = replace(grid, dtheta=grid.dtheta @ triads.T)
        chosen, best = _try_factors(grid, factors, force, candidates, reach)
    reverse = propagate_force(grid, -factors[best], force.factor)
    rival = _top(_scan(reverse, chosen[best].acc, 0.0, reach))
    moved = propagate_force(grid, factors[best], force.factor)
    best_fit, acc, sigma = _refine(grid, gnss, sound, moved, chosen[best])
    return Relation(tuple(factors), tuple(chosen), best, triads, rival, moved, best_fit, acc, sigma)


def _usual_rate(grid: ImuGrid) -> Array:
    """Median (3,) of the gyro increments over a second, per grid interval.

    It is a gyro's bias if that is large and most lines are straight.
    """
    k = max(1, round(1.0 / grid.step))
    n = max(1, len(grid.dtheta) // k)
    return np.median(grid.dtheta[: n * k].reshape(n, -1, 3).mean(axis=1), axis=0)


def _try_factors(
    grid: ImuGrid,
    factors: list[float],
    force: ForceUnit,
    candidates: list[Accelerations],
    reach: float,
) -> tuple[list[Scan], int]:
    """Scans of all factors with the most informative differences, and the index of the best."""
    moved = [propagate_force(grid, f, force.factor) for f in factors]
    scans = [[_scan(c, acc, 0.0, reach) for c in moved] for acc in candidates]
    chosen = max(scans, key=lambda same: max(s.gain() for s in same))
    return chosen, int(np.argmax([_top(s) for s in chosen]))


def _turned_triads(
    grid: ImuGrid, factors: list[float], force: ForceUnit, candidates: list[Accelerations]
) -> Array | None:
    """Signed permutation of the gyro readings with which they propagate the force as GNSS saw it.

    None where there is no such permutation.
    """
    acc = max(candidates, key=lambda a: a.span_s)
    if np.quantile(np.abs(acc.z[:, :2]), 0.9) < MANOEUVRE_MS2:
        return None
    best, permutation = CLEAR, None
    for P in (sense * C for C in right_angle_rotations() for sense in (1.0, -1.0)):
        turned = replace(grid, dtheta=grid.dtheta @ P.T)
        score = max(_top(_scan(propagate_force(turned, f, force.factor), acc)) for f in factors)
        if score > best:
            best, permutation = score, P
    return permutation


def _top(scan: Scan) -> float:
    return float(scan.score[scan.best])


def _differences(
    gnss: GnssFixes, sound: NDArray[np.bool_], wanted: tuple[float, ...], dense: bool = False
) -> list[Accelerations]:
    """Accelerations of all kinds over the wanted lengths, s, where they are enough."""
    every = [
        accelerations(gnss, sound, kind, half, dense)
        for kind in _kinds(gnss)
        for half in _halves(gnss, wanted)
    ]
    return [acc for acc in every if acc.time.size >= LEAST_ACCELERATIONS]


def _kinds(gnss: GnssFixes) -> list[Kind]:
    return ["position"] if gnss.velocity_ned is None else ["velocity", "position"]


def _halves(gnss: GnssFixes, wanted: tuple[float, ...]) -> list[float]:
    """Of the wanted lengths, s, those that the rate of the fixes allows.

    It is the interval itself where that is longer than all.
    """
    interval = float(np.median(np.diff(gnss.time))) if gnss.time.size > 1 else np.inf
    return [half for half in wanted if half > 0.9 * interval] or [interval]


def _scan(
    moved: PropagatedForce, acc: Accelerations, around: float = 0.0, reach: float = MAX_LAG_S
) -> Scan:
    width = 0.5 * acc.span_s if acc.kind == "position" else acc.span_s
    step = min(0.5 * width, max(LAG_STEP_S, 0.25 * width))
    n = int(np.ceil(reach / step))
    return scan_lags(
        moved, acc, around + step * np.arange(-n, n + 1, dtype=np.float64), reach > MAX_LAG_S
    )


def _refine(
    grid: ImuGrid, gnss: GnssFixes, sound: NDArray[np.bool_], moved: PropagatedForce, scan: Scan
) -> tuple[RecognitionFit | None, Accelerations, float]:
    """Fit all differences near the best lag; take the one that knows the lag best (R.7).

    Only fits that explain enough take part.
    """
    if scan.gain() == 0.0:
        return None, scan.acc, np.inf
    lag, reach = float(scan.lags[scan.best]), 2.0 * scan.acc.span_s
    candidates = _differences(gnss, sound, FINE_HALVES_S, dense=True)
    near = [_scan(moved, acc, lag, reach) for acc in candidates]
    most = max((s.gain() for s in near), default=0.0)
    near = [s for s in near if s.gain() > LEAST_GAIN_SHARE * most]
    worth = []
    for s in near:
        sign = 1 if s.up[s.best] >= s.down[s.best] else -1
        if (fitted := fit(moved, s.acc, float(s.lags[s.best]), sign)) is not None:
            worth.append((fitted, s.acc))
    if not worth:
        return None, scan.acc, np.inf
    best, acc = min(worth, key=lambda f: f[0].lag_sigma)
    others = np.array([[f.theta[0], f.lag_sigma] for f, _ in worth])
    excess = np.mean(np.maximum((others[:, 0] - best.theta[0]) ** 2 - others[:, 1] ** 2, 0.0))
    return best, acc, float(np.sqrt(best.lag_sigma**2 + excess + (0.25 * grid.interval) ** 2))
