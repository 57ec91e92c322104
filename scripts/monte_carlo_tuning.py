"""Monte Carlo of stochastic tuning: do the intervals of the noise parameters hold the truth?

Static recordings of the NavChip of Table 5 of paper 000 (gyroscope WN+3GM, accelerometer WN+2GM)
are simulated sample by sample, six a replicate; each replicate is fitted with efficient weights
from its first recording alone, and from all six together. For every parameter: how often its 95 %
interval holds the truth, the bias in standard errors, what standard error theory says (exact
covariance at the truth), and how often the verdict declares it determined.

A correlation time counts as identifiable where theory's 99 % limit stays below a third of the
recording, a density where its relative standard error is below a half. Of the identifiable ones the
script asserts coverage (90 to 99 % of 100 replicates, binomial bounds of as much for other numbers)
and a median bias below a third of the standard error; that the process of 4737 s is declared not
identifiable from single recordings; and that six recordings shrink the spread as theory says.

    python scripts/monte_carlo_tuning.py --write
        100 replicates of 4 hours at 250 Hz: 1200 recordings, about half an hour
    python scripts/monte_carlo_tuning.py --replicates 10 --rate 10
"""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import binom

from insgnss.navigation.noise_model.model import AxisNoise, load_noise_model
from insgnss.noise.estimation.estimates import Linearised
from insgnss.noise.estimation.gmwm import NoiseFit, fit
from insgnss.noise.estimation.inference import (
    Inference,
    covariances,
    infer,
    inverse,
    second_step,
)
from insgnss.noise.moments.wavelet import in_threads, wavelet_variance
from insgnss.noise.processes.composition import composition_of
from insgnss.noise.processes.realisation import simulate_noise
from insgnss.records import WaveletVariance

PAGE = Path(__file__).parents[1] / "benchmarks" / "tuning.md"
RECORDINGS = 6


@dataclass(frozen=True)
class Sensor:
    """One sensor's simulated axis and the recordings that are made of it."""

    name: str
    axis: AxisNoise
    samples: int
    rate_hz: float

    def recording(self, seed: tuple[int, ...]) -> WaveletVariance:
        x = simulate_noise(self.axis, self.samples, 1.0 / self.rate_hz, np.random.default_rng(seed))
        return wavelet_variance(x, self.rate_hz)

    def truth(self, curves: list[WaveletVariance]) -> NoiseFit:
        """The true parameters as a fit with efficient weights, for what theory says of them."""
        composition = composition_of(self.axis)
        J = [np.eye(c.level.size) for c in curves]
        fit_ = NoiseFit(
            composition,
            self.axis,
            composition.values(self.axis),
            tuple(curves),
            tuple(J),
            0.0,
            "mean",
            (),
        )
        return replace(fit_, weights=tuple(inverse(V) for V in covariances(fit_)))


@dataclass(frozen=True)
class Study:
    """Replicates of one sensor fitted from so many recordings each. Arrays (replicates, parameters)
    unless said.
    """

    sensor: Sensor
    recordings: int
    names: tuple[str, ...]
    truth: np.ndarray  # (parameters,)
    theory: np.ndarray  # (parameters,) standard error of the logarithm
    identifiable: np.ndarray  # (parameters,) bool
    value: np.ndarray
    error: np.ndarray
    low: np.ndarray
    high: np.ndarray
    determined: np.ndarray
    p_value: np.ndarray  # (replicates,)
    reasons: list[tuple[str, ...]]  # a replicate: of each process

    @property
    def inside(self) -> np.ndarray:
        return (self.low <= self.truth) & (self.truth <= self.high)

    @property
    def bias(self) -> np.ndarray:
        """(parameters,) median of the logarithmic error in median standard errors."""
        return np.median(np.log(self.value / self.truth), axis=0) / np.nanmedian(self.error, axis=0)

    @property
    def mean_bias(self) -> np.ndarray:
        """(parameters,) mean error in standard deviations of the estimates."""
        return (self.value.mean(axis=0) - self.truth) / self.value.std(axis=0)

    @property
    def spread(self) -> np.ndarray:
        """(parameters,) standard deviation of the logarithm, from the middle half, which estimates
        at an edge do not move.
        """
        quartiles = np.quantile(np.log(self.value), [0.25, 0.75], axis=0)
        return (quartiles[1] - quartiles[0]) / 1.349


def study(
    sensor: Sensor,
    replicates: list[list[WaveletVariance]],
    recordings: int,
    weights: str = "efficient",
) -> Study:
    truth = sensor.truth(replicates[0][:recordings])
    linear = Linearised(truth, covariances(truth))
    names = truth.composition.parameters
    theory = np.sqrt(np.diag(linear.covariance())) * linear.local.logarithmic(linear.x)
    time_like = np.array([name.startswith("correlation_time") for name in names])
    limit = np.where(time_like, sensor.samples / sensor.rate_hz / 3.0, np.inf)
    identifiable = (truth.parameters * np.exp(2.576 * theory) < limit) & (
        time_like | (theory < 0.5)
    )
    found = [judged(curves[:recordings], truth, weights) for curves in replicates]
    table = {
        key: np.array([[getattr(e, key) for e in one.estimates] for one in found])
        for key in ("value", "log_error", "low", "high")
    }
    determined = np.array(
        [[any(name in v.parameters for v in one.verdicts) for name in names] for one in found]
    )
    p_value = np.array([one.goodness.p_value for one in found])
    reasons = [tuple(v.reason for v in one.verdicts) for one in found]
    return Study(
        sensor, recordings, names, truth.parameters, theory, identifiable,
        table["value"], table["log_error"], table["low"], table["high"],
        determined, p_value, reasons,
    )  # fmt: skip


def judged(curves: list[WaveletVariance], truth: NoiseFit, weights: str) -> Inference:
    first = fit(curves, truth.composition, sampling="mean")
    return infer(second_step(first)[0] if weights == "efficient" else first)


def rows(s: Study) -> list[str]:
    out = []
    for i, name in enumerate(s.names):
        truth = f"{s.truth[i]:.4g}" + (" s" if name.startswith("correlation_time") else "")
        out.append(
            f"| {name.replace('_', ' ')} | {truth} | {'yes' if s.identifiable[i] else 'no'} |"
            f" {100 * s.theory[i]:.2g} | {100 * s.spread[i]:.2g} |"
            f" {100 * s.inside[:, i].mean():.0f} | {s.bias[i]:+.2f} | {s.mean_bias[i]:+.2f} |"
            f" {100 * s.determined[:, i].mean():.0f} |"
        )
    return out


HEAD = [
    (
        "| parameter | truth (SI) | identifiable | theory, % | spread, % | inside, % | median bias"
        " | mean bias | declared, % |"
    ),
    "|---|---|---|---|---|---|---|---|---|",
]


def page(studies: list[Study], diagonal: list[Study], replicates: int, command: str) -> str:
    s = studies[0].sensor
    hours = s.samples / s.rate_hz / 3600.0
    lines = [
        "# Stochastic tuning: Monte Carlo",
        "",
        f"Written by `{command}`, which says how it is done.",
        (
            f"{replicates} replicates of simulated static recordings of {hours:.3g} hours at"
            f" {s.rate_hz:g} Hz, the NavChip of Table 5 of"
        ),
        (
            "paper 000; efficient weights, intervals of the profile. Theory and spread: relative"
            " standard error by the exact covariance,"
        ),
        (
            "and seen. Inside: 95 % intervals that hold the truth. Median bias: of the logarithm,"
            " in reported standard errors; mean"
        ),
        (
            "bias: of the value, in standard deviations of the estimates. Declared: by the verdict,"
            " as determined."
        ),
        "",
        "![coverage and spread](tuning.png)",
    ]
    for one in studies:
        many = "one recording" if one.recordings == 1 else f"{one.recordings} recordings together"
        lines += ["", f"## {one.sensor.name}, {many}", "", *HEAD, *rows(one), ""]
        rejected = 100.0 * (one.p_value < 0.05).mean()
        lines.append(f"J test below 0.05 in {rejected:.0f} % of replicates. {slowest(one)}")
    lines += ["", "## Six recordings against one", "", *tightening(studies)]
    lines += ["", "## Interval weights instead", "", *without_second_step(diagonal), ""]
    return "\n".join(lines)


def slowest(s: Study) -> str:
    """What the verdicts say of the slowest process."""
    reasons = [one[-1] for one in s.reasons]
    told = {
        "": "identifiable",
        "long": "time too long",
        "superfluous": "superfluous",
        "strength": "too weak",
        "short": "too short",
    }
    count = [f"{told[r]} {reasons.count(r)}" for r in told if reasons.count(r)]
    return (
        f"Verdicts on the slowest process ({s.truth[-2]:.4g} s), of {len(reasons)}:"
        f" {', '.join(count)}."
    )


def tightening(studies: list[Study]) -> list[str]:
    out = [
        (
            "Spread of one recording over that of six, and by theory sqrt 6 = 2.45 for recordings"
            " of the same length:"
        ),
        "",
    ]
    for one, six in zip(studies[::2], studies[1::2], strict=True):
        ratio = one.spread / six.spread
        parts = [
            f"{name.replace('_', ' ')} {r:.2f}" for name, r in zip(one.names, ratio, strict=True)
        ]
        out.append(f"- {one.sensor.name}: {', '.join(parts)}")
    return out


def without_second_step(diagonal: list[Study]) -> list[str]:
    out = [
        (
            "The first step alone, weights of the widths of the intervals and intervals of the"
            " sandwich, one recording. Weights from"
        ),
        (
            "the wavelet variances themselves favour scales that came out small. Truth inside the"
            " interval, %, and mean bias in"
        ),
        "standard deviations:",
        "",
    ]
    for s in diagonal:
        share, bias = 100.0 * s.inside.mean(axis=0), s.mean_bias
        parts = [
            f"{name.replace('_', ' ')} {a:.0f} ({b:+.2f})"
            for name, a, b in zip(s.names, share, bias, strict=True)
        ]
        out.append(f"- {s.sensor.name}: {', '.join(parts)}")
    return out


def draw(studies: list[Study], path: Path) -> None:
    """Estimates over truth with their theoretical 95 % range, and coverage with its binomial
    bounds.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        2, len(studies), figsize=(4.0 * len(studies), 7.0), layout="constrained", sharey="row"
    )
    for (top, bottom), s in zip(axes.T, studies, strict=True):
        at = np.arange(len(s.names))
        top.boxplot(
            np.clip(s.value / s.truth, 1e-2, 1e2),
            positions=at,
            whis=(2.5, 97.5),
            sym="",
            widths=0.5,
        )
        reach = np.exp(1.96 * np.minimum(s.theory, 5.0))
        top.vlines(
            at + 0.35, 1.0 / reach, reach, color="tab:orange", linewidth=3, label="95 % by theory"
        )
        top.set(
            yscale="log",
            ylim=(0.01, 100.0),
            title=f"{s.sensor.name}, {s.recordings} recording{'s' * (s.recordings > 1)}",
            xticks=at,
        )
        top.set_xticklabels([])
        top.axhline(1.0, color="0.6", linewidth=0.8)
        bottom.bar(
            at,
            100.0 * s.inside.mean(axis=0),
            color=["tab:blue" if ok else "0.7" for ok in s.identifiable],
        )
        low, high = 100.0 * binom.ppf([0.01, 0.99], len(s.value), 0.95) / len(s.value)
        bottom.axhspan(low, high, color="tab:green", alpha=0.2, label="98 % of 95 % intervals")
        bottom.set(ylim=(80.0, 100.5), xticks=at)
        bottom.set_xticklabels(
            [name.replace("_", " ") for name in s.names], rotation=60, ha="right"
        )
    axes[0, 0].set_ylabel("estimate over truth")
    axes[1, 0].set_ylabel("truth inside, % (grey: not identifiable)")
    axes[0, 0].legend(loc="lower left")
    axes[1, 0].legend(loc="lower left")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def check(studies: list[Study]) -> None:
    """The bars, for what theory calls identifiable."""
    for s in studies:
        n, where = len(s.value), f"{s.sensor.name}, {s.recordings} recordings"
        least, most = binom.ppf([0.005, 0.998], n, 0.95) / n
        share = s.inside.mean(axis=0)
        for i, name in enumerate(s.names):
            if s.identifiable[i]:
                assert min(least, 0.9) <= share[i] <= max(most, 0.99), (
                    f"{where}: {name} inside its interval in {100 * share[i]:.0f} %"
                )
                assert abs(s.bias[i]) < 1.0 / 3.0 + (2.0 / np.sqrt(n) if n < 100 else 0.0), (
                    f"{where}: bias of {name} {s.bias[i]:+.2f}"
                )
        if s.recordings == 1 and s.truth[-2] > 4000.0:
            named = np.mean([one[-1] != "" for one in s.reasons])
            assert named >= 0.9, (
                f"{where}: the process of {s.truth[-2]:.0f} s declared identifiable in"
                f" {100 * (1 - named):.0f} %"
            )
    for one, six in zip(studies[::2], studies[1::2], strict=True):
        clear = one.theory < 0.1  # where the logarithm is linear
        ratio, noise = (
            (one.spread / six.spread)[clear],
            1.65 / np.sqrt(len(one.value)),
        )  # quartiles of n estimates scatter so
        expected = (one.theory / six.theory)[clear]
        assert (np.abs(np.log(ratio / expected)) < 3.0 * noise).all(), (
            f"{one.sensor.name}: six recordings tighten by {ratio.round(2)}"
        )


def main() -> None:
    """Simulate, fit, tell, draw, and hold the figures against their bars."""
    parser = argparse.ArgumentParser(
        description="Coverage of the intervals of noise parameters over many simulated recordings"
    )
    parser.add_argument("--replicates", type=int, default=100)
    parser.add_argument("--hours", type=float, default=4.0, help="of each recording")
    parser.add_argument("--rate", type=float, default=250.0, help="samples a second")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--write", action="store_true", help=f"write {PAGE.name} and its figure into benchmarks/"
    )
    options = parser.parse_args()
    model = load_noise_model("navchip")
    samples = round(options.hours * 3600.0 * options.rate)
    studies, diagonal = [], []
    for number, (name, axis) in enumerate(
        (("gyroscope", model.gyro[0]), ("accelerometer", model.accel[0]))
    ):
        sensor = Sensor(name, replace(axis, turn_on_bias=0.0), samples, options.rate)
        replicates, start = [], time.monotonic()
        for k in range(options.replicates):
            seeds = [(options.seed, number, k, r) for r in range(RECORDINGS)]
            replicates.append(
                list(
                    in_threads(
                        lambda r, seeds=seeds, sensor=sensor: sensor.recording(seeds[r]), RECORDINGS
                    )
                )
            )
            if (k + 1) % 10 == 0:
                print(
                    f"{name}: {k + 1} of {options.replicates} replicates simulated,"
                    f" {time.monotonic() - start:.0f} s",
                    flush=True,
                )
        for recordings in (1, RECORDINGS):
            studies.append(study(sensor, replicates, recordings))
            print(
                "\n".join(
                    [f"{name}, {recordings}:", *HEAD, *rows(studies[-1]), slowest(studies[-1])]
                ),
                flush=True,
            )
        diagonal.append(study(sensor, replicates, 1, "interval"))
    print("\n".join([*tightening(studies), "", *without_second_step(diagonal)]))
    if options.write:
        PAGE.write_text(
            page(
                studies,
                diagonal,
                options.replicates,
                "python scripts/monte_carlo_tuning.py --write",
            ),
            encoding="utf-8",
            newline="\n",
        )
        draw(studies, PAGE.with_suffix(".png"))
        print(f"wrote {PAGE} and {PAGE.with_suffix('.png').name}")
    check(studies)


if __name__ == "__main__":
    main()
