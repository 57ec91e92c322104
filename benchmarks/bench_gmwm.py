"""Fits of noise processes to wavelet variances: milliseconds and objective, against a plain
minimiser.

    python benchmarks/bench_gmwm.py

Curves are those of Table 5 (4 h at 250 Hz, 20 scales) with the scatter of a recording. The plain
twin is the method of the reference implementation in numpy and scipy: textbook AR(1) formula,
logarithms of the variances and logit of phi, Nelder-Mead, from one start with the times spread over
the scales and from the best of ten random ones. Its solutions are valued by `gmwm.objective`: its
own formula cancels for long correlation times (1e-7 of the objective here).
"""

import math

from common import median_cpu, one_thread

one_thread()

import numpy as np  # noqa: E402
from scipy.optimize import minimize  # noqa: E402
from scipy.special import chdtri  # noqa: E402

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, load_noise_model  # noqa: E402
from insgnss.noise.estimation.gmwm import fit, interval_weights, objective  # noqa: E402
from insgnss.noise.moments.theory import haar_variance  # noqa: E402
from insgnss.records import Array, WaveletVariance  # noqa: E402

RATE_HZ, SAMPLES = 250.0, 3_600_000


def recording(seed: int) -> WaveletVariance:
    """Wavelet variances of a gyroscope of Table 5, scales scattered independently."""
    level = np.arange(1, SAMPLES.bit_length() - 1)
    count = SAMPLES - 2**level + 1
    eta = np.maximum(count / 2.0**level, 1.0)
    scatter = np.random.default_rng(seed).chisquare(eta) / eta
    nu = haar_variance(load_noise_model("navchip").gyro[0], level, RATE_HZ) * scatter
    return WaveletVariance(
        level,
        nu,
        eta * nu / chdtri(eta, 0.025),
        eta * nu / chdtri(eta, 0.975),
        count,
        RATE_HZ,
        SAMPLES,
    )


class Plain:
    """The twin: theta = log of the white noise's variance, then logit of phi and log of the
    innovations' variance of each AR(1).
    """

    def __init__(self, curves: list[WaveletVariance], processes: int) -> None:
        self.curves, self.processes = curves, processes
        self.h = 2.0 ** (curves[0].level - 1)

    def objective(self, theta: Array) -> float:
        h = self.h
        nu = math.exp(theta[0]) / (2.0 * h)
        for logit, innovation in theta[1:].reshape(-1, 2):
            phi = 1.0 / (1.0 + math.exp(-logit))
            above = h - 3.0 * phi - h * phi**2 + 4.0 * phi ** (h + 1.0) - phi ** (2.0 * h + 1.0)
            with np.errstate(all="ignore"):
                nu = nu + math.exp(innovation) * above / (
                    2.0 * h**2 * (1.0 - phi) ** 2 * (1.0 - phi**2)
                )
        q = sum(float((((c.variance - nu) / (c.high - c.low)) ** 2).sum()) for c in self.curves)
        return q if math.isfinite(q) else 1e300

    def minimum(self, start: Array) -> float:
        options = {
            "maxiter": 20_000,
            "maxfev": 20_000,
            "adaptive": True,
            "xatol": 1e-6,
            "fatol": 1e-9,
        }
        theta = minimize(self.objective, start, method="Nelder-Mead", options=options).x
        processes = []
        for logit, innovation in theta[1:].reshape(-1, 2):
            u = math.log1p(math.exp(-logit))
            processes.append(
                GaussMarkov.from_sigma(
                    1.0 / (u * RATE_HZ), math.sqrt(math.exp(innovation) / -math.expm1(-2.0 * u))
                )
            )
        axis = AxisNoise(math.sqrt(math.exp(theta[0]) / RATE_HZ), gauss_markov=tuple(processes))
        return objective(axis, self.curves, [interval_weights(c) for c in self.curves])

    def start(self, rng: np.random.Generator | None = None) -> Array:
        """Times spread over the scales, or at random, each process as strong as the curve at its
        time.
        """
        nu, last = self.curves[0].variance, self.h.size - 1
        at = (
            np.linspace(0.0, last, self.processes + 2)[1:-1]
            if rng is None
            else np.sort(rng.uniform(2.0, last, self.processes))
        )
        theta = [math.log(2.0 * nu[0])]
        for place in at:
            u = 1.0 / 2.0**place
            theta += [-math.log(math.expm1(u)), math.log(5.0 * nu[round(place)] * u)]
        return np.array(theta)

    def best_of(self, starts: int) -> float:
        rng = np.random.default_rng(0)
        return min(self.minimum(self.start(rng)) for _ in range(starts))


def main() -> None:
    print(f"{'':38}{'ms':>10}{'objective':>16}")
    for title, curves, processes in (
        ("WN+3GM, one curve", [recording(1)], 3),
        ("WN+2GM, six curves", [recording(k) for k in range(6)], 2),
    ):
        name, twin = f"WN+{processes}GM", Plain(curves, processes)
        rows = (
            ("insgnss", lambda c=curves, n=name: fit(c, n).objective, 21),
            ("plain, one start", lambda t=twin: t.minimum(t.start()), 3),
            ("plain, best of ten", lambda t=twin: t.best_of(10), 1),
        )
        for who, run, repeats in rows:
            print(
                f"{title + ': ' + who:38}{1e3 * median_cpu(run, repeats):10.1f}{run():16.9f}",
                flush=True,
            )
            title = " " * len(title)


if __name__ == "__main__":
    main()
