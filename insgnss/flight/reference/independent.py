"""Which flights `poses` knows how to orient, what it needs of their flight file, the comparison."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...navigation.filter.codes import POSITION_ROW, USED
from ...records.cameras.mounting import antenna_sigmas
from ...records.states import LEVER_ARM, OF_LEVER_ARM, TIME_OFFSET
from ..config.flight_file import Flight
from ..processing.orientation.poses import orient_images
from ..processing.recording import Recording
from ..processing.segment import Segment
from .poses import Bias, Setup, image_poses, pose_differences

AXIS_VECTORS = {
    "forward": (1.0, 0.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "down": (0.0, 0.0, 1.0),
    "backward": (-1.0, 0.0, 0.0),
    "left": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, -1.0),
}
# s, of a part: two ways that begin at different first attitudes differ by up to 4 sigma after 18 s,
# 0.7 after 30, 0.1 after 60 and 0.04 after 120
SHORTEST_SOLVED_S = 55.0
# of images, in their sigmas: below a fifth, which a defect must not reach; usual are 0.02 to 0.1
LIMIT_POSE_SIGMAS = 0.15
DIFFERENCE_UNITS = (*((1e3, "mm"),) * 3, *((180.0 / np.pi, "deg"),) * 3)
POSE_QUANTITIES = ("east", "north", "up", "rotation about east", "about north", "about up")


@dataclass(frozen=True)
class Difference:
    """The largest difference of one quantity over all epochs and axes.

    Parameters
    ----------
    quantity : its name.
    largest : the difference, in `unit`, and in_sigmas by (T.24); each the largest of its own.
    unit : of `largest`.
    sigma_ratio : (T.25) at its largest, signed; 0.01 where the twin's sigma is 1 % larger.
    """

    quantity: str
    largest: float
    unit: str
    in_sigmas: float
    sigma_ratio: float


@dataclass(frozen=True)
class PoseAgreement:
    """How the images' orientation agrees with the independent one.

    Parameters
    ----------
    images : how many were compared.
    differences : east, north, up, and the rotation about them; sigma_ratio is not compared.
    reason : why none were, else "".
    """

    images: int = 0
    differences: tuple[Difference, ...] = ()
    reason: str = ""

    @property
    def in_sigmas(self) -> float:
        """The largest difference in standard deviations of its image."""
        return max((difference.in_sigmas for difference in self.differences), default=0.0)

    def sentence(self) -> str:
        """Return what was found in one sentence."""
        if self.reason:
            return f"the images were not compared with independent poses: {self.reason}"
        verdict = "agree" if self.in_sigmas <= LIMIT_POSE_SIGMAS else "DO NOT AGREE"
        return (
            f"{self.images} images and independent poses {verdict}: largest difference"
            f" {self.in_sigmas:.2g} sigma (limit {LIMIT_POSE_SIGMAS:g})"
        )


NOT_COMPARED = PoseAgreement(reason="there is no flight file")  # but a posed problem alone


def compare_images(
    flight: Flight,
    recording: Recording,
    segment: Segment,
    progress: Callable[[str], None] = lambda _: None,
) -> PoseAgreement:
    """Orient the images of a segment by the core and independently, and compare them.

    Parameters
    ----------
    flight : the flight file of the part.
    recording : what was recorded.
    segment : the part, solved by the core.
    progress : gets the step that runs.

    Returns
    -------
    PoseAgreement
        The largest differences, or why the independent path does not know such a flight.
    """
    if reason := _unsupported_model(flight, recording, segment):
        return PoseAgreement(reason=reason)
    try:
        eo = orient_images(flight, recording, [segment], ())
    except DataError:
        eo = None
    if eo is None:
        return PoseAgreement(reason="no image lies in this part")
    events = recording.cameras[0].events
    stamps = dict(zip(events.images, events.time.tolist(), strict=True))
    exposures = np.array([stamps[image] for image in eo.images])
    span = float(segment.solution.time[0]), float(segment.solution.time[-1])
    setup = _setup(flight, recording, segment, eo.origin)
    poses = image_poses(setup, recording.imu, recording.gnss, exposures, span, progress)
    error, sigma = pose_differences(eo, poses)
    rows = [
        Difference(f"images, {name}", float(scale * np.abs(e).max()), unit, float(z.max()), 0.0)
        for name, (scale, unit), e, z in zip(
            POSE_QUANTITIES, DIFFERENCE_UNITS, error.T, np.abs(error / sigma).T, strict=True
        )
    ]
    return PoseAgreement(len(eo.images), tuple(rows))


def _unsupported_model(flight: Flight, recording: Recording, segment: Segment) -> str:
    """Return what of a flight the independent path does not model; empty where nothing."""
    solution, layout = segment.solution, segment.solution.problem.layout
    groups = {"bias", *(f"GM {k}" for k in range(1, 10)), LEVER_ARM, TIME_OFFSET.group}
    if foreign := [str(state) for state in layout.states if state.group not in groups]:
        return f"{foreign[0]} is estimated"
    sensors = np.delete(solution.verdict == USED, POSITION_ROW, axis=1)
    if sensors.any():
        return "not only positions are used (velocities, stationary periods, other sensors)"
    if (length := float(np.ptp(solution.time))) < SHORTEST_SOLVED_S:
        return f"{length:.0f} s are too short for the attitude ({SHORTEST_SOLVED_S:.0f} s needed)"
    if flight.imu.calibration is not None or flight.imu.further:
        return "the IMU is calibrated by a file, or there are several IMUs"
    if not set(flight.imu.axes.split()) <= set(AXIS_VECTORS):
        return f"the IMU axes are written {flight.imu.axes}"
    axes = (*recording.noise.gyro, *recording.noise.accel)
    epochs = solution.problem.epochs
    scales = layout.white_scales[np.unique(epochs.group[epochs.has_position])]
    corrected = any(check.name in ("IMU noise", "GNSS sigmas") for check in segment.checks)
    if corrected or (scales != 1.0).any():
        return "the flight corrected the noise of its sensors"
    sigma = dict(zip(layout.states, layout.sigma0.tolist(), strict=True))
    stated_sigmas = antenna_sigmas(flight.mounting.antenna_sigma_m)
    freed = [
        sigma.get(state, 0.0) > 1.01 * of_axis
        for state, of_axis in zip(OF_LEVER_ARM, stated_sigmas, strict=True)
    ]
    if any(freed) and not flight.filter.lever_arm:
        return "the flight contradicts the stated lever arm, which is then estimated"
    if any(axis.quantization or axis.drift for axis in axes):
        return "the noise model has quantization or drift"
    if len(recording.cameras) != 1 or recording.cameras[0].clock != "imu" or segment.time_offset_s:
        return "the flight has not just one camera, stamped by the IMU's clock"
    return ""


def _setup(flight: Flight, recording: Recording, segment: Segment, origin: np.ndarray) -> Setup:
    """Return what the independent path takes from the flight file and its noise model."""
    axes = (*recording.noise.gyro, *recording.noise.accel)
    biases = []
    for channel, axis in enumerate(axes):
        if axis.turn_on_bias or axis.random_walk:
            biases.append(Bias(channel, axis.turn_on_bias, drive=axis.random_walk**2))
        for gm in axis.gauss_markov:
            stationary = gm.driving_noise * np.sqrt(0.5 * gm.correlation_time_s)
            biases.append(Bias(channel, stationary, gm.correlation_time_s, gm.driving_noise**2))
    layout, mounting = segment.solution.problem.layout, flight.mounting
    sigma = dict(zip(layout.states, layout.sigma0.tolist(), strict=True))
    arm = [sigma.get(state, 0.0) for state in OF_LEVER_ARM]
    body_from_camera = (mounting.camera_from_body @ mounting.boresight).T
    return Setup(
        C_b_imu=np.array([AXIS_VECTORS[word] for word in flight.imu.axes.split()]).T,
        biases=biases,
        white=np.array([axis.white_noise for axis in axes]) ** 2,
        antenna_b=body_from_camera @ (mounting.antenna_m - mounting.imu_m),
        antenna_sigma_m=np.array(arm),
        offset_sigma_s=sigma.get(TIME_OFFSET, 0.0),
        camera_b=-body_from_camera @ mounting.imu_m,
        C_cb=body_from_camera.T,
        origin=origin,
    )
