"""The readout of a rolling shutter: rows of an image are exposed one after another.

A row at y of an image of height H is exposed

    tau = r (y / H - 1/2)                                                                  (R.1)

after the middle row, to which pose and stamp belong; r is the readout time of the whole image, from
its upper edge to the lower one, negative of a sensor that is read upwards. With q = C^T (P - X) of
a point P, velocity v and rate omega of the camera,

    dq / dtau = -C^T (v + omega x (P - X))                                                 (R.2)

makes the derivative a of its pixel by r. Where r is one unknown more beside those of an adjustment
with residuals e, weights W, design J and cofactors Q, one step of its iteration gives

    N = a^T W a - a^T W J Q J^T W a,    r = a^T W e / N,    gain = r^2 N                     (R.3)

Observations that r moves most were rejected as gross errors, and r without them is too small. A
significant r is taken off all pixels, these are cleaned again, and what is left of r is added. A
rate that is not known distorts all of an image, so that its residuals are not independent. With
a', what J leaves of a, and e', what r leaves of e, image k says s_k = a'_k^T W e'_k, and

    sigma_r^2 = max(N, sum s_k^2 + N - a'^T W a') / N^2                                      (R.4)

where N - a'^T W a' is of the groups, whose weights are taken as they are.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...records.block import Array, ImageBlock, whitened
from ...records.cameras.camera import pixels_of
from .adjustment import Adjusted
from .normals import Normals, Problem, assemble_normals, corrections
from .unknowns import Unknowns

STEP_S = 1e-4  # of numerical derivatives: a camera moves by millimetres in it
FEWEST_VELOCITIES = 3  # images whose velocities are known, below which nothing is tried
# least share of a^T W a that other unknowns leave: else r is as good as one of them
SEPARATED = 1e-4
SIGNIFICANT = 3.0  # sigmas of r from which on gross errors are looked for again
SETTLED_READOUT = 0.1  # sigmas that a further step may still move r
MOST_READOUT_STEPS = 3  # of them (chosen): the first one finds most of what was rejected


def pixels_by_readout(problem: Problem, values: Unknowns, motion: tuple[Array, Array]) -> Array:
    """Return the derivative of the pixels by the readout time.

    Parameters
    ----------
    problem : Problem
        Image observations.
    values : Unknowns
        Poses, cameras and points.
    motion : tuple of ndarray
        (n, 3) velocities, m/s, and (n, 3) rates, rad/s, of the images in the axes of the block;
        zero where they are not known.

    Returns
    -------
    ndarray, (k, 2)
        Pixels per second, in the order of `rays`; zero of rays that take no part.
    """
    rays, block = problem.rays, problem.block
    velocity, rate = motion
    rows, active = rays.image, rays.active
    d = values.point[problem.point] - values.position[rows]
    C = values.C_mc[rows]
    q = np.einsum("nji,nj->ni", C, d)
    slope = -np.einsum("nji,nj->ni", C, velocity[rows] + np.cross(rate[rows], d))
    out = np.zeros((rows.size, 2))
    for k, camera in enumerate(values.cameras(block.cameras)):
        of_camera = np.flatnonzero(active & (rays.camera[rows] == k))
        share = rays.uv[of_camera, 1] / camera.height - 0.5
        dq = (STEP_S * share)[:, None] * slope[of_camera]
        ahead, behind = q[of_camera] + dq, q[of_camera] - dq
        with np.errstate(all="ignore"):  # of points that take no part
            uv = [pixels_of(camera, x[:, :2] / x[:, 2:]) for x in (ahead, behind)]
        out[of_camera] = (uv[0] - uv[1]) / (2.0 * STEP_S)
    return np.where(np.isfinite(out), out, 0.0)


def without_readout(
    problem: Problem, values: Unknowns, motion: tuple[Array, Array], readout_s: float
) -> ImageBlock:
    """Return a block whose pixels are those of the exposure of the middle row.

    Parameters
    ----------
    problem : Problem
        Image observations as they were measured.
    values : Unknowns
        Poses, cameras and points.
    motion : tuple of ndarray
        As of `pixels_by_readout`.
    readout_s : float
        The readout time.

    Returns
    -------
    ImageBlock
        The same otherwise.
    """
    every = problem.with_active(np.ones_like(problem.rays.active))
    observations = problem.block.observations
    uv = np.array(observations.uv)
    uv[problem.order] -= readout_s * pixels_by_readout(every, values, motion)
    return replace(problem.block, observations=replace(observations, uv=uv))


def readout_gain(
    result: Adjusted,
    motion: tuple[Array, Array],
    cleaned: Callable[[Problem, Unknowns], Adjusted] | None = None,
) -> tuple[float, float, float, Array] | None:
    """Estimate the readout time beside all unknowns of an adjustment (R.3, R.4).

    Parameters
    ----------
    result : Adjusted
        The adjustment.
    motion : tuple of ndarray
        As of `pixels_by_readout`.
    cleaned : callable, optional
        Adjusts image observations, all of which are active, without gross errors; by default those
        of the adjustment stay as they are.

    Returns
    -------
    tuple, or None
        The readout time, s, its standard deviation, the gain of (R.3), and by how much it moves
        each projection centre, (n, 3) m; None where it is not determined.
    """
    if (motion[0] != 0.0).any(axis=1).sum() < FEWEST_VELOCITIES:
        return None
    problem, values = result.problem, result.problem.filled(result.values)
    if (first := _estimate_readout(problem, problem, values, motion)) is None:
        return None
    readout, sigma, N, moved = change, *_ = first
    every = problem.with_active(np.ones_like(problem.rays.active))
    for _ in range(MOST_READOUT_STEPS):
        small = abs(change) < SETTLED_READOUT * sigma or abs(readout) < SIGNIFICANT * sigma
        if cleaned is None or small:
            break
        uv = every.rays.uv - readout * pixels_by_readout(every, values, motion)
        again = cleaned(replace(every, rays=every.rays._replace(uv=uv)), values)
        values = every.filled(again.values.completed(values))
        if (further := _estimate_readout(every, again.problem, values, motion)) is None:
            break
        change, sigma, N, _ = further
        readout += change
    return readout, sigma, readout**2 * N, readout / first[0] * moved


def _estimate_readout(
    measured: Problem, problem: Problem, values: Unknowns, motion: tuple[Array, Array]
) -> tuple[float, float, float, Array] | None:
    """Return r, its sigma, N and dr of the centres (R.3, R.4); None where r is not determined.

    The rows are those of `measured`, the residuals those of `problem`.
    """
    rays = problem.rays
    a = pixels_by_readout(measured.with_active(rays.active), values, motion)
    weight = np.where(rays.active[:, None], rays.weight, 0.0)
    e, whitened_a = whitened(weight, values.residuals(rays)), whitened(weight, a)
    along, whole = float(np.nansum(whitened_a * e)), float((whitened_a**2).sum())
    scale = 1.0 / np.sqrt(max(whole, np.finfo(float).tiny))
    normals, dx, dp = _step(problem, values)
    shifted = replace(problem, rays=rays._replace(uv=rays.uv - scale * a))
    moved, dx_moved, dp_moved = _step(shifted, values)
    eliminated = problem.layout.kept < 0
    g, gp = moved.g - normals.g, moved.gp - normals.gp
    dx, dp = dx_moved - dx, dp_moved - dp
    absorbed = float(g @ dx + (gp * dp)[eliminated].sum())
    if not 1.0 - absorbed > SEPARATED:
        return None
    N = whole * (1.0 - absorbed)
    r = along / N
    after = whitened(weight, values.moved(problem.layout, dx, dp).residuals(shifted.rays))
    a_left = (e - after) / scale
    score = np.nansum(a_left * (e - r * a_left), axis=1)
    of_images = np.bincount(rays.image, weights=score)
    V = float((of_images**2).sum()) + N - float(np.nansum(a_left**2))
    columns = 6 * problem.layout.place[:, None] + np.arange(3)
    return r, np.sqrt(max(N, V)) / N, N, r / scale * dx[columns]


def _step(problem: Problem, values: Unknowns) -> tuple[Normals, Array, Array]:
    normals = assemble_normals(problem, values)
    return normals, *corrections(problem, values, normals)
