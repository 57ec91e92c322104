"""A receiver's own part in what it measures.

Its clock, noise and reflections, and what it holds in lock.

Clock. Offset dt of the receiver's clock from GPST at its epochs, of a start, a drift, and random
walks of phase and of frequency. With jumps of J, what is written is dt - J round(dt / J): stamps,
codes and phases jump together.

Noise at elevation E is white and, from reflections, Gauss-Markov, both over sin E.

Tracking. A satellite is held above the elevation mask while it is not too far below the plane of
the antenna, which banks with the vehicle, and is not lost for some seconds (both bands, or L2
alone). Every time it is found again its ambiguities are new, and loss of lock is reported. Between,
it slips: on L1, on L2 or on both, by one to a thousand cycles (each order of magnitude as often as
the other), with the report of a share of the slips only. Losses and slips are more frequent where
the bank exceeds a limit.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import OptionError
from ...io.options.kinds import check
from ...io.options.schema import option
from ...navigation.noise_model.model import AxisNoise, GaussMarkov
from ...noise.processes.realisation import simulate_noise

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Index = NDArray[np.int64]

PHASE_WALK = 1e-10  # s/sqrt(s): of a temperature-compensated crystal, 1e-10 over a second
FREQUENCY_WALK = 2e-11  # 1/sqrt(s)
LOST_ON_L2_ALONE = 0.3  # share of the losses of lock (chosen)
LARGEST_SLIP = 1000  # cycles
LARGEST_RESTART = 100_000  # cycles by which an ambiguity differs when a satellite is found again


@dataclass(frozen=True)
class Tracking:
    """How often lock suffers: rates per satellite and hour.

    It suffers more often by `turn_factor` where the bank exceeds `turn_bank_deg`.

    Parameters
    ----------
    reported_share : of the slips.
    outage_s : shortest and longest loss of a satellite.
    """

    slips_per_hour: float = option(4.0, "cycle slips of a satellite an hour", low=0.0)
    reported_share: float = option(
        0.8, "share of the slips that the receiver reports", low=0.0, high=1.0
    )
    outages_per_hour: float = option(2.0, "losses of a satellite an hour", low=0.0)
    outage_s: tuple[float, float] = option(
        (1.0, 8.0), "shortest and longest loss of a satellite", unit="s", positive=True
    )
    turn_factor: float = option(5.0, "factor on slips and losses while the aircraft banks", low=0.0)
    turn_bank_deg: float = option(
        15.0, "bank angle beyond which turn_factor acts", unit="deg", low=0.0
    )

    def __post_init__(self) -> None:
        check(self, "tracking")
        if self.outage_s[0] > self.outage_s[1]:
            problem = "must be the shortest and the longest duration of an outage, s"
            raise OptionError("tracking.outage_s", problem, self.outage_s)

    def times(self, share: float) -> "Tracking":
        """The same with both rates multiplied by `share`."""
        slips, outages = share * self.slips_per_hour, share * self.outages_per_hour
        return replace(self, slips_per_hour=slips, outages_per_hour=outages)


@dataclass(frozen=True, eq=False)
class Locks:
    """Locks of n epochs and s satellites on two bands.

    Parameters
    ----------
    held : (n, s, 2).
    cycles : (n, s, 2) integers to be added to the phase.
    report : (n, s, 2) loss of lock reported.
    slips : (n, s, 2) cycles of the slips, zero where there is none.
    """

    held: Flags
    cycles: Index
    report: Flags
    slips: Index


def clock(
    n: int, interval: float, offset_s: float, drift: float, rng: np.random.Generator
) -> Array:
    """Return the clock minus GPST (n,) s, at epochs `interval` s apart.

    Start and drift are drawn, evenly and normally, of these sizes.
    """
    start, rate = rng.uniform(-offset_s, offset_s), drift * rng.standard_normal()
    frequency = rate + np.cumsum(FREQUENCY_WALK * np.sqrt(interval) * rng.standard_normal(n))
    steps = frequency * interval + PHASE_WALK * np.sqrt(interval) * rng.standard_normal(n)
    steps[0] = start
    return np.cumsum(steps)


def noise(
    sine: Array,
    white_m: float,
    correlated_m: float,
    correlation_s: float,
    interval: float,
    rng: np.random.Generator,
) -> Array:
    """Return white and Gauss-Markov noise (n, s), m, of s satellites.

    It is over the `sine` (n, s) of their elevation.
    """
    out = white_m * rng.standard_normal(sine.shape)
    if correlated_m > 0.0:
        process = AxisNoise(gauss_markov=(GaussMarkov.from_sigma(correlation_s, correlated_m),))
        for column in range(sine.shape[1]):
            out[:, column] += simulate_noise(process, sine.shape[0], interval, rng, "point")
    return out / sine


def track(
    visible: Flags, bank: Array, interval: float, tracking: Tracking, rng: np.random.Generator
) -> Locks:
    """Return the locks on satellites that could be `visible` (n, s), at a `bank` (n,), rad.

    The epochs are `interval` s apart; the bank is that of the antenna.
    """
    outage, slip = rng.spawn(2)
    n, s = visible.shape
    turning = np.abs(bank) > np.radians(tracking.turn_bank_deg)
    often = np.where(turning, tracking.turn_factor, 1.0)[:, None] * interval / 3600.0
    held = np.repeat(visible[:, :, None], 2, axis=2)
    for k, j in np.argwhere(visible & (outage.random((n, s)) < tracking.outages_per_hour * often)):
        last = k + max(1, round(outage.uniform(*tracking.outage_s) / interval))
        held[k:last, j, int(outage.random() < LOST_ON_L2_ALONE) :] = False
    before = np.zeros_like(held)
    before[1:] = held[:-1]
    fresh = held & ~before
    slipped = (held & before).all(axis=2) & (slip.random((n, s)) < tracking.slips_per_hour * often)
    sizes = np.zeros((n, s, 2), dtype=np.int64)
    count = int(slipped.sum())
    size = np.exp(slip.uniform(0.0, np.log(LARGEST_SLIP), (count, 2))).astype(np.int64)
    size *= slip.choice([-1, 1], (count, 2))
    bands = np.array([[1, 0], [0, 1], [1, 1]])[slip.integers(0, 3, count)]
    sizes[slipped] = size * bands
    jump = np.where(fresh, slip.integers(-LARGEST_RESTART, LARGEST_RESTART + 1, (n, s, 2)), sizes)
    report = fresh.copy()
    report[0] = False
    report[slipped] |= (bands == 1) & (slip.random(count) < tracking.reported_share)[:, None]
    return Locks(held, np.cumsum(jump, axis=0), report, sizes)
