"""All targets of all photographs, with the verdict on each."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.advance import through
from ...records import Array
from ..targets.codes import LEAST_CLEAR, Ring, RingReading, read_ring
from ..targets.matching import Match
from ..targets.measurement import MeasuredTarget, Rules, measure
from ..targets.neighbours import LIMIT, disagreeing
from .inputs import TargetInputs
from .photographs import Photographs, read_grey

Bytes = NDArray[np.uint8]

SHOWN_SIGMAS = 3.0  # of the prediction, in a window of the contact sheet: its ellipse is drawn
SHOWN_PX = (24, 60)  # least and largest half of a window on the contact sheet


@dataclass(frozen=True, eq=False)
class Window:
    """A ground point in a photograph.

    Parameters
    ----------
    row : int
        Row of the prediction.
    measurement : MeasuredTarget
        What became of it.
    grey : ndarray of uint8
        Grey values about the prediction, for the contact sheet.
    corner : tuple of int
        Column and row of the image at which `grey` begins.
    code : RingReading or None
        What a ring-coded target says.
    """

    row: int
    measurement: MeasuredTarget
    grey: Bytes
    corner: tuple[int, int]
    code: RingReading | None = None


def windows_of(
    inputs: TargetInputs,
    photographs: Photographs,
    progress: Callable[[str], None],
    rules: Rules | None = None,
) -> list[Window]:
    """Measure the targets of all photographs.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    photographs : Photographs
        Files of its images.
    progress : callable
        Is called with the name of each step.
    rules : Rules, optional
        Limits; by default those of a good target.

    Returns
    -------
    list of Window
        Of all points that are predicted in photographs that are there, in the order of the
        predictions.

    Raises
    ------
    InputError
        A photograph cannot be read, or is of another size than the camera.
    """
    predictions, target = inputs.predictions, inputs.request.target
    signal, ring = target.signal, target.code
    numbers = [
        number_in(name) if inputs.vehicle is None else target.number
        for name in inputs.ground.points
    ]
    size = (inputs.camera.width, inputs.camera.height)
    rows = np.flatnonzero(predictions.visible)
    todo = [i for i in np.unique(predictions.image[rows]) if photographs.files[i] is not None]
    out: list[Window] = []
    progress(f"measuring in {len(todo)} photographs")
    for i in through(todo):
        path = photographs.files[i]
        assert path is not None
        of_image = rows[predictions.image[rows] == i]
        grey = read_grey(path, size)
        for row in of_image.tolist():
            uv, cov, by_point = predictions.uv[row], predictions.cov[row], predictions.by_point[row]
            got = measure(grey, signal, uv, cov, by_point, rules=rules)
            code = None
            if ring is not None:
                got, code = _decoded(got, grey, ring, numbers[predictions.point[row]])
            out.append(Window(row, got, *_shown(grey, uv, cov, got), code))
    return list(_held_together(inputs, out))


def number_in(name: str) -> int | None:
    """Return the number at the end of a point's name, which its ring-coded target says.

    Parameters
    ----------
    name : str
        Such as "G17".

    Returns
    -------
    int or None
        Such as 17; None of a name without.
    """
    digits = re.search(r"(\d+)$", name)
    return int(digits[1]) if digits else None


def accepted_windows(windows: Iterable[Window]) -> list[tuple[Window, Match]]:
    """Return the windows whose measurement stands, each with its match."""
    return [
        (window, match)
        for window in windows
        if (match := window.measurement.match) is not None and window.measurement.accepted
    ]


def _decoded(
    got: MeasuredTarget, grey: NDArray[np.float32], ring: Ring, wanted: int | None
) -> tuple[MeasuredTarget, RingReading | None]:
    """Reject a measurement whose ring does not say the number of its point."""
    if got.match is None or not got.accepted:
        return got, None
    code = read_ring(grey, ring, got.match.uv, got.match.to_pixel)
    if code is None:
        rule = why = "its ring extends beyond the image or has no contrast"
    elif code.clear < LEAST_CLEAR:
        rule = "its ring is not clear"
        why = (
            f"its ring is not clear: a segment differs from medium grey by {code.clear:.2f} of the"
            f" contrast, below {LEAST_CLEAR:g}"
        )
    elif wanted is None:
        rule = "another number in its ring"
        why = f"its ring says {code.number}; the name of the point has no number"
    elif code.number != wanted:
        rule = "another number in its ring"
        why = f"its ring says {code.number}, not {wanted}"
    else:
        return got, code
    return replace(got, rejected=why, rule=rule), code


def _shown(
    grey: NDArray[np.float32], uv: Array, cov: Array, got: MeasuredTarget
) -> tuple[Bytes, tuple[int, int]]:
    """Grey values about a prediction, stretched to eight bits, and where they begin."""
    half = SHOWN_SIGMAS * float(np.sqrt(np.diagonal(cov).max())) + 4.0
    if got.match is not None:
        reach = np.abs(got.match.uv - uv).max() + 12.0
        half = max(half, float(reach))
    half = float(np.clip(half + 14.0, *SHOWN_PX))
    low = np.maximum(np.floor(uv - half).astype(int), 0)
    high = np.minimum(np.ceil(uv + half).astype(int), grey.shape[::-1])
    cut = grey[low[1] : high[1], low[0] : high[0]]
    if not cut.size:
        return np.zeros((1, 1), dtype=np.uint8), (0, 0)
    dark, bright = np.percentile(cut, [0.5, 99.5])
    stretched = np.clip((cut - dark) / max(float(bright - dark), 1e-9), 0.0, 1.0) * 255.0
    return stretched.astype(np.uint8), (int(low[0]), int(low[1]))


def _held_together(inputs: TargetInputs, windows: list[Window]) -> Iterator[Window]:
    """Reject what other images of the same point contradict."""
    predictions = inputs.predictions
    rejected: dict[int, float] = {}
    for p in range(len(inputs.ground.points)):
        group = [pair for pair in accepted_windows(windows) if predictions.point[pair[0].row] == p]
        if len(group) < 3:
            continue
        matches = [match for _, match in group]
        rows = np.array([window.row for window, _ in group])
        B, P = predictions.by_point[rows], inputs.ground.cov[p]
        differences = np.array([match.uv for match in matches]) - predictions.uv[rows]
        cov = predictions.cov[rows] - B @ P @ B.transpose(0, 2, 1)
        cov = cov + np.array([match.cov for match in matches])
        size = disagreeing(differences, cov, B, P)
        rejected |= {row: float(s) for row, s in zip(rows, size, strict=True) if np.isfinite(s)}
    for window in windows:
        if window.row in rejected:
            why = (
                f"{rejected[window.row]:.1f} sigmas from what the other images say, above {LIMIT:g}"
            )
            rule = f"more than {LIMIT:g} sigmas from what the other images say"
            measurement = replace(window.measurement, rejected=why, rule=rule)
            window = replace(window, measurement=measurement)
        yield window
