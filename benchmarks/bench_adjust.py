"""Adjustment of image blocks: CPU and memory against Ceres, and how they grow with a corridor.

    python benchmarks/bench_adjust.py

440 images in eight strips (122 000 image points) with positions of the images and 20 ground control
points: the same observations and unknowns for both, from the same first values, to the same cost.
Ceres is that of pycolmap and pyceres with their compiled costs and manifolds, one thread and its
sparse Schur complement, the fastest of its solvers here; building its problem is not counted. It
gives no covariance: the posterior is compared with nothing. Each measurement has a process of its
own, so that its peak of memory is its own.
"""

import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

from common import one_thread

one_thread()

import numpy as np  # noqa: E402
from image_blocks import NOISE_PX, POSITION_M, VALUES, Case, strips  # noqa: E402

from insgnss.photogrammetry.adjust.adjustment import adjust_problem  # noqa: E402
from insgnss.photogrammetry.adjust.normals import problem_of  # noqa: E402
from insgnss.photogrammetry.adjust.precision import precision_of  # noqa: E402
from insgnss.photogrammetry.adjust.start import first_values  # noqa: E402

REPEATS = 3
CORRIDOR = (250, 500, 1000, 2000)
RATIO_BAR, MEMORY_BAR_MB, GROWTH_BAR = 2.5, 1500.0, 1.1
TOLERANCE = 1e-9  # of the cost, as ours


def timed(run: Callable[[], object]) -> tuple[float, object]:
    """CPU seconds of a call, and what it returns."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def ours(case: Case, posterior: bool) -> dict[str, float]:
    """Median CPU seconds of adjustment and posterior."""
    small = strips(2, 4)
    precision_of(adjust_problem(problem_of(small.block, small.groups), first_values(small.block)))
    first = first_values(case.block)
    solve, after = [], []
    for _ in range(REPEATS):
        seconds, result = timed(lambda: adjust_problem(problem_of(case.block, case.groups), first))
        solve.append(seconds)
        if posterior:
            after.append(timed(lambda: precision_of(result, 1.0))[0])  # type: ignore[arg-type]  # noqa: B023
    out = {"cpu": statistics.median(solve), "cost": result.cost, "steps": result.iterations}  # type: ignore[attr-defined]
    return out | ({"posterior": statistics.median(after)} if posterior else {})


def ceres(case: Case) -> dict[str, float]:
    """Median CPU seconds of Ceres on the same block."""
    import pyceres

    solve = []
    for _ in range(REPEATS):
        problem, _keep = ceres_problem(case)
        options, summary = pyceres.SolverOptions(), pyceres.SolverSummary()
        options.linear_solver_type = pyceres.LinearSolverType.SPARSE_SCHUR
        options.num_threads, options.max_num_iterations = 1, 100
        options.function_tolerance = TOLERANCE
        solve.append(timed(lambda: pyceres.solve(options, problem, summary))[0])  # noqa: B023
    return {
        "cpu": statistics.median(solve),
        "cost": 2.0 * summary.final_cost / NOISE_PX**2,
        "steps": summary.num_successful_steps + summary.num_unsuccessful_steps,
    }


def ceres_problem(case: Case) -> tuple[object, object]:
    """The problem as pycolmap builds it, with control; and what it points to.

    Its reprojection errors are in units of a pixel, so that all others are in units of the noise.
    """
    import pyceres
    import pycolmap
    from pycolmap import cost_functions

    block, first = case.block, first_values(case.block)
    scene, v = pycolmap.Reconstruction(), VALUES
    params = [
        v["f"],
        v["f"],
        v["cx"],
        v["cy"],
        v["k1"],
        v["k2"],
        v["p2"],
        v["p1"],
        v["k3"],
        0,
        0,
        0,
    ]
    scene.add_camera_with_trivial_rig(
        pycolmap.Camera(model="FULL_OPENCV", width=5120, height=3840, params=params, camera_id=1)
    )
    seen, tracks = block.observations, {}
    for i in range(len(block.images)):
        rows = np.flatnonzero(seen.image == i)
        image = pycolmap.Image(
            name=block.images[i], keypoints=seen.uv[rows], camera_id=1, image_id=i + 1
        )
        R = first.C_mc[i].T
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R), -R @ first.position[i])
        scene.add_image_with_trivial_frame(image, pose)
        for k, row in enumerate(rows):
            tracks.setdefault(int(seen.point[row]), pycolmap.Track()).add_element(i + 1, k)
    ids = {p: scene.add_point3D(first.point[p], track) for p, track in tracks.items()}
    options, config = pycolmap.BundleAdjustmentOptions(), pycolmap.BundleAdjustmentConfig()
    options.refine_principal_point = True
    for i in range(len(block.images)):
        config.add_image(i + 1)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(options, config, scene)
    problem = adjuster.problem
    problem.set_manifold(scene.camera(1).params, pyceres.SubsetManifold(12, [9, 10, 11]))
    costs = []
    for i in range(len(block.images)):
        cov = np.eye(3) * (POSITION_M / NOISE_PX) ** 2
        costs.append(cost_functions.AbsolutePosePositionPriorCost(cov, block.position_m[i]))
        frame = scene.frame(scene.image(i + 1).frame_id)
        problem.add_residual_block(costs[-1], None, [frame.rig_from_world.params])
    control = block.control
    for point, X, cov in zip(control.point, control.position_m, control.cov, strict=True):
        costs.append(pyceres.factors.NormalPrior(X, cov / NOISE_PX**2))
        problem.add_residual_block(costs[-1], None, [scene.point3D(ids[int(point)]).xyz])
    return problem, (scene, adjuster, costs)


def measured(who: str, count: int, images: int) -> dict[str, float]:
    """Run a measurement in a process of its own."""
    command = [sys.executable, __file__, who, str(count), str(images)]
    return dict(json.loads(subprocess.run(command, check=True, capture_output=True).stdout))


def one(who: str, count: int, images: int) -> None:
    """What such a process does."""
    case = strips(count, images)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    found = ceres(case) if who == "ceres" else ours(case, who == "posterior")
    found["peak"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    found |= {"before": before, "rays": len(case.block.observations)}
    print(json.dumps(found))


def main() -> None:
    """Print the tables and the bars."""
    print("| 440 images | CPU s | steps | cost | peak MB (before it began) |")
    print("|---|---|---|---|---|")
    pairs = [(measured("ours", 8, 55), measured("ceres", 8, 55)) for _ in range(REPEATS)]
    rows = {
        "insgnss": pairs[0][0],
        "with posterior": measured("posterior", 8, 55),
        "Ceres, sparse Schur": pairs[0][1],
    }
    for name, row in rows.items():
        cpu = row["cpu"] + row.get("posterior", 0.0)
        print(
            f"| {name} | {cpu:.2f} | {row['steps']} | {row['cost']:.4f} | {row['peak']:.0f}"
            f" ({row['before']:.0f}) |"
        )
    ratios = sorted(theirs["cpu"] / mine["cpu"] for mine, theirs in pairs)
    ratio = statistics.median(ratios)
    print(f"\nratios {', '.join(f'{r:.1f}' for r in ratios)}")
    print(f"ratio {ratio:.1f} (bar: {RATIO_BAR}) {'met' if ratio >= RATIO_BAR else 'MISSED'}\n")
    print("| corridor, images | image points | CPU s | posterior | ms an image | peak MB |")
    print("|---|---|---|---|---|---|")
    each = []
    for images in CORRIDOR:
        row = measured("posterior", 2, images // 2)
        whole = row["cpu"] + row["posterior"]
        each.append(1e3 * whole / images)
        print(
            f"| {images} | {row['rays']} | {row['cpu']:.2f} | {row['posterior']:.2f} |"
            f" {each[-1]:.2f} | {row['peak']:.0f} |"
        )
    growth, peak = each[-1] / min(each[1:-1]), row["peak"]
    linear, small = growth <= GROWTH_BAR, peak < MEMORY_BAR_MB
    print(
        f"\nan image among 2000 costs {growth:.2f} of one among 500 or 1000 (bar: {GROWTH_BAR},"
        f" linear) {'met' if linear else 'MISSED'}; peak {peak:.0f} MB (bar:"
        f" {MEMORY_BAR_MB:.0f}) {'met' if small else 'MISSED'}"
    )
    if ratio < RATIO_BAR or not linear or not small:
        sys.exit(1)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        one(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    else:
        main()
