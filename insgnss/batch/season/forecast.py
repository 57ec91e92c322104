"""The memory that a flight will need, forecast from the sizes of its files before any is read.

`navigation.filter.forecast` knows what filter, smoother and trajectory need of samples,
epochs and rows; these are counted here by the size of a file over the mean length of its first
lines. It serves to decide how many flights run side by side; `process` forecasts again from what it
has read.
"""

from pathlib import Path

from ...base.inputs import opened
from ...flight.config.flight_file import Flight
from ...navigation.filter.forecast import forecast

PROGRAM_BYTES = 400e6  # interpreter, libraries, kernels: a run of eight minutes takes 315 MB in all
READ_BYTES = 150.0  # of a sample while its text is read and its increments are formed
PAGE_BYTES = 0.15e9  # diagnostics and charts of a page
USUAL_STATES, TRIPLES = 34, 1  # of a NavChip with the constants of its fixes
PROBE = 65_536  # bytes that the length of a line is measured by
BINARY_ROW = 56  # bytes of a row of seven doubles
USUAL_IMU_HZ = 200.0  # rate of an IMU, where it has to be guessed for a forecast (chosen)
USUAL_EVENTS = 2_000  # exposures of a flight, where the file does not show them (chosen)


def rows_of(file: object) -> int:
    """Return about how many rows a file has; 0 for what is no file.

    Parameters
    ----------
    file : object
        A path, or what a flight has in its place.
    """
    if not isinstance(file, Path) or not file.is_file():
        return 0
    size_bytes = file.stat().st_size
    with opened(file) as stream:
        beginning = stream.read(PROBE)
    if b"\0" in beginning:
        return size_bytes // BINARY_ROW
    lines = beginning.count(b"\n")
    return int(size_bytes * lines / len(beginning)) if lines else 0


def forecast_bytes(flight: Flight) -> float:
    """Return the bytes that a flight will need at most, program and libraries among them.

    Parameters
    ----------
    flight : Flight
        The flight file.
    """
    samples = sum(rows_of(imu.file) for imu in (flight.imu, *flight.imu.further))
    fixes = rows_of(flight.gnss.file)
    if not fixes and samples:  # raw observations, a stationary sensor
        fixes = int(samples / USUAL_IMU_HZ * 10.0)
    events = rows_of(flight.camera.events) if flight.camera is not None else 0
    events = min(events or USUAL_EVENTS, fixes or USUAL_EVENTS)
    hz = flight.output.trajectory_hz
    rows = samples if hz is None else min(samples, int(samples / USUAL_IMU_HZ * hz) or samples)
    needed = forecast(samples, fixes + events, USUAL_STATES, TRIPLES, events, rows)
    return PROGRAM_BYTES + PAGE_BYTES + needed.total + READ_BYTES * samples
