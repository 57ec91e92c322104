"""Story 7: bore-sight unknown: relative control (paper 003, Rehak and Skaloud 2016).

    python scripts/07_boresight_unknown.py
        block 2015 of the paper, simulated, half a minute of work
    python scripts/07_boresight_unknown.py --quick
        its corridor 2014

A camera is put beside the IMU, and nobody calibrates the bore-sight. The poses of the flight turn
with the IMU, the images with the camera. The story has the block three times: with the bore-sight
known, with 0.1 deg of it left (the paper's Figure 3), and with 1.5 deg that nobody told. Fast AT
orients it by image measurements of the surveyed points alone, with absolute attitudes, with
attitudes relative to the neighbour in the line, and with relative positions too. Two neighbours
have the same bore-sight, and in the axes of the block it cancels (equation 4 of the paper).

Weights are of two kinds. The paper takes each image, or each pair (equation 5), by itself. The
other kind is the covariance of all poses together: it knows that attitude errors last, takes a
bore-sight for one of them, and is hurt by it as little as relative control is.

It ends in a table beside the paper's, a picture (what is left of absolute and of relative attitudes
after an integrated adjustment, the paper's Figures 3 and 4), and an assertion: a bore-sight that is
unknown moves check points by more than five standard deviations where absolute attitudes are
weighed each by itself, and by less than a tenth of its standard deviation where they are relative;
by less than a half where positions are relative too, since the weak observation that gives a line
its datum then (2 deg, datum_sigma_deg) is one of the absolute attitude, at which 1.5 deg pull.
"""

import argparse
import csv
import tempfile
from pathlib import Path

import aerial_control_cases as cases
import numpy as np
from matplotlib.figure import Figure

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.simulation.plug import import_plugged

simulate_survey = import_plugged("published_blocks.survey").simulate_survey

BORESIGHTS_DEG = (0.0, 0.1, 1.5)
WAYS = tuple(mode for mode in cases.MODES if mode.startswith("F. AT"))
WEIGHTS = {"by itself": "independent", "together": "smoothed"}
ABSOLUTE = "F. AT Ap Aa"
COLOURS = ("#0072B2", "#E69F00", "#009E73")


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)
    name = "corridor2014" if options.quick else "block2015"

    # 1. The block with each bore-sight, oriented in each way.
    found = {}
    with tempfile.TemporaryDirectory() as directory:
        for turn in BORESIGHTS_DEG:
            made = simulate_survey(name, options.seed, boresight_deg=turn)
            file = cases.written(Path(directory) / f"{turn:g}", made)
            for way in WAYS:
                for weights in WEIGHTS:
                    block = cases.in_mode(file, way, WEIGHTS[weights])
                    found[turn, way, weights] = cases.outcome(block, made, poses=False)
            if turn == BORESIGHTS_DEG[-1]:
                told = what_is_said(cases.in_mode(file, ABSOLUTE, "independent"))
        # 2. What is left of the attitudes after an integrated adjustment, 0.1 deg of bore-sight.
        file = Path(directory) / f"{BORESIGHTS_DEG[1]:g}" / "block.toml"
        left = {way: residuals(file, way) for way in ("ISO Ap Aa", "ISO Ap Ra")}
        lines = [len(strip.rows) for strip in made.strips]

    # 3. The table, the picture.
    report(found, name, options.out / "boresight_unknown.csv")
    print(f"insgnss adjust of {ABSOLUTE} with {BORESIGHTS_DEG[-1]:g} deg: {told}")
    draw(left, lines, options.out / "boresight_unknown.png")
    print(f"wrote {options.out / 'boresight_unknown.png'}")

    # 4. The assertion.
    for turn in BORESIGHTS_DEG[1:]:
        for way in WAYS[1:]:
            moved = movement(found, way, turn)
            print(f"{way}, {turn:g} deg: check points move by {moved:.4f} sigma at most")
            limit = 0.5 if way.endswith("Rp Ra") else 0.1
            assert moved < limit, f"a bore-sight of {turn:g} deg is not out of {way}"
    moved = movement(found, ABSOLUTE, BORESIGHTS_DEG[-1])
    print(f"{ABSOLUTE}, {BORESIGHTS_DEG[-1]:g} deg: check points move by {moved:.0f} sigma at most")
    assert moved > 5.0, "a bore-sight that nobody told does not hurt absolute attitudes"
    assert rms_of(left["ISO Ap Aa"]["attitude"]) > rms_of(left["ISO Ap Ra"]["turn"]), (
        "relative attitudes leave more than absolute ones"
    )


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="A bore-sight that nobody calibrated.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_7"),
        help="directory of all results (default: story_7)",
    )
    parser.add_argument("--quick", action="store_true", help="the corridor")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def what_is_said(block: object) -> str:
    """What the program says of absolute attitudes with a bore-sight that is held at nothing."""
    try:
        result = insgnss.adjust_block(block, write=False)
    except insgnss.InsgnssError as error:
        return f"refused: {error}"
    return str(result.refusal or result.judgement.headline)


def residuals(file: Path, way: str) -> dict[str, np.ndarray]:
    """Adjusted against observed attitudes, deg: of each image (n, 3), and turns from image to image
    (n - 1, 3), along the axes of the camera.
    """
    done = cases.solution(cases.in_mode(file, way, "independent"))
    values = done.result.values
    observed = insgnss.read_eo(file.parent / "eo.json").C_mc
    turn = values.C_mc[1:] @ values.C_mc[:-1].transpose(0, 2, 1)
    observed_turn = observed[1:] @ observed[:-1].transpose(0, 2, 1)
    to_camera = observed.transpose(0, 2, 1)
    own = vector_from_rotation(values.C_mc @ to_camera)
    change = vector_from_rotation(turn @ observed_turn.transpose(0, 2, 1))
    return {"attitude": np.degrees(own), "turn": np.degrees(change)}


def movement(found: dict, way: str, turn: float) -> float:
    """How far a bore-sight moves a check point at most, in its standard deviations."""
    one, other = found[0.0, way, "by itself"], found[turn, way, "by itself"]
    return float((np.abs(other.difference_m - one.difference_m) / one.sigma_m).max())


def rms_of(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def report(found: dict, name: str, path: Path) -> None:
    """Print the table beside the paper's and write it."""
    print(f"{name}: check points E N U, mm, root mean square (promised)")
    print(f"{'':12} {'bore-sight':>10}  " + "".join(f"{w:>36}" for w in WEIGHTS) + "     paper 003")
    rows = []
    for (turn, way, weights), outcome in found.items():
        each = 1e3 * np.sqrt((outcome.difference_m**2).mean(axis=0))
        promised = 1e3 * np.sqrt((outcome.sigma_m**2).mean(axis=0))
        rows.append([turn, way, weights, *each.round(1), *promised.round(1)])
    for turn in BORESIGHTS_DEG:
        for way in WAYS:
            texts = []
            for weights in WEIGHTS:
                row = next(r for r in rows if r[:3] == [turn, way, weights])
                e, n, u, *promised = row[3:]
                words = " ".join(f"{x:.0f}" for x in promised)
                texts.append(f"{e:6.0f}{n:6.0f}{u:6.0f} ({words})")
            paper = " ".join(f"{x:.0f}" for x in cases.PUBLISHED[name][way][3:])
            said = paper if turn == BORESIGHTS_DEG[1] else ""  # what the paper's block was
            print(
                f"{way:12} {turn:6.1f} deg  " + "".join(f"{t:>36}" for t in texts) + f"     {said}"
            )
    with path.open("w", newline="", encoding="utf-8") as stream:
        head = [f"{kind}_{axis}_mm" for kind in ("rms", "promised") for axis in "enu"]
        csv.writer(stream).writerows([["boresight_deg", "mode", "weights", *head], *rows])


def draw(left: dict, lines: list[int], path: Path) -> None:
    """The paper's Figures 3 and 4: residuals of absolute and of relative attitudes."""
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    edges = np.cumsum(lines)[:-1] - 0.5
    panels = (
        (
            "ISO Ap Aa",
            "attitude",
            "Absolute attitudes, each by itself: 0.1 deg of bore-sight stays",
        ),
        ("ISO Ap Ra", "turn", "Relative attitudes: adjusted minus observed turn to the next image"),
    )
    for ax, (way, key, title) in zip(axes, panels, strict=True):
        values = left[way][key]
        if key == "turn":  # from line to line nothing is observed
            values = values.copy()
            values[np.cumsum(lines)[:-1] - 1] = np.nan
        for k, axis in enumerate(("east", "north", "up")):
            of = values[:, k]
            label = f"{axis}, rms {np.sqrt(np.nanmean(of**2)):.3f} deg"
            ax.plot(np.arange(len(of)), of, ".-", color=COLOURS[k], lw=0.7, ms=3, label=label)
        for edge in edges:
            ax.axvline(edge, color="#cccccc", lw=0.8, zorder=0)
        ax.axhline(0.0, color="#888888", lw=0.8, zorder=0)
        ax.set_title(title, loc="left", fontsize=10)
        ax.set_ylabel("residual, deg")
        ax.legend(loc="upper right", fontsize=8, ncols=3, framealpha=0.9)
    axes[1].set_xlabel("image; grey: from one flight line to the next")
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
