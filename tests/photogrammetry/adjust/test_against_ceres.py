"""The engine against Ceres, with pycolmap's reprojection errors."""

import numpy as np
import pytest
from oracles import oracle
from simulated_blocks import camera, simulated

from insgnss.geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.records.block import INTERIOR

pyceres = oracle("pyceres")
pycolmap = oracle("pycolmap")
cost_functions = oracle("pycolmap.cost_functions")

FREE = ("f", "cx", "cy", "k1", "p1")
COLMAP = ("fx", "fy", "cx", "cy", "k1", "k2", "p2", "p1", "k3", "k4", "k5", "k6")
STEP = 1e-6


def rigid(pose, C0):
    """Colmap's seven parameters (quaternion x y z w, translation) of six: position and psi."""
    C_cm = (rotation_from_vector(pose[3:]) @ C0).T
    w, x, y, z = quaternion_from_rotation(C_cm)
    return np.array([x, y, z, w, *(-C_cm @ pose[:3])])


class SixParameters(pyceres.CostFunction):
    """pycolmap's cost of one image observation, of a point, six pose parameters and f cx cy k1 p1;
    derivatives of the re-parametrisation by central differences.
    """

    def __init__(self, uv, sigma, C0, interior):
        super().__init__()
        self.set_num_residuals(2)
        self.set_parameter_block_sizes([3, 6, len(FREE)])
        self.C0, self.interior = C0, interior
        model = pycolmap.CameraModelId.FULL_OPENCV
        self.cost = cost_functions.ReprojErrorCost(model, np.diag(sigma**2), uv)

    def theirs(self, free):
        value = dict(zip(INTERIOR, self.interior, strict=True)) | dict(zip(FREE, free, strict=True))
        value |= {"fx": value["f"], "fy": value["f"], "k4": 0.0, "k5": 0.0, "k6": 0.0}
        return np.array([value[name] for name in COLMAP])

    def Evaluate(self, parameters, residuals, jacobians):
        point, pose, free = (np.array(p) for p in parameters)
        value, J = self.cost.evaluate(point, rigid(pose, self.C0), self.theirs(free))
        residuals[:] = np.ravel(value)
        if jacobians is not None:
            G = np.empty((7, 6))
            for k in range(6):
                h = STEP * np.eye(6)[k]
                G[:, k] = (rigid(pose + h, self.C0) - rigid(pose - h, self.C0)) / (2.0 * STEP)
            H = np.zeros((12, len(FREE)))
            H[[0, 1], 0] = 1.0
            for k, name in enumerate(FREE[1:], start=1):
                H[COLMAP.index(name), k] = 1.0
            blocks = (J[0], J[1] @ G, J[2] @ H)
            for jacobian, own in zip(jacobians, blocks, strict=True):
                if jacobian is not None:
                    jacobian[:] = np.ravel(own)
        return True


@pytest.mark.slow
def test_against_ceres():
    """Oracle: Ceres on pycolmap's cost of FULL_OPENCV with the same control: cost to 1e-8,
    parameters to 0.01 sigma, standard deviations to 1e-4.
    """
    plain = camera(free=FREE)
    plain = plain.with_(np.where(np.isin(INTERIOR, ("b1", "b2")), 0.0, plain.interior))
    made = simulated(
        21, strips=1, images=4, points=30, control=4, cameras=(plain,), start_m=0.3, start_deg=0.2
    )
    block, first = made.block, first_values(made.block)
    result = adjust_problem(problem_of(block, control_points(block.control)), first)
    precision = precision_of(result, 1.0)

    about = result.values.C_mc  # rotation vectors count from here, so that they are psi
    poses = [
        np.concatenate([x, vector_from_rotation(C @ C0.T)])
        for x, C, C0 in zip(first.position, first.C_mc, about, strict=True)
    ]
    columns = [INTERIOR.index(name) for name in FREE]
    interior = first.interior[0, columns].copy()
    points = {p: first.point[p].copy() for p in range(len(block.points))}
    problem, costs = pyceres.Problem(), []
    seen = block.observations
    for j in range(len(seen)):
        i, p = int(seen.image[j]), int(seen.point[j])
        if np.isnan(points[p]).any():
            continue
        costs.append(SixParameters(seen.uv[j], seen.sigma_px[j], about[i], plain.interior))
        problem.add_residual_block(costs[-1], None, [points[p], poses[i], interior])
    for p, X, cov in zip(
        block.control.point, block.control.position_m, block.control.cov, strict=True
    ):
        costs.append(Known(X, cov))
        problem.add_residual_block(costs[-1], None, [points[int(p)]])
    options = pyceres.SolverOptions()
    options.function_tolerance = options.parameter_tolerance = options.gradient_tolerance = 1e-14
    options.max_num_iterations = 100
    summary = pyceres.SolverSummary()
    pyceres.solve(options, problem, summary)
    assert result.cost == pytest.approx(2.0 * summary.final_cost, rel=1e-8)

    asked = [(interior, interior), *((pose, pose) for pose in poses)]
    covariance = pyceres.Covariance(pyceres.CovarianceOptions())
    assert covariance.compute(asked, problem)
    P = np.array(covariance.get_covariance_block(interior, interior)).reshape(len(FREE), -1)
    sigma = np.sqrt(np.diagonal(P))
    assert np.abs((result.values.interior[0, columns] - interior) / sigma).max() < 0.01
    assert precision.sigma_interior(0)[columns] == pytest.approx(sigma, rel=1e-4)
    for i, pose in enumerate(poses):
        P = np.array(covariance.get_covariance_block(pose, pose)).reshape(6, 6)
        sigma = np.sqrt(np.diagonal(P))
        off = np.concatenate([result.values.position[i] - pose[:3], pose[3:]])
        assert np.abs(off / sigma).max() < 0.01
        assert precision.pose_cov[i] == pytest.approx(P, abs=1e-4 * np.outer(sigma, sigma).max())
        assert np.sqrt(np.diagonal(precision.pose_cov[i])) == pytest.approx(sigma, rel=1e-4)


class Known(pyceres.CostFunction):
    """A ground control point."""

    def __init__(self, position, cov):
        super().__init__()
        self.set_num_residuals(3)
        self.set_parameter_block_sizes([3])
        self.position, self.root = position, np.linalg.cholesky(np.linalg.inv(cov)).T

    def Evaluate(self, parameters, residuals, jacobians):
        residuals[:] = self.root @ (self.position - np.array(parameters[0]))
        if jacobians is not None and jacobians[0] is not None:
            jacobians[0][:] = np.ravel(-self.root)
        return True
