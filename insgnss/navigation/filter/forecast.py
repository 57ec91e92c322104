"""What a flight needs of memory, before it is filtered, within a third or so.

increments    56 bytes a sample
estimation    results, checkpoints and measurements of the epochs, twice while another error
              model is tried beside the first; records; covariances of all states at the epochs
              of the report, and of few exposures with their chain; what is made of the images
trajectory    the output, and as much again while it is made
"""

from dataclasses import dataclass

from .blocks import EPOCHS_OF_BLOCK, MOST_COVARIANCE_ROWS, WHOLE_BYTES, record_bytes
from .codes import N_KINDS, N_NAV, N_NOMINAL
from .event_chain import CHAIN_BYTES

TRIPLE_BYTES = 8 * 3 * 4  # innovations, their sigmas and what the evidence is made of
MEASUREMENT_BYTES = 450  # of an epoch: `navigation.filter.kernels.records.Epochs`, and its stamp
POSE_BYTES = 8 * (7 + 9 + 81 + 6)  # of a row of the trajectory
SAMPLE_BYTES = 8 * 7  # of increments
IMAGE_BYTES = 4000  # of an exposure: its pose three times, what its line shares, its names
# of an exposure among 30 of a line, the usual, and of all (`navigation.orient.strips`)
STRIP_BYTES, MOST_STRIP_BYTES = 8 * 36 * 30, 256_000_000
ADDED_STATES = 12  # that a search may try besides


@dataclass(frozen=True)
class Forecast:
    """What a flight will need, in bytes.

    Parameters
    ----------
    samples, epochs, states, rows : int
        Samples of the IMU, epochs and states of the filter, rows of the trajectory.
    increments, estimation, trajectory : int
        Bytes of the three.
    """

    samples: int
    epochs: int
    states: int
    rows: int
    increments: int
    estimation: int
    trajectory: int

    @property
    def total(self) -> int:
        """Bytes in all; the trajectory is made when the search is over."""
        return self.increments + self.estimation + self.trajectory


def forecast(
    samples: int, epochs: int, states: int, triples: int, exposures: int, rows: int
) -> Forecast:
    """Forecast the memory of a flight.

    Parameters
    ----------
    samples, epochs, states : int
        Samples of the IMU; epochs and states of the filter.
    triples : int
        Kinds of measurements, of three rows each.
    exposures, rows : int
        Camera events, and rows of the trajectory.

    Returns
    -------
    Forecast
        From when the samples are read on.
    """
    n = states + ADDED_STATES
    ns = n - N_NAV
    of_epoch = 8 * (N_NOMINAL + ns + N_NAV + 2 * N_KINDS + N_NAV * (N_NAV + 1) // 2)
    of_epoch += TRIPLE_BYTES * triples
    of_block = 8 * (3 * n * n + 4 * N_NAV * n)
    each = record_bytes(states, 3 * triples, False)
    records = epochs * each if epochs * each <= WHOLE_BYTES else EPOCHS_OF_BLOCK * each
    whole = min(MOST_COVARIANCE_ROWS, epochs) * 4 * n * (n + 1)
    solution = epochs * of_epoch + epochs // EPOCHS_OF_BLOCK * of_block + whole
    estimation = 2 * solution + records + epochs * (MEASUREMENT_BYTES + 8 * n)
    estimation += min(exposures * 16 * n * n, CHAIN_BYTES) + exposures * IMAGE_BYTES
    estimation += min(exposures * STRIP_BYTES, MOST_STRIP_BYTES)
    return Forecast(
        samples,
        epochs,
        states,
        rows,
        samples * SAMPLE_BYTES,
        estimation,
        2 * rows * POSE_BYTES,
    )
