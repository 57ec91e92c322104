"""Story 4: which noise model to take, and what a wrong one would make a filter believe.

    python scripts/04_compare_noise_models.py
        six simulated recordings of two hours of one gyroscope, 100 Hz
    python scripts/04_compare_noise_models.py --quick
        six of half an hour at 20 Hz
    python scripts/04_compare_noise_models.py --static my1.csv my2.csv --axis gz

The simulated gyroscope has white noise and two Gauss-Markov processes, of 2.5 s and 72 s. A family
of models is fitted to all recordings but the last and ranked by the wavelet information criterion.
Then each model says how far a rate, averaged for some time, differs from that of the time before,
and the last recording, which no model has seen, says how far it does: a filter with a model that is
too small there believes its attitude too much. It ends in a figure and an assertion: the model
simulated is the one chosen, its prediction for the unseen recording holds to a fifth, and that of
white noise alone falls short by half and more.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import insgnss
from insgnss.noise.estimation.selection import Ranking, rank

DEG_H = np.pi / 180.0 / 3600.0
WANDERING = tuple(
    insgnss.GaussMarkov.from_sigma(*of) for of in ((2.5, 20.0 * DEG_H), (72.0, 22.0 * DEG_H))
)
TRUTH = insgnss.AxisNoise(10.8 * DEG_H, gauss_markov=WANDERING)
MODELS = ("WN", "WN+RW", "WN+GM", "WN+GM+RW", "WN+2GM", "WN+2GM+RW", "WN+3GM")
CLEAR = 30  # independent differences of means: fewer do not tell a deviation to a seventh


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. Wavelet variances of recordings at rest; the last is kept back.
    curves = (
        [curve_of(path, options.axis) for path in options.static]
        if options.static
        else simulated(options.quick)
    )
    *seen, unseen = curves

    # 2. All models, fitted and ranked.
    ranking = rank(seen, MODELS)
    print(ranking.table())

    # 3. What each predicts for the recording that it has not seen, over what happened.
    ratio = {str(c.composition): predicted(c.fit.axis, unseen) for c in ranking.candidates}

    # 4. A figure.
    draw(seen, ranking, unseen, ratio, options.out / "compare_models.png")
    print(f"wrote {options.out / 'compare_models.png'}")

    # 5. The assertion.
    chosen = str(ranking.chosen.composition)
    clear = unseen.count / 2.0**unseen.level > CLEAR
    off = {name: float(np.abs(r[clear] - 1.0).max()) for name, r in ratio.items()}
    print(
        "largest error of the predicted deviation: "
        + ", ".join(f"{name} {x:.0%}" for name, x in off.items())
    )
    assert off[chosen] <= min(off.values()) + 0.2, f"{chosen} was chosen, and others predict better"
    if not options.static:
        assert chosen == "WN+2GM", f"{chosen} was chosen in the place of WN+2GM"
        assert off[chosen] < 0.2, f"the prediction of {chosen} is off by {off[chosen]:.0%}"
        assert off["WN"] > 0.5, f"white noise alone is off by {off['WN']:.0%} only"


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Compare noise models.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_4"),
        help="directory of all results (default: story_4)",
    )
    parser.add_argument(
        "--static",
        type=Path,
        nargs="+",
        help="recordings at rest, two and more; without them some are simulated",
    )
    parser.add_argument(
        "--axis",
        choices=("gx", "gy", "gz"),
        default="gz",
        help="gyroscope of these recordings (default: gz)",
    )
    parser.add_argument("--quick", action="store_true", help="simulate small recordings")
    return parser.parse_args()


def curve_of(path: Path, axis: str) -> insgnss.WaveletVariance:
    """Wavelet variance of one gyroscope of a recording."""
    imu = insgnss.read_imu(path)
    return insgnss.wavelet_variance(
        imu.gyro[:, "xyz".index(axis[1])], (imu.time.size - 1) / (imu.time[-1] - imu.time[0])
    )


def simulated(quick: bool) -> list[insgnss.WaveletVariance]:
    """Wavelet variances of six recordings."""
    rate, minutes = (20.0, 30.0) if quick else (100.0, 120.0)
    rng = np.random.default_rng(4)
    return [
        insgnss.wavelet_variance(
            insgnss.simulate_noise(TRUTH, int(60 * minutes * rate), 1.0 / rate, rng), rate
        )
        for _ in range(6)
    ]


def predicted(axis: insgnss.AxisNoise, curve: insgnss.WaveletVariance) -> np.ndarray:
    """(J,) deviation that a model predicts over that of a recording."""
    return np.sqrt(insgnss.haar_variance(axis, curve.level, curve.rate_hz) / curve.variance)


def draw(
    seen: list[insgnss.WaveletVariance],
    ranking: Ranking,
    unseen: insgnss.WaveletVariance,
    ratio: dict[str, np.ndarray],
    path: Path,
) -> None:
    """Left the recordings and the models, right what the models predict for the recording that was
    kept back, over what happened.
    """
    figure = Figure(figsize=(13, 5.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    for curve in seen:
        left.plot(
            curve.averaging_time_s, np.sqrt(2.0 * curve.variance) / DEG_H, ".", color="0.6", ms=4
        )
    tau = unseen.averaging_time_s
    left.plot(
        tau, np.sqrt(2.0 * unseen.variance) / DEG_H, "o", color="black", ms=4, label="kept back"
    )
    shown = np.sqrt(unseen.variance)
    right.fill_between(
        tau,
        shown / np.sqrt(unseen.high),
        shown / np.sqrt(unseen.low),
        color="0.85",
        label="95 % interval of what happened",
    )
    for c in ranking.candidates:
        name = str(c.composition)
        width, label = (
            (2.5, f"{name}, chosen")
            if c is ranking.chosen
            else (1.0, f"{name}, WIC {c.difference:+.3g}")
        )
        modelled = insgnss.haar_variance(c.fit.axis, unseen.level, unseen.rate_hz)
        left.plot(tau, np.sqrt(2.0 * modelled) / DEG_H, lw=width, label=label)
        right.plot(tau, ratio[name], lw=width, label=name)
    left.set(
        xscale="log",
        yscale="log",
        xlabel="averaging time, s",
        ylabel="Allan deviation, deg/h",
        title="recordings and models",
    )
    right.set(
        xscale="log",
        ylim=(0, 2),
        xlabel="averaging time, s",
        title="deviation predicted for the unseen recording, over its own",
    )
    for axes in (left, right):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
