"""Short simulated flights as estimation problems in memory, with their truth in the frame of the
problem.
"""

from dataclasses import dataclass, replace

import numpy as np

from insgnss.geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.navigation.filter.blocks import BlockwisePasses
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import StateLayout, state_layout
from insgnss.navigation.filter.problem import EstimationProblem, InitialState
from insgnss.navigation.filter.smoother import EventRows
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.simulation.scenario import GnssOptions, ImuOptions, SimulatedFlight, simulate_flight

NO_GATE = 1e12


@dataclass(frozen=True, eq=False)
class Flown:
    """A flight, the problem that it poses in the simulator's own local frame, and where events and
    extra marks are.
    """

    sim: SimulatedFlight
    problem: EstimationProblem
    event_epochs: np.ndarray
    extra_epochs: np.ndarray

    def true_nav(self, at: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(k, 10) of the exact motion at epochs `at`."""
        motion, time = self.sim.flight.motion, self.problem.inc.marks[at]
        return np.hstack(
            [
                motion.position(time),
                motion.velocity(time),
                quaternion_from_rotation(motion.C_lb(time)),
            ]
        )


def fly(
    seconds: float,
    seed: int = 1,
    *,
    imu_hz: float = 200.0,
    noise: str | None = "navchip",
    layout: StateLayout | None = None,
    velocity: bool = False,
    extra: np.ndarray | None = None,
    gate: float = 0.0,
    gnss: GnssOptions | None = None,
    events_s: np.ndarray | None = None,
    delay: tuple[float, float] = (0.0, 0.0),
    **changes: object,
) -> Flown:
    """A flight of short lines with turns, started in the air; `extra` : s after the start, further
    epochs without measurement; `events_s` : likewise, in place of the camera's; `delay` : s, and
    s/s since the first fix, by which the receiver's stamps of fixes and events are early.
    """
    options = {"start_in_air": True, "line_length_m": 120.0, **changes}
    gnss = gnss or GnssOptions(velocity_sigma_ms=(0.03, 0.03, 0.05) if velocity else None)
    sim = simulate_flight(
        "ign8",
        seconds / 60.0,
        seed=seed,
        imu=ImuOptions(rate_hz=imu_hz, noise=noise),
        gnss=gnss,
        **options,
    )
    imu = sim.imu
    exposed = sim.events
    if events_s is not None:
        names = tuple(str(k) for k in range(events_s.size))
        exposed = replace(exposed, images=names, time=sim.flight.motion.start + events_s)
    first, (offset, rate) = sim.gnss.time[0], delay
    fixes, events = (
        replace(record, time=record.time - offset - rate * (record.time - first))
        for record in (sim.gnss, exposed)
    )
    fixes = cut_fixes(fixes, imu.time[0], imu.time[-1])
    more = np.zeros(0) if extra is None else sim.flight.motion.start + extra
    marks, (at_fix, at_event, at_extra) = merge_marks(fixes.time, events.time, more)
    inc = body_increments(imu, np.eye(3), marks)
    frame = sim.flight.motion.frame
    epochs = make_epochs(inc, at_fix, fixes, at_event, frame)
    states = layout or state_layout(load_noise_model(noise or "navchip"))
    problem = EstimationProblem(
        inc, epochs, frame, states, sim.rig.antenna_lever_b, gate or gate_from_sigma(5.0), 0.1
    )
    return Flown(sim, problem, at_event, at_extra)


def start_near(flown: Flown, sigma: np.ndarray, offset: np.ndarray | None = None) -> InitialState:
    """Start at the truth less the error `offset` (9,), with standard deviations `sigma` (9,) and
    the IMU states as a-priori.
    """
    nav = moved(
        flown.true_nav(slice(0, 1)), -np.asarray([np.zeros(9) if offset is None else offset])
    )[0]
    layout = flown.problem.layout
    P = np.diag(np.concatenate([np.asarray(sigma), layout.sigma0]) ** 2)
    return InitialState(nav, np.zeros(layout.size - 9), np.zeros(layout.size), P)


def moved(nav: np.ndarray, error: np.ndarray) -> np.ndarray:
    """States (k, 10) plus errors (k, 9), attitude from the left."""
    turned = rotation_from_vector(error[:, 6:9]) @ rotation_from_quaternion(nav[:, 6:])
    return np.hstack([nav[:, :6] + error[:, :6], quaternion_from_rotation(turned)])


def error_of(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(k, 9) truth minus estimate of states (k, 10), psi in l."""
    turn = rotation_from_quaternion(truth[:, 6:]) @ np.swapaxes(
        rotation_from_quaternion(estimate[:, 6:]), -1, -2
    )
    return np.hstack([truth[:, :6] - estimate[:, :6], vector_from_rotation(turn)])


def without_noise(flown: Flown, quantity: str = "mean_rate") -> Flown:
    """The same flight with an ideal IMU."""
    motion = flown.sim.flight.motion
    imu = motion.imu(flown.sim.imu_options.rate_hz, quantity)
    inc = body_increments(imu, np.eye(3), flown.problem.inc.marks)
    return replace(flown, problem=replace(flown.problem, inc=inc))


def passes_in_one(problem: EstimationProblem, start: InitialState) -> BlockwisePasses:
    """Passes over one block that keep the whole covariance of every epoch, and of events what any
    state reads; records of the epochs begin at row 1.
    """
    m = problem.epochs.stop.size
    passes = BlockwisePasses(problem, start, np.arange(m), 100, m)
    passes.read = EventRows.of(passes.read.begin.size - 1, np.arange(problem.layout.size))
    return passes
