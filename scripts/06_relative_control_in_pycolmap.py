"""Story 6: absolute and relative priors with full covariance in a bundle adjustment, pycolmap's
own, and what they gain.

    python scripts/06_relative_control_in_pycolmap.py
        24 simulated flights of 3 minutes, under a minute of work
    python scripts/06_relative_control_in_pycolmap.py --quick
        4 flights

Needs `pip install pycolmap pyceres`. Each flight is simulated and processed from its files to
eo.json. Of its longest line a corridor block is made: tie points are few, as over crops or water,
and measured to one pixel; no control points. The block is adjusted by pycolmap from the processed
orientations, in five ways of using what eo.json says about their errors, and its poses are compared
with the truth:

    diagonal      AbsolutePosePriorCost of every image, standard deviations only: what most programs
                  take
    absolute      the same with the full 6x6 of every image
    relative      AbsolutePosePriorCost of the first image, RelativePosePriorCost of each pair of
                  neighbours, both 6x6
    both          absolute of every image and relative of every pair: the same information twice
    chained       absolute of the first image, then each image given the one before: all that cov6
                  and cross_cov6_next say, once

Errors of neighbours are nearly the same. `absolute` takes them for independent, believes their mean
to be better than it is, and does not know how well neighbours fit together: it gives away relative
attitude that the processing had. `relative` alone, without control points, swings about the first
image. `chained` knows all of it. With J the errors' Jacobian of pycolmap's residuals, in the axes
of the sensor, rotation before translation (C camera to frame, r offset and psi of the relative pose
in the axes of camera i):

    absolute      (C^T psi, C^T dx)                    relative   (psi, dr + r x psi)          (S.1)
    chained       A_j - G A_i,  G = P_ji P_ii^-1,  covariance P_jj - G P_ij,
                  A the residuals of absolute priors                                           (S.2)

The sign of both residuals of an absolute prior is minus, which leaves its covariance alone; the
offset of a relative residual is taken after its rotation, which adds r x psi to (R.3) of
`insgnss.navigation.orient.relative`.

It ends in the results as csv, relative.csv of the first flight, a figure, and an assertion: with
`chained` attitudes and relative poses are better than with `diagonal`, and the covariance after the
adjustment is as large as the errors.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

try:
    import pyceres
    import pycolmap
    from pycolmap import cost_functions
except ImportError:
    sys.exit("this story needs pycolmap and pyceres: pip install pycolmap pyceres")
from matplotlib.figure import Figure

import insgnss
from insgnss.geodesy.rotation import skew, vector_from_rotation
from insgnss.io.formats.orientation.relative_csv import write_relative_csv

WAYS = ("diagonal", "absolute", "relative", "both", "chained")
COLOURS = dict(zip(WAYS, ("#8A8F98", "#0072B2", "#E69F00", "#D55E00", "#009E73"), strict=True))
PANELS = (
    ("position", 1e3, "mm"),
    ("attitude", np.degrees(1.0), "deg"),
    ("relative position", 1e3, "mm"),
    ("relative attitude", np.degrees(1.0), "deg"),
    ("ground points", 1e3, "mm"),
    ("nees", 1.0, "over_6"),
)
FOCAL_PX, WIDTH_PX, HEIGHT_PX = 0.035 / 6.4e-6, 5120, 3840  # the camera of paper 000
POINTS_PER_IMAGE, PIXEL = 6, 1.0
Seen = list[list[tuple[int, np.ndarray]]]  # per image: point, pixels
SWAP = np.block(
    [[np.zeros((3, 3)), np.eye(3)], [np.eye(3), np.zeros((3, 3))]]
)  # (x, psi) to (psi, x)


@dataclass(frozen=True)
class Block:
    """Images of one line: as processed and true, the relative control of their pairs, tie points
    and what each image sees of them.
    """

    position: np.ndarray
    C: np.ndarray
    cov: np.ndarray
    cross: np.ndarray
    true_position: np.ndarray
    true_C: np.ndarray
    relative: insgnss.RelativeControl
    rows: np.ndarray
    points: np.ndarray
    seen: Seen


@dataclass(frozen=True)
class Solved:
    """Positions (n, 3), attitudes (n, 3, 3), covariances (n, 6, 6) of (dx, psi), and errors (p, 3)
    of the tie points on the ground.
    """

    position: np.ndarray
    C: np.ndarray
    cov: np.ndarray
    ground: np.ndarray


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. Flights, processed from their files, and a block of each.
    blocks = [
        fly(options.out, seed, options.quick)
        for seed in range(options.flights or (4 if options.quick else 24))
    ]
    write_relative_csv(blocks[0].relative, options.out / "relative.csv")

    # 2. Each block adjusted in all ways.
    found = {way: [adjusted(block, way) for block in blocks] for way in WAYS}
    figures = {way: summary(blocks, found[way]) for way in WAYS} | {
        "as processed": summary(blocks, [unadjusted(b) for b in blocks])
    }
    report(figures, blocks, options.out / "pycolmap_block.csv")

    # 3. A figure.
    draw(figures, blocks, found, options.out / "pycolmap_block.png")
    print(f"wrote {options.out / 'pycolmap_block.png'}")

    # 4. The assertion.
    for name in ("attitude", "relative position", "relative attitude", "ground points"):
        gain = 1.0 - figures["chained"][name] / figures["diagonal"][name]
        print(f"chained against diagonal, {name}: {100.0 * gain:+.0f} %")
        assert gain > 0.0 or name == "ground points", (
            f"the chained priors make the {name} worse than standard deviations alone"
        )
    nees = figures["chained"]["nees"]
    low, high = (0.4, 2.5) if options.quick else (0.7, 1.4)
    assert low < nees < high, (
        "the covariance of the chained adjustment does not fit its errors: NEES over 6 is"
        f" {nees:.2f}"
    )


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Absolute and relative priors in pycolmap.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_6"),
        help="directory of all results (default: story_6)",
    )
    parser.add_argument("--quick", action="store_true", help="few and small flights")
    parser.add_argument("--flights", type=int, help="number of flights")
    return parser.parse_args()


def fly(out: Path, seed: int, quick: bool) -> Block:
    """A flight, simulated unless it is there, processed from its files, and the block of its
    longest line.
    """
    directory = out / f"flight_{seed}{'_quick' * quick}"
    if not directory.exists():
        minutes = 2.0 if quick else 3.0
        plan = {"start_in_air": True, "line_length_m": 500.0}
        insgnss.simulate("ign8", minutes, directory=directory, imu_rate_hz=100.0, seed=seed, **plan)
    insgnss.process(directory, directory / "out")
    eo = insgnss.read_eo(directory / "out")
    relative = insgnss.relative_control(eo, "navchip", form="camera")
    with np.load(directory / "truth" / "eo.npz") as truth:
        row = {str(image): k for k, image in enumerate(truth["images"])}
        at = [row[image] for image in eo.images]
        return block_of(
            eo, truth["position_enu"][at], truth["C_mc"][at], relative, np.random.default_rng(seed)
        )


def block_of(
    eo: insgnss.ExteriorOrientation,
    X: np.ndarray,
    C: np.ndarray,
    relative: insgnss.RelativeControl,
    rng: np.random.Generator,
) -> Block:
    """The images of the line with most pairs, their true poses X, C, and simulated tie points on
    rolling ground.
    """
    pairs = np.flatnonzero(relative.line == np.bincount(relative.line).argmax())
    rows = np.arange(relative.i[pairs[0]], relative.j[pairs[-1]] + 1)
    X, C = X[rows], C[rows]
    points, seen = tie_points(X, C, float(X[:, 2].mean()) - 140.0, rng)
    return Block(
        eo.position_m[rows],
        eo.C_mc[rows],
        eo.cov[rows],
        eo.cross[rows[:-1]],
        X,
        C,
        relative,
        pairs,
        points,
        seen,
    )


def tie_points(
    X: np.ndarray, C: np.ndarray, ground: float, rng: np.random.Generator
) -> tuple[np.ndarray, list[list[tuple[int, np.ndarray]]]]:
    """Points (p, 3) under the line that two images or more see, and per image (point, pixels)."""
    n = len(X)
    under = X[rng.integers(0, n, POINTS_PER_IMAGE * n)] + rng.uniform(
        -40.0, 40.0, (POINTS_PER_IMAGE * n, 3)
    )
    points = np.column_stack([under[:, :2], ground + 3.0 * rng.standard_normal(len(under))])
    ray = np.einsum("nij,npi->npj", C, points - X[:, None])
    pixels = FOCAL_PX * ray[..., :2] / ray[..., 2:] + [0.5 * WIDTH_PX, 0.5 * HEIGHT_PX]
    inside = ((pixels > 0.0) & (pixels < [WIDTH_PX, HEIGHT_PX])).all(axis=2)
    kept = np.flatnonzero(inside.sum(axis=0) > 1)
    pixels = pixels + PIXEL * rng.standard_normal(pixels.shape)
    return points[kept], [
        [(number, pixels[k, p]) for number, p in enumerate(kept) if inside[k, p]] for k in range(n)
    ]


def pose(C: np.ndarray, X: np.ndarray) -> Any:
    """pycolmap's camera from world."""
    return pycolmap.Rigid3d(pycolmap.Rotation3d(C.T), -C.T @ X)


def reconstruction(block: Block) -> Any:
    """Cameras, images at their processed poses and tie points as pycolmap has them; points start
    from the ground below.
    """
    model = pycolmap.Reconstruction()
    parameters = [FOCAL_PX, FOCAL_PX, 0.5 * WIDTH_PX, 0.5 * HEIGHT_PX]
    camera = pycolmap.Camera(
        model="PINHOLE", width=WIDTH_PX, height=HEIGHT_PX, params=parameters, camera_id=1
    )
    model.add_camera_with_trivial_rig(camera)
    tracks = [pycolmap.Track() for _ in block.points]
    for k, seen in enumerate(block.seen):
        image = pycolmap.Image(name=f"{k}.tif", camera_id=1, image_id=k + 1)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(pixels) for _, pixels in seen])
        model.add_image_with_trivial_frame(image, pose(block.C[k], block.position[k]))
        for number, (point, _) in enumerate(seen):
            tracks[point].add_element(k + 1, number)
    for point, track in zip(block.points, tracks, strict=True):
        model.add_point3D(point + [0.5, 0.5, 2.0], track, np.zeros(3, dtype=np.uint8))
    return model


def adjusted(block: Block, way: str) -> Solved:
    """What pycolmap's adjustment gives."""
    model, n = reconstruction(block), len(block.C)
    config = pycolmap.BundleAdjustmentConfig()
    for k in range(n):
        config.add_image(k + 1)
    config.set_constant_cam_intrinsics(1)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(
        pycolmap.BundleAdjustmentOptions(print_summary=False), config, model
    )
    poses = [model.image(k + 1).frame.rig_from_world.params for k in range(n)]
    kept = add_priors(adjuster.problem, block, poses, way)
    adjuster.solve()
    covariance = pyceres.Covariance(pyceres.CovarianceOptions())
    assert covariance.compute([(p, p) for p in poses], adjuster.problem), (
        "the adjustment is singular"
    )
    X, C, P = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 6, 6))
    for k in range(n):
        camera_from_world = model.image(k + 1).cam_from_world()
        C[k], t = camera_from_world.rotation.matrix().T, camera_from_world.translation
        X[k] = -C[k] @ t
        P[k] = in_frame_axes(
            covariance.get_covariance_block_tangent_space(poses[k], poses[k], adjuster.problem),
            C[k],
            t,
        )
    del kept
    ground = np.array([model.point3D(number + 1).xyz for number in range(len(block.points))])
    return Solved(X, C, P, block.points - ground)


def in_frame_axes(P: np.ndarray, C: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of (dx, psi) from that of Ceres' increments: half the rotation vector on
    the left of camera from world, then t.
    """
    J = np.zeros((6, 6))
    J[:3, :3], J[:3, 3:], J[3:, :3] = -2.0 * C @ skew(t), -C, -2.0 * C
    return J @ P @ J.T


def add_priors(problem: Any, block: Block, poses: list[np.ndarray], way: str) -> list[Any]:
    """Add what eo.json says to the problem in one of `WAYS`; the costs, which Python must keep
    alive.
    """
    n = len(poses)
    absolute = sensor_covariances(block)
    costs: list[Any] = []
    for k in range(n if way in ("diagonal", "absolute", "both") else 1):
        P = absolute[k][k]
        if way == "diagonal":
            turn = sensor_jacobian(block.C[k])
            P = turn @ np.diag(np.diag(block.cov[k])) @ turn.T
        costs.append(
            (
                cost_functions.AbsolutePosePriorCost(P, pose(block.C[k], block.position[k])),
                [poses[k]],
            )
        )
    for k, row in enumerate(block.rows):
        pair = [poses[k], poses[k + 1]]
        if way in ("relative", "both"):
            r, E = block.relative.offset[row], block.relative.rotation[row]
            J = np.block([[np.zeros((3, 3)), np.eye(3)], [np.eye(3), skew(r)]])  # (S.1)
            P = J @ block.relative.smoothed[row] @ J.T
            costs.append(
                (
                    cost_functions.RelativePosePriorCost(
                        P, pycolmap.Rigid3d(pycolmap.Rotation3d(E), r)
                    ),
                    pair,
                )
            )
        elif way == "chained":
            costs.append((Conditional(block, absolute, k), pair))
    for cost, parameters in costs:
        problem.add_residual_block(cost, None, parameters)
    return costs


def sensor_jacobian(C: np.ndarray) -> np.ndarray:
    """(6, 6): (dx, psi) in the frame to (psi, dx) in the axes of the camera (S.1)."""
    return np.kron(np.eye(2), C.T) @ SWAP


def sensor_covariances(block: Block) -> dict[int, dict[int, np.ndarray]]:
    """Covariance of the residuals of absolute priors, of each image k: [k][k], and with the next:
    [k][k + 1].
    """
    J = [sensor_jacobian(C) for C in block.C]
    out = {k: {k: J[k] @ P @ J[k].T} for k, P in enumerate(block.cov)}
    for k, P in enumerate(block.cross):
        out[k][k + 1] = J[k] @ P @ J[k + 1].T
    return out


class Conditional(pyceres.CostFunction):  # type: ignore[misc]
    """(S.2): the pose of image k + 1 given that of image k, whitened; made of two of pycolmap's own
    costs.
    """

    def __init__(self, block: Block, covariances: dict[int, dict[int, np.ndarray]], k: int) -> None:
        super().__init__()
        self.set_num_residuals(6)
        self.set_parameter_block_sizes([7, 7])
        P_ij = covariances[k][k + 1]
        G = np.linalg.solve(covariances[k][k], P_ij).T
        rest = covariances[k + 1][k + 1] - G @ P_ij
        whiten = np.linalg.inv(np.linalg.cholesky(0.5 * (rest + rest.T)))
        self.factors = (-whiten @ G, whiten)
        self.costs = [
            cost_functions.AbsolutePosePriorCost(np.eye(6), pose(block.C[j], block.position[j]))
            for j in (k, k + 1)
        ]

    def Evaluate(self, parameters: Any, residuals: Any, jacobians: Any) -> bool:
        """Residual and Jacobians, as Ceres asks for them."""
        residuals[:] = 0.0
        for number, (factor, cost) in enumerate(zip(self.factors, self.costs, strict=True)):
            value, (jacobian,) = cost.evaluate(parameters[number])
            residuals += factor @ np.ravel(value)
            if jacobians is not None:
                jacobians[number][:] = (factor @ jacobian).ravel()
        return True


def unadjusted(block: Block) -> Solved:
    """The orientations as processed, without ground points."""
    return Solved(block.position, block.C, block.cov, np.full((1, 3), np.nan))


def errors(block: Block, X: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, 6) of the poses, truth minus found, and (n - 1, 6) of neighbours' relative poses,
    in the axes of the earlier camera.
    """
    psi = vector_from_rotation(block.true_C @ np.swapaxes(C, 1, 2))
    r, E = relative_poses(X, C)
    true_r, true_E = relative_poses(block.true_position, block.true_C)
    return np.hstack([block.true_position - X, psi]), np.hstack(
        [true_r - r, vector_from_rotation(true_E @ np.swapaxes(E, 1, 2))]
    )


def relative_poses(X: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    C_if = np.swapaxes(C[:-1], 1, 2)
    return np.einsum("nij,nj->ni", C_if, np.diff(X, axis=0)), C_if @ C[1:]


def summary(blocks: list[Block], found: list[Solved]) -> dict[str, float]:
    """Root mean squares over all flights: m and rad; NEES over 6 degrees of freedom of single
    images, mean.
    """
    poses, pairs, nees = [], [], []
    for block, solved in zip(blocks, found, strict=True):
        of_poses, of_pairs = errors(block, solved.position, solved.C)
        poses.append(of_poses)
        pairs.append(of_pairs)
        nees.append(
            np.einsum(
                "ni,ni->n", of_poses, np.linalg.solve(solved.cov, of_poses[:, :, None])[:, :, 0]
            )
            / 6.0
        )
    e, r = np.concatenate(poses), np.concatenate(pairs)
    return {
        "position": root_mean_square(e[:, :3]),
        "attitude": root_mean_square(e[:, 3:]),
        "relative position": root_mean_square(r[:, :3]),
        "relative attitude": root_mean_square(r[:, 3:]),
        "ground points": root_mean_square(np.concatenate([solved.ground for solved in found])),
        "nees": float(np.concatenate(nees).mean()),
    }


def root_mean_square(v: np.ndarray) -> float:
    """Of the length of vectors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(v**2, axis=1))))


def report(figures: dict[str, dict[str, float]], blocks: list[Block], path: Path) -> None:
    """The table, on the screen and as csv."""
    print(
        f"{len(blocks)} blocks of {min(len(b.C) for b in blocks)} to"
        f" {max(len(b.C) for b in blocks)} images, rms of the errors"
    )
    heads = [f"{name.replace(' ', '_')}_{unit}" for name, _, unit in PANELS]
    print(" " * 14 + "".join(f"{head:>23}" for head in heads))
    rows = [",".join(("way", *heads))]
    for way in ("as processed", *WAYS):
        values = [figures[way][name] * factor for name, factor, _ in PANELS]
        print(f"{way:<14}" + "".join(f"{value:23.4f}" for value in values))
        rows.append(",".join((way, *(f"{value:.6g}" for value in values))))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def draw(
    figures: dict[str, dict[str, float]],
    blocks: list[Block],
    found: dict[str, list[Solved]],
    path: Path,
) -> None:
    """Top: rms of poses, relative poses and ground points in each way, and NEES; below, errors
    along the first block.
    """
    names = ("as processed", *WAYS)
    figure = Figure(figsize=(14.5, 7.4), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.15, 1))
    for number, (axes, (name, factor, unit)) in enumerate(
        zip(top.subplots(1, len(PANELS)), PANELS, strict=True)
    ):
        values = np.array([factor * figures[way][name] for way in names])
        limit = 1.35 * float(
            np.nanmax(
                [value for way, value in zip(names, values, strict=True) if way != "relative"]
            )
        )
        axes.barh(names, np.minimum(np.nan_to_num(values), limit), color=["0.2", *COLOURS.values()])
        for row, value in enumerate(values):
            beyond = value > 0.8 * limit
            text = "none" if np.isnan(value) else f"{value:.3g}"
            place = 0.97 * limit if beyond else 0.02 * limit + np.nan_to_num(value)
            axes.text(
                place,
                row,
                text,
                va="center",
                ha="right" if beyond else "left",
                size=8,
                color="black",
            )
        axes.set(
            title=name if name != "nees" else "NEES",
            xlabel="over 6 degrees of freedom" if name == "nees" else unit,
            xlim=(0.0, limit),
        )
        axes.invert_yaxis()
        if name == "nees":
            axes.axvline(1.0, color="0.4", lw=1.0, ls="--", zorder=0)
        if number:
            axes.set_yticklabels([])
    top.suptitle(
        f"{len(blocks)} corridor blocks, {POINTS_PER_IMAGE} tie points an image of {PIXEL:g} px, no"
        " control points: rms of the errors"
    )
    left, right = bottom.subplots(1, 2)
    block = blocks[0]
    for way in ("as processed", "diagonal", "absolute", "chained"):
        solved = unadjusted(block) if way == "as processed" else found[way][0]
        of_poses, of_pairs = errors(block, solved.position, solved.C)
        style = {"color": COLOURS.get(way, "0.2"), "label": way, "marker": "o", "ms": 3.5}
        left.plot(np.degrees(of_poses[:, 5]), **style)
        right.plot(np.degrees(np.linalg.norm(of_pairs[:, 3:], axis=1)), **style)
    left.set(title="first block: errors of heading", xlabel="image", ylabel="deg")
    right.set(
        title="first block: errors of the relative attitude of neighbours",
        xlabel="pair",
        ylabel="deg",
    )
    right.set_ylim(bottom=0.0)
    left.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
