"""Simulated image blocks adjusted with the aerial control of their own processed flights.

    python scripts/adjust_simulated.py --flight ign8 --blocks 30
    python scripts/adjust_simulated.py --flight ign6x1 --blocks 12

Each block is flown, processed and adjusted with seeds of its own. The table has, with the bounds of
chi-square (99 %) over all blocks, the mean normalised squares of poses, camera, bore-sight and
check points against the truth, the variance components, and the steps of the iteration; of the
corridor, which has no ground control, the scatter of the camera constant by the covariance that
weighs the aerial control: of each image alone, chained, or of the whole flight line.

    python scripts/adjust_simulated.py --table4

flies ign8, calibrates its camera, and takes this calibration and that of another flight (Table 3 of
paper 000) to corridors without ground control: as it is (Fix), and with f, cx, cy estimated again
(Lead), beside Table 4 of the paper.
"""

import argparse
import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np
from scipy.stats import chi2

KINDS = ("strip", "chain", "image")


def main() -> None:
    """Fly, process, adjust, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flight", choices=("ign8", "ign6x1"), default="ign8")
    parser.add_argument("--blocks", type=int, default=30)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--minutes", type=float, help="of each flight; by default its whole plan")
    parser.add_argument("--imu-rate", type=float, default=100.0)
    slow = "time-correlated error of the fixes, in their sigmas, of 300 s; the flight file says it"
    parser.add_argument("--correlated", type=float, default=0.0, help=slow)
    lead = "of the corridor: only f, cx, cy of the calibration are off, as its adjustment takes it"
    parser.add_argument("--lead", action="store_true", help=lead)
    parser.add_argument("--table4", action="store_true", help="the experiment of Table 4")
    options = parser.parse_args()
    if options.table4:
        table4(options)
        return
    kinds = KINDS if options.flight == "ign6x1" else KINDS[:1]
    rows = {kind: [] for kind in kinds}
    for k in range(options.blocks):
        with tempfile.TemporaryDirectory() as directory:
            flown = Path(directory) / "flight"
            fly(flown, options, options.first_seed + k)
            for kind in kinds:
                rows[kind].append(adjusted(flown, kind))
        line = f"block {k + 1} of {options.blocks}: "
        line += ", ".join(f"f {rows[kind][-1]['f']:+.2f} px ({kind})" for kind in kinds)
        print(line, flush=True)
    for kind in kinds:
        print(f"\n{options.flight}, {options.blocks} blocks, covariance of aerial control: {kind}")
        table(rows[kind])


TABLE_4 = {  # mm, E N h of Table 4: mean, largest, root mean square
    ("ignCal2", "Fix"): ((56, -8, 185), (95, 38, 243), (60, 21, 186)),
    ("ign8", "Fix"): ((22, -5, 1), (58, 28, 46), (29, 12, 17)),
    ("ignCal2", "Lead"): ((2, 1, 48), (40, 28, 96), (22, 15, 52)),
    ("ign8", "Lead"): ((4, -1, 15), (38, 23, 60), (20, 11, 23)),
}


def table4(options: argparse.Namespace) -> None:
    """Take two calibrations to corridors, and print their check points beside the paper's."""
    from insgnss.flight.config.block_file import load_block
    from insgnss.photogrammetry.block_adjustment.run import adjust
    from insgnss.simulation.image_block import IGN_CAL2, LEADING

    block_flight = argparse.Namespace(**{**vars(options), "flight": "ign8", "lead": False})
    corridor = argparse.Namespace(**{**vars(options), "flight": "ign6x1", "lead": False})
    with tempfile.TemporaryDirectory() as directory:
        flown = Path(directory) / "ign8"
        fly(flown, block_flight, options.first_seed)
        solved = adjust(load_block(flown), write=False).solved
        values = solved.result.values
        (calibrated,) = values.cameras(solved.result.problem.block.cameras)
    cameras = {"ignCal2": IGN_CAL2, "ign8": calibrated}
    seen = {key: [] for key in TABLE_4}
    for k in range(options.blocks):
        with tempfile.TemporaryDirectory() as directory:
            flown = Path(directory) / "ign6x1"
            fly(flown, corridor, options.first_seed + 1000 + k)
            for name, how in TABLE_4:
                camera = replace(cameras[name], free=LEADING if how == "Lead" else ())
                seen[(name, how)].append(check_points(flown, camera))
        print(f"corridor {k + 1} of {options.blocks}", flush=True)
    form = "{:>4} / {:>4} / {:>4}"
    print(f"\n{'':23}{'mean':>20}{'largest':>20}{'rms':>20}   mm, E N h")
    for key, paper in TABLE_4.items():
        d = [1e3 * x for x in seen[key]]
        rows = [
            np.mean([x.mean(axis=0) for x in d], axis=0),
            np.mean([np.abs(x).max(axis=0) for x in d], axis=0),
            np.sqrt(np.mean([(x**2).mean(axis=0) for x in d], axis=0)),
        ]
        for who, numbers in (("simulated", rows), ("paper", paper)):
            words = "".join(f"{form.format(*(f'{x:.0f}' for x in row)):>20}" for row in numbers)
            print(f"{key[0]:>8} {key[1]:<5} {who:<9}{words}")


def check_points(flown: Path, camera: object) -> np.ndarray:
    """Adjust a corridor with a camera; returns surveyed minus adjusted check points (n, 3), m."""
    from insgnss.flight.config.block_file import load_block
    from insgnss.io.formats.blocks.camera_toml import write_camera_toml
    from insgnss.photogrammetry.block_adjustment.run import adjust

    block = load_block(flown)
    write_camera_toml(camera, block.camera.file)
    done = adjust(block, write=False)
    return np.array([c["difference_m"] for c in done.figures["check_points"] if "sigma_m" in c])


def fly(directory: Path, options: argparse.Namespace, seed: int) -> None:
    """Simulate and process one flight."""
    from insgnss.flight.config.load import load_flight
    from insgnss.flight.processing.pipeline import process
    from insgnss.simulation.dataset import write_dataset
    from insgnss.simulation.image_block import IGN8, LEADING, BlockOptions
    from insgnss.simulation.raw_gnss.receiver import GnssOptions

    block = BlockOptions.of(options.flight)
    if options.lead:
        moved = IGN8.interior + np.array([2.0, 1.0, -1.0] + [0.0] * 8)
        block = replace(block, stated_camera=replace(IGN8, interior=moved, free=LEADING))
    gnss = GnssOptions(
        correlated_sigma_m=tuple(options.correlated * s for s in GnssOptions.sigma_m),
        correlation_time_s=300.0,
        claim_correlated=False,
    )
    tables = {}
    if options.correlated > 0.0:
        tables = {"gnss": {"gm_sigma": options.correlated, "correlation_time_s": 300.0}}
    write_dataset(
        directory,
        options.flight,
        options.minutes,
        imu_rate=options.imu_rate,
        seed=seed,
        block=block,
        gnss=gnss,
        flight_file=tables,
    )
    process(load_flight(directory))


def adjusted(flown: Path, kind: str) -> dict:
    """Adjust the block of a flight and compare with the truth."""
    from insgnss.flight.config.block_file import load_block
    from insgnss.geodesy.rotation import vector_from_rotation
    from insgnss.io.formats.blocks.camera_toml import read_camera_toml
    from insgnss.photogrammetry.block_adjustment.run import adjust
    from insgnss.records.block import INTERIOR

    block = load_block(flown)
    block = replace(block, aerial_control=replace(block.aerial_control, covariance=kind))
    done = adjust(block, write=False)
    solved, precision = done.solved, done.solved.precision
    values, images = solved.result.values, solved.result.problem.block.images
    with np.load(flown / "truth/eo.npz") as file:
        row = {str(name): k for k, name in enumerate(file["images"])}
        rows = [row[name] for name in images]
        X, C = file["position_enu"][rows], file["C_mc"][rows]
    psi = vector_from_rotation(C @ values.C_mc.swapaxes(1, 2))
    e = np.hstack([X - values.position, psi])
    P = precision.pose_cov
    poses = np.einsum("ni,nij,nj->n", e, np.linalg.inv(P), e)
    true = read_camera_toml(flown / "truth/camera.toml").interior
    columns = solved.result.problem.layout.columns
    off = (true - values.interior[0])[columns]
    cov = precision.cov(("camera", 0))
    E = vector_from_rotation(values.blocks[("bore-sight", 0)])
    cov_E = precision.cov(("bore-sight", 0))
    checks = [c for c in done.figures["check_points"] if "difference_m" in c]
    with np.load(flown / "truth/block.npz") as file:
        point = {str(name): k for k, name in enumerate(file["points"])}
        at = np.array([file["position_enu"][point[c["point"]]] for c in checks])
    d = at - np.array([c["position_m"] for c in checks])
    formal = np.array([c["sigma_adjusted_m"] for c in checks])
    middle = len(images) // 2
    return {
        "poses": poses.mean() / 6.0,
        "one": poses[middle],
        "camera": off @ np.linalg.solve(cov, off),
        "n_camera": columns.size,
        "boresight": E @ np.linalg.solve(cov_E, E),
        "f": values.interior[0, INTERIOR.index("f")] - true[INTERIOR.index("f")],
        "sigma_f": precision.sigma_interior(0)[INTERIOR.index("f")],
        "check": np.sqrt((d**2).mean(axis=0)),
        "formal": np.sqrt((formal**2).mean(axis=0)),
        "components": {c.name: c.variance for c in solved.components},
        "factors": solved.factors,
        "iterations": solved.iterations,
        "verdict": done.figures["verdict"],
    }


def table(rows: list[dict]) -> None:
    """Print what all blocks say together."""
    n = len(rows)

    def line(name: str, squares: list[float], degrees: int) -> None:
        low, high = chi2.ppf((0.005, 0.995), degrees * n) / (degrees * n)
        mean = float(np.sum(squares)) / (degrees * n)
        print(f"{name:<34}{mean:8.3f}   99 % of chance: {low:.3f} to {high:.3f}")

    line("pose in the middle, normalised", [r["one"] for r in rows], 6)
    line("camera", [r["camera"] for r in rows], rows[0]["n_camera"])
    line("bore-sight", [r["boresight"] for r in rows], 3)
    print(f"{'all poses, mean':<34}{np.mean([r['poses'] for r in rows]):8.3f}")
    for name in rows[0]["components"]:
        v = [r["components"][name] for r in rows]
        print(f"{'component: ' + name:<34}{np.mean(v):8.3f}   {min(v):.2f} to {max(v):.2f}")
    for name in rows[0]["factors"]:
        v = [r["factors"][name] for r in rows]
        print(f"{'factor: ' + name:<34}{np.mean(v):8.3f}   {min(v):.2f} to {max(v):.2f}")
    print(f"{'steps of the iteration, at most':<34}{max(r['iterations'] for r in rows):8d}")
    f = np.array([r["f"] for r in rows])
    sigma = np.sqrt(np.mean([r["sigma_f"] ** 2 for r in rows]))
    print(f"{'f, px: rms of errors, formal':<34}{np.sqrt(np.mean(f**2)):8.3f} {sigma:8.3f}")
    check = 1e3 * np.sqrt(np.mean([r["check"] ** 2 for r in rows], axis=0))
    formal = 1e3 * np.sqrt(np.mean([r["formal"] ** 2 for r in rows], axis=0))
    print(f"{'check points E N U, mm: rms':<34}{' / '.join(f'{x:.1f}' for x in check)}")
    print(f"{'                        formal':<34}{' / '.join(f'{x:.1f}' for x in formal)}")
    wrong = sum(r["verdict"] != "consistent" for r in rows)
    print(f"{'called contradictory':<34}{wrong:8d}")


if __name__ == "__main__":
    main()
