"""What the benchmarks share: one thread, the bar's flight as an estimation problem, and the median
of CPU times.
"""

import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from insgnss.geodesy.axes import parse_axes
from insgnss.geodesy.frames import LocalFrame
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.problem import EstimationProblem
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.records import Array, Increments
from insgnss.simulation.scenario import SimulatedFlight, simulate_flight
from insgnss.simulation.sensors import ImuOptions

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
AXES = "right backward down"
AS_KNOWN = FixErrors()  # no errors of the fixes among the states


@dataclass(frozen=True)
class Case:
    """A simulated flight as the filter takes it. marks (m,) s; at_fix, at_event: index of the mark
    of each fix and exposure.
    """

    simulated: SimulatedFlight
    C_b_imu: Array
    marks: Array
    at_fix: np.ndarray
    at_event: np.ndarray
    frame: LocalFrame
    problem: EstimationProblem

    def increments(self) -> Increments:
        """The IMU samples between the marks, in body axes."""
        return body_increments(self.simulated.imu, self.C_b_imu, self.marks)

    def truth(self) -> tuple[Array, Array, Array]:
        """Position (m), velocity (m/s) of the IMU in the local frame and C_lb, at the fixes."""
        motion, time = self.simulated.flight.motion, self.marks[self.at_fix]
        turn = self.frame.C_el.T @ motion.frame.C_el
        shift = self.frame.position_from_geodetic(
            motion.frame.lat, motion.frame.lon, motion.frame.height
        )
        return (
            motion.position(time) @ turn.T + shift,
            motion.velocity(time) @ turn.T,
            turn @ motion.C_lb(time),
        )

    @property
    def samples(self) -> int:
        """IMU samples that a run sees."""
        return self.simulated.imu.time.size


def one_thread() -> None:
    """Begin again with the linear algebra libraries kept to one thread, so that CPU time is what
    one core does.
    """
    if os.environ.get(THREADS[0]) != "1":
        os.execve(
            sys.executable, [sys.executable, *sys.argv], os.environ | dict.fromkeys(THREADS, "1")
        )


def processor() -> str:
    """The name of the processor, as the system has it, and the number of its cores."""
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{(names or [platform.processor() or platform.machine()])[0]}, {os.cpu_count()} cores"


def block_flight(
    minutes: float,
    rate_hz: float = 500.0,
    seed: int = 5,
    fix_errors: FixErrors = AS_KNOWN,
    **changes: Any,
) -> Case:
    """The bar's flight: NavChip with turn-on biases (30 states), IMU axes permuted, 10 Hz fixes of
    2/2/3 cm, exposures.

    fix_errors : errors of the fixes among the states.
    changes : fields of the flight plan, as in `simulate_flight`.
    """
    simulated = simulate_flight(
        "ign8", minutes, seed=seed, imu=ImuOptions(rate_hz, "navchip", AXES), **changes
    )
    fixes, C_b_imu = simulated.gnss, parse_axes(AXES)
    inside = (fixes.time >= simulated.imu.time[0]) & (fixes.time <= simulated.imu.time[-1])
    fixes = type(fixes)(
        fixes.time[inside],
        fixes.lat[inside],
        fixes.lon[inside],
        fixes.height[inside],
        fixes.cov_ned[inside],
    )
    marks, (at_fix, at_event) = merge_marks(fixes.time, simulated.events.time)
    frame = LocalFrame(float(fixes.lat[0]), float(fixes.lon[0]), float(fixes.height[0]))
    inc = body_increments(simulated.imu, C_b_imu, marks)
    layout = state_layout(load_noise_model("navchip"), fixes=fix_errors)
    epochs = make_epochs(inc, at_fix, fixes, at_event, frame)
    problem = EstimationProblem(
        inc, epochs, frame, layout, simulated.rig.antenna_lever_b, gate_from_sigma(5.0), 0.1
    )
    return Case(simulated, C_b_imu, marks, at_fix, at_event, frame, problem)


def median_cpu(run: Callable[[], object], repeats: int) -> float:
    """Median CPU seconds of a call, after one that warms up."""
    run()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds)
