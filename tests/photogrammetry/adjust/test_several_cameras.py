"""Blocks of three cameras: a forward one, a backward one, and one that is known."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_blocks import camera, simulated
from test_image_kernels import computed

from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.records.block import INTERIOR

CAMERAS = (
    camera(False, ("f", "cx", "cy", "k1"), "forward"),
    camera(True, ("f", "cx", "cy", "b1", "k1"), "backward"),
    camera(False, (), "known"),
)
OFF = {"f": 20.0, "cx": 10.0, "cy": -10.0}


def three(seed, **shape):
    """A block whose strips take the cameras in turn; first values of the free ones are off."""
    shape = {"strips": 3, "images": 4, "points": 90, "control": 8} | shape
    made = simulated(seed, cameras=CAMERAS, start_m=0.2, start_deg=0.1, **shape)
    stated = [
        c.with_(
            [
                v + OFF.get(name, 0.0) * (name in c.free)
                for name, v in zip(INTERIOR, c.interior, strict=True)
            ]
        )
        for c in CAMERAS
    ]
    return replace(made, block=replace(made.block, cameras=tuple(stated)))


def whitened(block, values):
    """Residuals of image observations and control, written without the engine."""
    seen, out = block.observations, []
    for c, cam in enumerate(block.cameras):
        rows = block.camera[seen.image] == c
        i, p = seen.image[rows], seen.point[rows]
        e = computed(
            values.position[i],
            values.C_mc[i],
            values.point[p],
            cam,
            values.interior[c],
            seen.uv[rows],
        )
        out.append((e / seen.sigma_px[rows]).ravel())
    control = block.control.position_m - values.point[block.control.point]
    return np.concatenate([*out, control.ravel() / np.sqrt(block.control.cov[0, 0, 0])])


def test_against_numeric_derivatives() -> None:
    """Oracle: central differences of the residuals by all unknowns at once, nothing eliminated:
    the solution to 0.01 sigma, standard deviations to 1e-4.
    """
    block = three(51).block
    result = adjust_problem(problem_of(block, control_points(block.control)), first_values(block))
    precision = precision_of(result, 1.0)
    layout, values = result.problem.layout, result.values
    seen = np.flatnonzero(np.isfinite(values.point[:, 0]))
    values = values.with_points(np.nan_to_num(values.point))
    columns = np.flatnonzero(~layout.held)
    assert columns.size == 6 * 12 + 4 + 5

    def residuals(x):
        dx, dp = np.zeros(layout.size), np.zeros_like(values.point)
        dx[columns], dp[seen] = x[: columns.size], x[columns.size :].reshape(-1, 3)
        return whitened(block, values.moved(layout, dx, dp))

    sigma = np.concatenate(
        [np.sqrt(precision.cofactors.of(np.array([c]))[0]) for c in columns]
        + [np.sqrt(np.diagonal(precision.point_cov[p])) for p in seen]
    )
    step = 0.1 * np.diag(sigma)
    # points that nothing but two rays sees are linear enough over a tenth of a sigma
    J = np.stack([(residuals(h) - residuals(-h)) / 0.2 for h in step], axis=1)
    cov = np.linalg.inv(J.T @ J)  # in units of sigma
    assert np.abs(cov @ J.T @ residuals(np.zeros(sigma.size))).max() < 0.01
    assert np.sqrt(np.diagonal(cov)) == pytest.approx(1.0, rel=1e-4)
    for c, cam in enumerate(block.cameras):
        free = np.isin(INTERIOR, cam.free)
        assert (precision.sigma_interior(c)[free] > 0.0).all()
        assert (precision.sigma_interior(c)[~free] == 0.0).all()
        assert (result.values.interior[c] == cam.interior)[~free].all()
    names = [c.name for c in precision.components()]
    assert names[:3] == [f"image observations of {c.name}" for c in CAMERAS]


@pytest.mark.slow
def test_cameras_are_recovered_within_their_covariance() -> None:
    """Oracle: chi-square, 99 %, over twenty blocks: the free parameters of both cameras, and the
    poses of all images.
    """
    from scipy.stats import chi2

    totals, count = {"cameras": 0.0, "poses": 0.0}, {"cameras": 0, "poses": 0}
    for seed in range(20):
        made = three(900 + seed)
        problem = problem_of(made.block, control_points(made.block.control))
        result = adjust_problem(problem, first_values(made.block))
        precision = precision_of(result, 1.0)
        P = precision.cov(("camera", 0), ("camera", 1))
        e = (made.truth.interior - result.values.interior)[:2, problem.layout.columns].ravel()
        free = np.diagonal(P) > 0.0
        assert not e[~free].any()
        cases = {"cameras": (e[free], P[np.ix_(free, free)])}
        position = (made.truth.position - result.values.position).ravel()
        P = precision.cov(*(("pose", i) for i in range(len(made.block.images))))
        rows = np.arange(len(P)).reshape(-1, 6)[:, :3].ravel()
        cases["poses"] = (position, P[np.ix_(rows, rows)])
        for name, (error, cov) in cases.items():
            totals[name] += error @ np.linalg.solve(cov, error)
            count[name] += error.size
    for name, total in totals.items():
        low, high = chi2.ppf((0.005, 0.995), count[name])
        assert low < total < high, name
