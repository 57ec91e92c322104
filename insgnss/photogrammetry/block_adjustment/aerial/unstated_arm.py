"""What is said of a lever arm that nobody states: what looks alike, and what would go unnoticed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ....base.findings import Finding, ranked
from ....base.quantiles import chi_square_quantile
from ...adjust.aerial import CAMERA_LEVER_ARM
from ..parameters import SIGNIFICANT_SIGMAS, UNSTATED_ARM_M
from ..solve import AdjustedBlock
from ..trials import COVERED_SIGMAS, INTERIOR_ORIENTATION, RIVAL_GAIN, Trial, gain_of_arm

ALIKE_GAIN = 16.0  # squares of sigmas, by which the cost of causes differs that look alike (chosen)
LONG_ARM_M = 0.25  # lever arm that nobody states (m), beyond which it must be measured (chosen)
REFUSED_RANK = 5.0  # of a finding with which no orientation is written (`judgement.TOO_LARGE`)
AXES = ("x axis", "y axis", "viewing direction")


def alike(solved: AdjustedBlock, trials_made: Sequence[Trial]) -> list[Trial]:
    """Return what fits nearly as well in the place of a lever arm that nobody states.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    trials_made : sequence of Trial
        What was tried.
    """
    instead = [one for trial in trials_made if (one := trial.in_place_of_arm) is not None]
    if not instead:
        return []
    least = _least_gain(max((gain_of_arm(solved), *(one.gain for one in instead))))
    return [one for one in instead if one.explains and one.gain > least]


def _least_gain(best: float) -> float:
    """Return the gain from which on a cause fits nearly as well as the best one."""
    return min(best - ALIKE_GAIN, RIVAL_GAIN * best)


def long_lever_arm(
    solved: AdjustedBlock, figures: Mapping[str, Any], trials_made: Sequence[Trial]
) -> Iterator[Finding]:
    """Say of a lever arm that nobody states what looks alike, and would move the images otherwise.

    It is said where the arm is long, and where a camera that is held may be wrong instead. A delay
    moves the images as the arm does; ground control has the datum that its user wants.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    figures : mapping
        Its figures.
    trials_made : sequence of Trial
        What was tried.

    Yields
    ------
    Finding
        That no orientation is written until it is measured.
    """
    arm = figures["mounting"].get(CAMERA_LEVER_ARM)
    if arm is None or solved.inputs.file.aerial_control.lever_arm_sigma_m != UNSTATED_ARM_M:
        return
    value, sigma = np.array(arm["value"]), np.array(arm["sigma"])
    times, absorbed = (np.abs(value) / sigma).max(), gain_of_arm(solved)
    rivals = alike(solved, trials_made)
    long = np.linalg.norm(value) > LONG_ARM_M and times > SIGNIFICANT_SIGMAS
    of_camera = [
        one
        for one in rivals
        if one.name == INTERIOR_ORIENTATION and one.gain > absorbed - ALIKE_GAIN
    ]
    if not long and not (of_camera and times > COVERED_SIGMAS):
        return
    shown = " / ".join(f"{1e3 * v:+.0f}" for v in value)
    causes = [f"{one.name} of {one.shown}" for one in rivals]
    prior = float(((value / UNSTATED_ARM_M) ** 2).sum())  # rivals have none
    if absorbed + prior > _least_gain(max((absorbed, *(one.gain for one in rivals)))):
        causes.insert(0, "a lever arm")
    unknown = "; the images do not tell which" * (len(causes) > 1)
    advice = "".join(f", or {one.remedy}" for one in of_camera)
    yield ranked(
        CAMERA_LEVER_ARM,
        REFUSED_RANK,
        f"positions lie {shown} mm (camera x, y, z) from the projection centres, by"
        f" {' or '.join(causes)}{unknown}",
        f"measure the antenna and state it by --lever-arm{advice}, then adjust again",
    )


def unnoticed(
    solved: AdjustedBlock, trials_made: Sequence[Trial], chance: float
) -> Iterator[Finding]:
    """Say how large a lever-arm error the block would not show; nothing where poses cover it.

    Of nadir images at one height the camera constant takes the part along the viewing direction.
    """
    if not solved.inputs.file.aerial_control.positions_alone:
        return
    variance = np.median(np.diagonal(solved.precision.pose_cov, axis1=1, axis2=2), axis=0)[:3]
    arm = next((one for one in trials_made if one.name == "lever arm"), None)
    if solved.inputs.file.aerial_control.lever_arm_sigma_m is not None:
        sigma = np.sqrt(np.diagonal(solved.precision.cov((CAMERA_LEVER_ARM, 0))))
        size, hidden = sigma.max(), sigma.max() > np.sqrt(0.5 * variance.max())
        text = "the lever arm (antenna height) and all images are known to {}, as their sigmas say"
    elif arm is not None:
        limit, sigma = chi_square_quantile(arm.unknowns, chance), arm.sigma
        size = np.sqrt(limit) * sigma.max()
        hidden = arm.gain <= limit and size > COVERED_SIGMAS * np.sqrt(variance.max())
        text = "an error of the lever arm (antenna height) of up to {} would go unnoticed and move"
        text += " all images by as much"
    else:
        return
    if hidden:
        along = f"{1e3 * size:.0f} mm along the camera's {AXES[int(np.argmax(sigma))]}"
        advice = "measure it and state it by --lever-arm; oblique images or a second height reveal"
        yield ranked("lever arm", 0.5, text.format(along), f"{advice} it")
