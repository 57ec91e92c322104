"""Adjustment in the modes of paper 003: CPU of Fast AT and of relative control.

    python benchmarks/bench_modes.py

Fast AT of block 2015 as it is simulated (207 images, 20 ground points), from the records that were
read: aerial control, first values, adjustment, covariances and tests, and beside it the whole of
`insgnss.adjust_block`, which rejects gross errors and tries what a block file leaves out. Relative
control of whole strips on the block of `bench_adjust.py` (440 images, 122 000 image points), which
has the shape of flight ign8, beside absolute control with the same covariances.
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from common import one_thread

one_thread()

import numpy as np  # noqa: E402
from image_blocks import POSITION_M, TILT_DEG, Case, strips  # noqa: E402
from published_blocks.files import write_survey  # noqa: E402
from published_blocks.survey import simulate_survey  # noqa: E402

from insgnss.flight.config.block_file import load_block  # noqa: E402
from insgnss.photogrammetry.adjust.adjustment import adjust_problem  # noqa: E402
from insgnss.photogrammetry.adjust.aerial import AerialControl  # noqa: E402
from insgnss.photogrammetry.adjust.groups import ObservationGroup, control_points, weight_of  # noqa: E402
from insgnss.photogrammetry.adjust.normals import problem_of  # noqa: E402
from insgnss.photogrammetry.adjust.precision import precision_of  # noqa: E402
from insgnss.photogrammetry.adjust.relative import (  # noqa: E402
    Datum,
    ObservedStrip,
    RelativeAerialControl,
    operator,
    relative_covariance,
)
from insgnss.photogrammetry.adjust.start import first_values  # noqa: E402
from insgnss.photogrammetry.block_adjustment.aerial.control import control_of  # noqa: E402
from insgnss.photogrammetry.block_adjustment.inputs import BlockInputs, inputs_of  # noqa: E402
from insgnss.photogrammetry.block_adjustment.solve import set_up  # noqa: E402

REPEATS = 5
FAST_AT_BAR, RELATIVE_BAR = 0.3, 4.0
STRIPS, IMAGES = 8, 55
CONTROLS = ("Ap/Aa", "Ap/Ra", "Rp/Ra")


def median_cpu(run: Callable[[], object]) -> float:
    """Median CPU seconds of a call, after one that warms it."""
    run()
    seconds = []
    for _ in range(REPEATS):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds)


def fast_at() -> float:
    """Print Fast AT of block 2015; return the largest CPU of the adjustment."""
    print("| Fast AT, 207 images, 20 ground points | adjustment, CPU s | all of adjust_block |")
    print("|---|---|---|")
    worst = 0.0
    with tempfile.TemporaryDirectory() as directory:
        file = load_block(write_survey(Path(directory) / "block", simulate_survey("block2015")))
        calibrated = replace(file.camera, file=file.path.with_name("camera_calibrated.toml"))
        for control in CONTROLS:
            own = replace(
                file,
                camera=calibrated,
                adjustment=replace(file.adjustment, mode="fast_at"),
                aerial_control=replace(file.aerial_control, control=control),
            )
            inputs = inputs_of(own, lambda _: None)
            cpu = median_cpu(lambda: solution(inputs))  # noqa: B023
            whole = median_cpu(lambda: adjust_problem(own, write=False))  # noqa: B023
            print(f"| {control} | {cpu:.2f} | {whole:.1f} |")
            worst = max(worst, cpu)
    return worst


def solution(inputs: BlockInputs) -> None:
    """Adjust, with covariances and tests."""
    precision_of(adjust_problem(*set_up(inputs, control_of(inputs))), 1.0)


def relative_control() -> float:
    """Print ISO of 440 images; return the CPU with relative control."""
    case = strips(STRIPS, IMAGES)
    print("\n| ISO, 440 images | CPU s | with covariances and tests |\n|---|---|---|")
    for name in ("absolute", "relative"):
        groups = [*control_points(case.block.control), *of_strips(case, name == "relative")]
        first = first_values(case.block)
        problem = problem_of(case.block, groups)
        cpu = median_cpu(lambda: adjust_problem(problem, first))  # noqa: B023
        done = adjust_problem(problem, first)
        whole = cpu + median_cpu(lambda: precision_of(done, 1.0))  # noqa: B023
        print(f"| {name} position and attitude | {cpu:.2f} | {whole:.2f} |")
    return whole


def of_strips(case: Case, relative: bool) -> list[ObservationGroup]:
    """Aerial control of each strip with the covariance of all its poses."""
    n, block = IMAGES, case.block
    dt = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * 2.0
    in_time = 0.75 * np.exp(-dt / 300.0) + 0.25 * np.eye(n)
    P = np.kron(in_time, np.diag(np.repeat([POSITION_M, np.radians(TILT_DEG)], 3) ** 2))
    pairs = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    time_s, zeros = 2.0 * np.arange(n), np.zeros((n, 3))
    groups: list[ObservationGroup] = []
    for strip in range(STRIPS):
        rows = tuple(range(strip * n, strip * n + n))
        X, C = block.position_m[list(rows)], block.C_mc[list(rows)]
        if not relative:
            groups.append(AerialControl(rows, X, C, weight_of(P, ""), time_s, zeros, zeros))
            continue
        observed = ObservedStrip("relative", True, pairs)
        weight = weight_of(relative_covariance(operator(C, observed), P), "")
        poses = (rows, X, C, weight, time_s, zeros, zeros)
        groups.append(RelativeAerialControl(*poses, observed=observed))
        groups.append(Datum(rows[0], X[0], C[0], (5.0, float(np.radians(2.0)))))
    return groups


def main() -> None:
    """Print the tables and the bars."""
    fast, relative = fast_at(), relative_control()
    for name, cpu, bar in (
        ("Fast AT", fast, FAST_AT_BAR),
        ("ISO with relative control", relative, RELATIVE_BAR),
    ):
        print(f"\n{name}: {cpu:.2f} s (bar: {bar}) {'met' if cpu < bar else 'MISSED'}")
    if fast >= FAST_AT_BAR or relative >= RELATIVE_BAR:
        sys.exit(1)


if __name__ == "__main__":
    main()
