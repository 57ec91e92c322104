"""Image blocks that the Damped Bundle Adjustment Toolbox has adjusted, beside its printed reports.

    python scripts/adjust_dbat.py ../shared/data/dbat/script

The directory is `data/script` of github.com/niclasborlin/dbat, which is not part of the project.
Each block is read, adjusted and judged in a process of its own; the table has sigma_0, the camera
constant, the largest difference of a printed pose in its printed standard deviations, the largest
difference of a printed standard deviation in percent, and the CPU time with reading, adjustment and
covariances (kernels compiled before).
"""

import argparse
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np

BLOCKS = {
    "five parameters": ("romabundledemo", "result/report.txt"),
    "nine parameters": ("romabundledemo", "selfcal-report.txt"),
    "control, check points": ("sxb", "result/report.txt"),
}


def main() -> None:
    """Adjust all blocks and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="directory with romabundledemo and sxb")
    parser.add_argument("--only", choices=sorted(BLOCKS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        print(row(options.data, options.only))
        return
    print(f"{'block':<22}{'sigma0':>10}{'printed':>10}{'f, mm':>13}{'pose, sigma':>13}", end="")
    print(f"{'sigmas, %':>11}{'steps':>7}{'CPU, s':>8}")
    for name in BLOCKS:
        command = [sys.executable, __file__, str(options.data), "--only", name]
        for _ in range(2):  # the first one may compile
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        print(done.stdout, end="")


def row(data: Path, name: str) -> str:
    """Return the line of one block."""
    start = time.process_time()
    from insgnss.geodesy.rotation import CV_RUB, opk_from_rotation, opk_jacobian
    from insgnss.io.formats.blocks.dbat import read_dbat
    from insgnss.photogrammetry.adjust.adjustment import adjust_problem
    from insgnss.photogrammetry.adjust.groups import control_points
    from insgnss.photogrammetry.adjust.normals import problem_of
    from insgnss.photogrammetry.adjust.precision import precision_of
    from insgnss.photogrammetry.adjust.start import first_values
    from insgnss.records.block import INTERIOR

    folder, report = BLOCKS[name]
    block = read_dbat(data / folder / f"{folder}.xml")
    if name == "nine parameters":
        free = tuple(n for n in INTERIOR if n not in ("b2", "k4"))
        block = replace(block, cameras=(replace(block.cameras[0], free=free),))
    result = adjust_problem(problem_of(block, control_points(block.control)), first_values(block))
    precision = precision_of(result)
    spent = time.process_time() - start

    text = (data / folder / report).read_text()
    opk = opk_from_rotation(result.values.C_mc @ CV_RUB)
    F = np.linalg.inv(opk_jacobian(opk))
    cov = precision.pose_cov
    angles = np.degrees(np.sqrt(np.einsum("nij,njk,nik->ni", F, cov[:, 3:, 3:], F)))
    sigma = np.hstack([angles, np.sqrt(np.diagonal(cov, axis1=1, axis2=2)[:, :3])])
    values = np.hstack([np.degrees(opk), result.values.position])
    off, ratio = 0.0, 0.0
    for i, photograph in enumerate(re.split(r"\n +Photo (?=\d+: )", text)[1:]):
        for k, label in enumerate(("Omega", "Phi", "Kappa", "Xc", "Yc", "Zc")):
            printed = re.search(rf"{label}:\s+Value: +(\S+) \w+\n\s+Deviation: +(\S+)", photograph)
            if printed is not None:
                value, deviation = float(printed[1]), float(printed[2])
                off = max(off, abs(values[i, k] - value) / deviation)
                ratio = max(ratio, abs(sigma[i, k] / deviation - 1.0))
    printed = re.search(r"Sigma0: +(\S+)", text)
    f = result.values.interior[0, 0] / block.cameras[0].unit_px
    shown = printed[1] if printed is not None else ""
    numbers = f"{off:13.4f}{100.0 * ratio:11.2f}{result.iterations:7d}{spent:8.2f}"
    if name == "nine parameters":  # its fixed image has more digits than the script's
        numbers = f"{'':24}{result.iterations:7d}{spent:8.2f}"
    return f"{name:<22}{result.sigma0:10.6f}{shown:>10}{f:13.7f}{numbers}"


if __name__ == "__main__":
    main()
