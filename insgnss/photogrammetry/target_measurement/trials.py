"""What would have found the targets: another size, the other brightness, a wider search."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...flight.processing.progress import quiet
from ...records.rows import rows_of
from ..targets.measurement import Rules
from .inputs import TargetInputs
from .photographs import Photographs
from .request import Target
from .windows import accepted_windows, windows_of

SIZE_FACTORS = (0.5, 2.0 / 3.0, 1.5, 2.0)  # of the size: wrong by less, targets are found
WIDER_PX = 10.0, 30.0  # the second: half a degree of bore-sight that was not estimated, at 3500 px
SAMPLE_WINDOWS = 6
"""Windows that are tried, of as many images as there are."""
ADVICE_SHARE = 0.5
"""Share of them that must be found for an advice."""


def advice(inputs: TargetInputs, photographs: Photographs, progress: Callable[[str], None]) -> str:
    """Say what finds the targets where nearly none was found.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    photographs : Photographs
        Files of its images.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    str
        What to ask for, with how many are found then; empty where no trial helps.
    """
    predictions = inputs.predictions
    taken = np.array([photographs.files[i] is not None for i in predictions.image])
    rows = np.flatnonzero(predictions.visible & taken)
    rows = rows[np.unique(np.linspace(0, rows.size - 1, SAMPLE_WINDOWS).astype(int))]
    plain = Rules(clear=-1.0)  # no shadow is looked for
    for change, target, wider_px in _trials(inputs.request.target):
        progress(f"trying {change}")
        fields = ("image", "point", "uv", "by_point", "visibility")
        cov = predictions.cov[rows] + wider_px**2 * np.eye(2)
        some = replace(predictions, **rows_of(predictions, rows, fields), cov=cov)
        request = replace(inputs.request, target=target)
        trial = replace(inputs, request=request, predictions=some)
        try:
            windows = windows_of(trial, photographs, quiet, plain)
        except InputError:  # a target that cannot be, such as bars wider than long
            continue
        count = len(accepted_windows(windows))
        if count > ADVICE_SHARE * rows.size:
            return f"with {change} {count} of {rows.size} that were tried are found"
    return ""


def _trials(target: Target) -> Iterator[tuple[str, Target, float]]:
    """What is tried, as the command line says it, with its target and its wider search."""
    for wider_px in WIDER_PX:
        yield f"--search-px {wider_px:g}", target, wider_px
    if target.kind in ("disc", "cross", "ring"):
        change = "without --dark" if target.dark else "--dark"
        yield change, replace(target, dark=not target.dark), 0.0
    for factor in SIZE_FACTORS:
        size = float(f"{factor * target.size_m:.3g}")
        arm = None if target.arm_m is None else factor * target.arm_m
        yield f"--size {size:g}", replace(target, size_m=size, arm_m=arm), 0.0
