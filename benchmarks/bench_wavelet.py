"""Wavelet variance of long recordings against allantools and a plain numpy twin.

    python benchmarks/bench_wavelet.py [--samples 3600000] [--repeats 9]

The twin is the pyramid in numpy: each level halves the sum and the difference of the level before
with itself, shifted. Single axes are compared by CPU time; six axes run in two threads and are
given as wall time, for which a person waits.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from common import median_cpu, one_thread

from insgnss.noise.moments.wavelet import default_levels, wavelet_variance, wavelet_variances

RATE = 250.0


def numpy_twin(x: np.ndarray) -> np.ndarray:
    """Haar wavelet variance by the pyramid, one numpy expression a level."""
    smooth, out = x, []
    for k in range(default_levels(x.size)):
        late, early = smooth[2**k :], smooth[: -(2**k)]
        detail = 0.5 * (late - early)
        out.append(np.dot(detail, detail) / detail.size)
        smooth = 0.5 * (late + early)
    return np.array(out)


def median_wall(run: Callable[[], object], repeats: int) -> float:
    run()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def main() -> None:
    one_thread()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=3_600_000)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    x = np.random.default_rng(1).standard_normal((options.samples, 6))
    axis = x[:, 0].copy()
    error = np.abs(wavelet_variance(axis, RATE).variance / numpy_twin(axis) - 1.0).max()
    print(
        f"{options.samples} samples, {default_levels(options.samples)} levels; CPU milliseconds of"
        f" one axis, medians of {options.repeats}"
    )
    steps: dict[str, Callable[[], object]] = {
        "wavelet variance with intervals": lambda: wavelet_variance(axis, RATE),
        "numpy twin, no intervals": lambda: numpy_twin(axis),
        "robust wavelet variance": lambda: wavelet_variance(axis, RATE, robust=True),
    }
    try:
        import allantools
    except ImportError:
        print("allantools is not here: pip install '.[test]'")
    else:
        steps["allantools oadev, octaves"] = lambda: allantools.oadev(
            axis, rate=RATE, data_type="freq", taus="octave"
        )
    own = 0.0
    for name, run in steps.items():
        ms = 1e3 * median_cpu(run, options.repeats)
        own = own or ms
        print(f"  {name:40} {ms:8.1f}   {ms / own:6.1f}")
    print("six axes, two threads, wall milliseconds")
    print(
        f"  {'wavelet variance with intervals':40}"
        f" {1e3 * median_wall(lambda: wavelet_variances(x, RATE), options.repeats):8.1f}"
    )
    print(
        f"  {'robust':40}"
        f" {1e3 * median_wall(lambda: wavelet_variances(x, RATE, robust=True), 3):8.1f}"
    )
    print(f"largest relative difference to the twin {error:.1e}")


if __name__ == "__main__":
    main()
