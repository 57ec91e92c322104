"""A part of a user's own flight by the navigation core and by the reference twin, compared.

The part is read, prepared and aligned as `insgnss process` does it. From then on the same
estimation problem with the same initial state goes through the compiled core and through the twin
(`twin`), with as many passes as the core took. Every difference is counted in the core's own
smoothed standard deviation (of attitude the components of psi in l), at every epoch:

    |twin - core| / sigma                                                          (T.24)
    |sigma_twin / sigma - 1|                                                       (T.25)

The orientation of the images of the part is then compared with `poses`, which goes from the samples
to the images without anything of the core, in the core's sigmas of the images.

The core accumulates its error model over blocks of 50 ms and carries the covariance once an epoch,
the twin goes from sample to sample; what that shortens is what remains of the difference.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import DataError
from ...geodesy.rotation import rotation_from_quaternion, vector_from_rotation
from ...navigation.filter.codes import POS, PSI, VEL
from ...records import Array
from ...report.document import Document, Section, Table
from ...report.verdict import worst_of
from .independent import LIMIT_POSE_SIGMAS, NOT_COMPARED, Difference, PoseAgreement, compare_images

if TYPE_CHECKING:
    from ...navigation.filter.problem import EstimationProblem, InitialState
    from ...navigation.filter.solution import Solution
    from ..config.flight_file import Flight
    from ..processing.recording import Recording
    from .twin import TwinSolution

# a tenth of what the product calls uncertain, three percent of that; usual are 1e-3 and 1e-4
LIMIT_SIGMAS, LIMIT_RATIO = 0.1, 0.03  # of (T.24) and (T.25)


@dataclass(frozen=True)
class Verification:
    """What `verify` found.

    Parameters
    ----------
    name : of the flight.
    begin, end : of the part, s of the week.
    epochs, imu_samples, states : size of the part and of the state vector.
    passes : forward passes of the core, and of the twin.
    differences : of position, velocity, attitude, biases, and of each state by itself.
    decisions : measurements; decided_otherwise : those used by one and rejected by the other.
    core_s, twin_s : time that filter and smoother took, s.
    poses : the images by core and by the independent path.
    """

    name: str
    begin: float
    end: float
    epochs: int
    imu_samples: int
    states: int
    passes: int
    differences: tuple[Difference, ...]
    decisions: int
    decided_otherwise: int
    core_s: float
    twin_s: float
    poses: PoseAgreement = NOT_COMPARED

    @property
    def in_sigmas(self) -> float:
        """The largest difference in standard deviations."""
        return max(d.in_sigmas for d in self.differences)

    @property
    def sigma_ratio(self) -> float:
        """The largest difference of two standard deviations, as a share."""
        return max(abs(d.sigma_ratio) for d in self.differences)

    @property
    def passed(self) -> bool:
        """Whether core and twin agree within the limits and took the same decisions."""
        small = self.in_sigmas <= LIMIT_SIGMAS and self.sigma_ratio <= LIMIT_RATIO
        return small and self.decided_otherwise == 0 and self.oriented

    @property
    def oriented(self) -> bool:
        """Whether the images agree with the independent poses, or were not compared."""
        return self.poses.in_sigmas <= LIMIT_POSE_SIGMAS

    @property
    def refusal(self) -> DataError | None:
        """The error where core and twin do not agree, else None."""
        if self.passed:
            return None
        if not self.oriented:
            return DataError(
                f"{self.poses.sentence()}; try another part with --start, and report a difference"
                " that stays"
            )
        return DataError(
            f"core and reference twin differ by {self.in_sigmas:.3g} sigma (limit "
            f"{LIMIT_SIGMAS:g}), their standard deviations by {100 * self.sigma_ratio:.2g} % "
            f"(limit {100 * LIMIT_RATIO:g} %), {self.decided_otherwise} of {self.decisions} "
            "measurements are used by one only (limit 0); try another part with --start, and "
            "report a difference that stays"
        )

    def headline(self) -> str:
        """One sentence with the result."""
        agree = self.decided_otherwise == 0 and self.in_sigmas <= LIMIT_SIGMAS
        verdict = "agree" if agree and self.sigma_ratio <= LIMIT_RATIO else "DO NOT AGREE"
        return (
            f"core and reference twin {verdict}: largest difference {self.in_sigmas:.2g} sigma "
            f"(limit {LIMIT_SIGMAS:g}), standard deviations within "
            f"{100 * self.sigma_ratio:.2g} % (limit {100 * LIMIT_RATIO:g} %);"
            f" {self.poses.sentence()}"
        )

    def summary(self) -> str:
        """The headline and a table for the terminal."""
        rows = [
            (
                d.quantity,
                f"{d.largest:.2e} {d.unit}",
                f"{d.in_sigmas:.2e}",
                f"{1 + d.sigma_ratio:.6f}",
            )
            for d in self.differences
        ]
        rows += [
            (d.quantity, f"{d.largest:.2e} {d.unit}", f"{d.in_sigmas:.2e}", "")
            for d in self.poses.differences
        ]
        header = ("largest difference of", "in its unit", "sigmas", "sigma ratio")
        extent = (
            f"{self.begin:.1f} to {self.end:.1f} s: {self.imu_samples} IMU samples,"
            f" {self.epochs} epochs, {self.states} states, passes: {self.passes}"
        )
        decided = (
            f"measurements: {self.decisions}, of which used by one and rejected by the other: "
            f"{self.decided_otherwise}"
        )
        took = f"filter and smoother: core {self.core_s:.2f} s, twin {self.twin_s:.1f} s"
        refusal = [] if self.refusal is None else [str(self.refusal)]
        return Document(
            self.name,
            self.headline(),
            worst_of("all differences are within their limits", severe=refusal),
            [Section(self.name, [extent, Table(rows, header, numbers=True), decided, took])],
        ).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        limits = {"limit_sigmas": LIMIT_SIGMAS, "limit_ratio": LIMIT_RATIO}
        largest = {"in_sigmas": self.in_sigmas, "sigma_ratio": self.sigma_ratio}
        return (
            {"passed": self.passed, "headline": self.headline()} | limits | largest | asdict(self)
        )


def verify(
    flight: "Flight",
    minutes: float = 2.0,
    start_tow: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Verification:
    """Process a part of a flight by the core and by the reference twin and compare the two.

    Parameters
    ----------
    flight : the flight.
    minutes : length of the part.
    start_tow : where it begins, s of the week; None: the part with the longest path, which gives
        an attitude, or, where the flight file has [initial], the flight's first minutes.
    progress : gets the step that runs.

    Returns
    -------
    Verification
        The largest differences and the time taken.

    Raises
    ------
    InputError, DataError
        Where the flight cannot be processed, or the part does not give an attitude.
    """
    from ..processing.recording import read_recording
    from ..processing.solve_segments import align, solve_segments

    progress("read")
    recording = read_recording(flight)
    cut = _cut_flight(flight, recording, 60.0 * minutes, start_tow)
    solved, _ = solve_segments(cut, recording, progress)
    longest = max(solved, key=lambda segment_run: segment_run.solution.time.size)
    problem = longest.solution.problem
    verification = verify_problem(
        problem, align(cut, problem)[0], cut.filter.second_pass, flight.name, progress
    )
    return replace(verification, poses=compare_images(cut, recording, longest, progress))


def verify_problem(
    problem: "EstimationProblem",
    start: "InitialState",
    second_pass: Any = "auto",
    name: str = "",
    progress: Callable[[str], None] = lambda _: None,
) -> Verification:
    """Solve an estimation problem by the core and by the reference twin and compare the two.

    Parameters
    ----------
    problem, start : the problem and its initial state.
    second_pass : "auto", "on" or "off", of `navigation.filter.solution.solve`.
    name : of the flight, for the summary.
    progress : gets the step that runs.
    """
    from ...navigation.filter.solution import solve
    from .twin import solve_twin

    progress("core")
    if problem.measurements:  # which the core linearises about a solution, after its first pass
        second_pass = "on"
    began = time.perf_counter()
    core = solve(problem, start, second_pass, separations=0)
    between = time.perf_counter()
    twin = solve_twin(problem, start, core.passes, progress)
    ended = time.perf_counter()
    decided = core.verdict, twin.forward.decision
    return Verification(
        name=name,
        begin=float(core.time[0]),
        end=float(core.time[-1]),
        epochs=core.time.size,
        imu_samples=problem.inc.dt.size,
        states=problem.layout.size,
        passes=core.passes,
        differences=differences(core, twin),
        decisions=int(np.count_nonzero(decided[0])),
        decided_otherwise=int(np.count_nonzero(decided[0] != decided[1])),
        core_s=between - began,
        twin_s=ended - between,
    )


def differences(core: "Solution", twin: "TwinSolution") -> tuple[Difference, ...]:
    """Return the largest differences (T.24, T.25) of two solutions of one problem."""
    rotation = rotation_from_quaternion(twin.nav[:, 6:]) @ np.swapaxes(
        rotation_from_quaternion(core.nav[:, 6:]), -1, -2
    )
    moved = [twin.nav[:, :6] - core.nav[:, :6], vector_from_rotation(rotation), twin.x - core.x]
    error = np.hstack(moved)
    covariances = core.covariance(np.arange(core.time.size)), twin.smoothed.P
    sigmas = [np.sqrt(np.diagonal(P, axis1=1, axis2=2)) for P in covariances]
    M = core.problem.layout.channel_sum()
    of_bias = [
        np.sqrt(np.maximum(np.einsum("cs,mst,ct->mc", M, P[:, 9:, 9:], M, optimize=True), 0.0))
        for P in covariances
    ]
    bias = (twin.x - core.x) @ M.T
    deg_per_rad, gyro, accel = 180.0 / np.pi, slice(0, 3), slice(3, 6)
    rows = [
        _difference(
            name,
            scale * values[:, columns],
            unit,
            *(scale * sigma[:, columns] for sigma in their_sigmas),
        )
        for name, values, columns, unit, scale, their_sigmas in (
            ("position", error, POS, "mm", 1e3, sigmas),
            ("velocity", error, VEL, "mm/s", 1e3, sigmas),
            ("attitude", error, PSI, "deg", deg_per_rad, sigmas),
            ("gyro bias", bias, gyro, "deg/h", 3600.0 * deg_per_rad, of_bias),
            ("accelerometer bias", bias, accel, "mm/s^2", 1e3, of_bias),
        )
    ]
    of_state, of_state_twin = (_positive(sigma[:, 9:]) for sigma in sigmas)
    in_sigmas, ratio = error[:, 9:] / of_state, of_state_twin / of_state
    rows.append(_difference("every error state", in_sigmas, "sigma", np.ones_like(ratio), ratio))
    return tuple(rows)


def _difference(
    quantity: str, error: Array, unit: str, sigma: Array, sigma_twin: Array
) -> Difference:
    """The largest of a difference (m, k) in its unit, against its sigma, and of the sigmas' ratio.

    Where sigma is zero (the bias of a sensor whose model has none) nothing is estimated.
    """
    if not error.size:
        return Difference(quantity, 0.0, unit, 0.0, 0.0)
    estimated = sigma > 0.0
    in_sigmas = np.where(estimated, np.abs(error) / _positive(sigma), 0.0)
    ratio = np.where(estimated, sigma_twin / _positive(sigma), 1.0) - 1.0
    largest = float(ratio.flat[np.argmax(np.abs(ratio))])
    return Difference(quantity, float(np.abs(error).max()), unit, float(in_sigmas.max()), largest)


def _positive(sigma: Array) -> Array:
    return np.where(sigma > 0.0, sigma, 1.0)


def _cut_flight(
    flight: "Flight", recording: "Recording", length_s: float, start_tow: float | None
) -> "Flight":
    """The flight cut to the part that is verified."""
    from ...navigation.prepare.clock import common_span, cut_fixes
    from ...navigation.prepare.fix_path import liveliest

    lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
    initial = flight.initial
    if start_tow is not None:
        begin, initial = max(lo, start_tow), initial if start_tow <= lo else None
    elif initial is not None:
        begin = lo
    else:
        begin, _ = liveliest(cut_fixes(recording.gnss, lo, hi), length_s)
    return replace(flight, start_tow=begin, end_tow=min(hi, begin + length_s), initial=initial)
