"""The two jobs of `insgnss targets`: predict and measure."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, UsageError
from ...base.files import atomic_write
from ...base.output.staging import together
from ...base.provenance import (
    made_from,
    paths_named_by,
    refuse_other_results,
    refuse_overwriting,
)
from ...base.wording import some
from ...flight.processing.progress import quiet
from ...report.document import Document, Section, write_json
from ...report.notebook import Documented
from ...report.verdict import worst_of
from .inputs import TargetInputs, inputs_of
from .photographs import Photographs, photographs_in
from .products import PREDICTIONS, write_measured, write_predictions, write_rejected
from .products import REJECTED_FILE as REJECTED_TABLE
from .request import TARGETS_DIRECTORY, TargetRequest
from .sheet import TARGETS_PAGE, sheet_sections
from .trials import advice
from .windows import Window, accepted_windows, windows_of

TARGETS_DOCUMENT = "targets.json"
ANOTHER = "another place by --out"  # for products that would overwrite an input
FEW_MEASURED = 0.2
"""Share of the targets below which it is likelier that files do not belong together than that the
others are covered: of a survey's targets four of five are there."""
OTHER_SIZE_SHARE = 0.02
"""Least difference of the targets from the size that was given that is told, of it."""
JUDGED = 5
"""Windows below which a share says nothing."""


@dataclass(frozen=True, eq=False)
class PredictionResult(Documented):
    """Where ground points are expected.

    Parameters
    ----------
    inputs : TargetInputs
        The flight, its ground points and their predictions.
    figures : dict
        What `--json` prints.
    files : tuple of Path
        What was written.
    """

    inputs: TargetInputs
    figures: dict[str, Any]
    files: tuple[Path, ...]

    def document(self) -> Document:
        """Return what was found, for the terminal."""
        return Document(
            "targets in images",
            self.figures["headline"],
            worst_of("this is where to expect them, before anything is measured"),
            (Section("Notes", self.figures["notes"]),),
            files=self.files,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return self.figures


@dataclass(frozen=True, eq=False)
class MeasurementResult(PredictionResult):
    """Targets measured in the photographs of a flight.

    Parameters
    ----------
    inputs, figures, files
        As `PredictionResult` has them.
    windows : tuple of Window
        Every predicted target in the photographs that are there.
    refusal : DataError or None
        Why nearly nothing was found; then no observations are written.
    """

    windows: tuple[Window, ...]
    refusal: DataError | None

    def document(self, sheet: Iterable[Section] = ()) -> Document:
        """Return what was found, for terminal and page; the page has the contact sheet.

        Parameters
        ----------
        sheet : iterable of Section
            The contact sheet.

        Returns
        -------
        Document
            With the reasons of rejections.
        """
        figures, refusal, request = self.figures, self.refusal, self.inputs.request
        reasons = [
            f"{count} rejected: {reason}" for reason, count in figures["rejected_by"].items()
        ]
        return Document(
            f"{request.ground.name}: targets in images",
            f"{figures['headline']}{': no observations are written' if refusal else ''}",
            worst_of("every target was measured", reasons, [str(refusal)] if refusal else []),
            (Section("Rejected", reasons), Section("Notes", figures["notes"]), *sheet),
            [request.eo, request.ground],
            files=self.files,
        )


LARGEST_SHARE = 0.2  # of a photograph that a target may fill


def predict_targets(
    request: TargetRequest,
    out: Path | None = None,
    progress: Callable[[str], None] = quiet,
    write: bool = True,
    *,
    force: bool = False,
) -> PredictionResult:
    """Predict the ground points of a flight in its images.

    Parameters
    ----------
    request : TargetRequest
        Files of the flight.
    out : Path, optional
        The table; by default predictions.csv in a directory beside the orientation.
    progress : callable
        Is called with the name of each step.
    write : bool
        Whether to write the table.
    force : bool
        Whether a file that is no such table is overwritten.

    Returns
    -------
    PredictionResult
        The result.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    DataError
        No ground point lies in any image.
    UsageError
        The table cannot be written, or would overwrite a file of others.
    """
    progress("reading exterior orientation, camera and ground points")
    inputs = inputs_of(request)
    predictions = inputs.predictions
    rows = np.flatnonzero(predictions.visible)
    ellipse = predictions.ellipse[rows]
    count = np.bincount(predictions.point[rows], minlength=len(inputs.ground.points))
    size = f"{np.median(ellipse[:, 0]):.1f} px (at most {ellipse[:, 0].max():.1f})"
    headline = (
        f"{int((count > 0).sum())} of {len(count)} {_noun(inputs)} lie in"
        f" {np.unique(predictions.image[rows]).size} of {len(inputs.eo.images)} images, {len(rows)}"
        f" times; larger semi-axis of their ellipses {size}"
    )
    figures: dict[str, Any] = {
        "headline": headline,
        "images": len(inputs.eo.images),
        "points": {
            name: int(n) for name, n in zip(inputs.ground.points, count.tolist(), strict=True)
        },
        "visible": len(rows),
        "median_semi_major_px": float(np.median(ellipse[:, 0])),
        "notes": [*inputs.notes, *_unseen_points(inputs, count)],
    }
    files: tuple[Path, ...] = ()
    if write:
        path = out or request.eo.parent / TARGETS_DIRECTORY / PREDICTIONS
        refuse_overwriting([path, path.with_suffix(".json")], _inputs_of(request), ANOTHER)
        progress(f"writing {path}")
        with together() as staging:
            table = staging.tree(path.parent) / path.name
            write_predictions(inputs, table)
            document = table.with_suffix(".json")
            figures |= made_from(paths_named_by(request), document, [table])
            write_json(document, figures)
            for new, goal in () if force else staging.changed():
                _refuse_foreign(new, goal)
        files = (path, path.with_suffix(".json"))
    return PredictionResult(inputs, figures, files)


def _refuse_foreign(new: Path, goal: Path) -> None:
    """Refuse to overwrite what has not the header of the table that takes its place."""
    with new.open("rb") as new_table, goal.open("rb") as old_table:
        if new_table.readline() != old_table.readline():
            raise UsageError(
                f"targets predict: {goal} exists and is no table of predictions; give another"
                " --out, or --force"
            )


def measure_targets(
    request: TargetRequest,
    out: Path | None = None,
    progress: Callable[[str], None] = quiet,
    write: bool = True,
    force: bool = False,
) -> MeasurementResult:
    """Measure the ground points of a flight in its photographs.

    Parameters
    ----------
    request : TargetRequest
        Files of the flight, its photographs and what the targets look like.
    out : Path, optional
        Directory of the products; by default a directory beside the orientation.
    progress : callable
        Is called with the name of each step.
    write : bool
        Whether to write the products.
    force : bool
        Whether results of another flight are overwritten.

    Returns
    -------
    MeasurementResult
        The result; where nearly nothing was found, with a refusal and without observations.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    DataError
        No ground point lies in any image that has a photograph.
    UsageError
        The products cannot be written, or no photographs are given.
    """
    if request.images is None:
        raise UsageError("targets measure: IMAGES is missing, the directory of the photographs")
    directory = out or request.eo.parent / TARGETS_DIRECTORY
    if write:
        input_files = (request.eo, request.ground)
        refuse_other_results(
            "targets measure", directory / TARGETS_DOCUMENT, input_files, force, True
        )
    _ = request.target.signal, request.target.code  # a target that cannot be, before all reading
    progress("reading exterior orientation, camera and ground points")
    inputs = inputs_of(request)
    _refuse_size(inputs)
    photographs = photographs_in(request.images, inputs.eo.images)
    windows = windows_of(inputs, photographs, progress)
    figures = _figures(inputs, photographs, windows)
    if not windows:
        raise DataError(
            f"no ground point lies in an image that has a photograph in {request.images}; add the"
            " photographs of the images that show ground points"
        )
    share = figures["measured"] / len(windows)
    few = share < FEW_MEASURED if len(windows) >= JUDGED else not share
    refusal = _refusal(figures, advice(inputs, photographs, progress)) if few else None
    result = MeasurementResult(inputs, figures, (), tuple(windows), refusal)
    if not write:
        return result
    progress(f"writing {directory}")
    return _written(result, photographs, directory)


def _unseen_points(inputs: TargetInputs, count: Any) -> list[str]:
    """Say which ground points lie in no image."""
    names = [name for name, n in zip(inputs.ground.points, count, strict=True) if not n]
    if not names:
        return []
    named = some(names, 5)
    return [f"{len(names)} of {len(count)} {_noun(inputs)} lie in no image: {named}"]


def _noun(inputs: TargetInputs) -> str:
    """What the points are called."""
    return "ground points" if inputs.vehicle is None else "places of the vehicle's target"


def _figures(
    inputs: TargetInputs, photographs: Photographs, windows: list[Window]
) -> dict[str, Any]:
    """Numbers of a measurement."""
    pred, good = inputs.predictions, accepted_windows(windows)
    sigma = [float(np.sqrt(np.trace(m.cov) / 2.0)) for _, m in good]
    diff = [m.uv - pred.uv[w.row] for w, m in good]
    count = np.zeros((len(inputs.ground.points), 2), dtype=int)
    for w in windows:
        count[pred.point[w.row]] += (1, int(w.measurement.accepted))
    rows = np.flatnonzero(pred.visible)
    without = sum(photographs.files[i] is None for i in np.unique(pred.image[rows]).tolist())
    notes = [
        *inputs.notes,
        *_unseen_points(inputs, np.bincount(pred.point[rows], minlength=len(count))),
    ]
    if without:
        notes.append(f"{without} images that show ground points have no photograph")
    if photographs.strangers:
        names = [path.name for path in photographs.strangers]
        named = some(names)
        notes.append(f"{len(names)} photographs have no pose in the orientation: {named}")
    notes += _size(inputs, windows)
    never = [
        name
        for name, (looked, measured) in zip(inputs.ground.points, count.tolist(), strict=True)
        if looked and not measured
    ]
    if never and good:
        named = some(never, 5)
        notes.append(
            f"{len(never)} of {len(count)} ground points were measured in no photograph: {named}"
        )
    headline = (
        f"{len(good)} of {len(windows)} targets measured, of"
        f" {int((count[:, 1] > 0).sum())} {_noun(inputs)} in"
        f" {len({int(pred.image[w.row]) for w, _ in good})} photographs"
    )
    if sigma:
        shift = float(np.sqrt(np.mean(np.square(diff))))
        headline += f"; sigma {np.median(sigma):.2f} px, {shift:.1f} px rms from their predictions"
    reasons = Counter(w.measurement.rule for w in windows if w.measurement.rejected)
    return {
        "headline": headline,
        "windows": len(windows),
        "measured": len(good),
        "rejected_by": dict(reasons.most_common()),
        "points": {
            name: {"windows": looked, "measured": measured}
            for name, (looked, measured) in zip(inputs.ground.points, count.tolist(), strict=True)
        },
        "median_sigma_px": float(np.median(sigma)) if sigma else None,
        "rms_from_prediction_px": float(np.sqrt(np.mean(np.square(diff)))) if diff else None,
        "signal": inputs.request.target.kind,
        "size_m": inputs.request.target.size_m,
        "notes": notes,
    }


def _refuse_size(inputs: TargetInputs) -> None:
    """Refuse targets that would fill the photograph: a size in centimetres, as a rule."""
    pred, size = inputs.predictions, inputs.request.target.size_m
    rows = np.flatnonzero(pred.visible)
    away = inputs.ground.position_m[pred.point[rows]] - inputs.eo.position_m[pred.image[rows]]
    width = size * inputs.camera.of("f") / float(np.median(np.linalg.norm(away, axis=1)))
    most = LARGEST_SHARE * min(inputs.camera.width, inputs.camera.height)
    if width > most:
        raise UsageError(
            f"targets: --size {size:g}: targets of {size:g} m are {width:.0f} px wide (limit"
            f" {most:.0f} px, a fifth of the image); give the size in metres"
        )


def _size(inputs: TargetInputs, windows: list[Window]) -> list[str]:
    """Say that targets have another size than was given."""
    areas = [abs(float(np.linalg.det(match.M))) for _, match in accepted_windows(windows)]
    if len(areas) < JUDGED:
        return []
    stated = inputs.request.target.size_m
    fitting = stated / float(np.median(np.sqrt(areas)))
    if abs(fitting / stated - 1.0) < OTHER_SIZE_SHARE:
        return []
    return [
        f"targets look {fitting / stated:.3f} times as large as --size {stated:g}: correct it to"
        f" {fitting:.4g} m, or the height of the images above the targets is wrong in the"
        " orientation"
    ]


def _refusal(figures: dict[str, Any], trial: str) -> DataError:
    """Why so few targets are no answer, with what finds them."""
    reasons = figures["rejected_by"]
    most = ", ".join(f"{count} with {reason}" for reason, count in list(reasons.items())[:2])
    guesses = (
        "If the targets can be seen there beside their ellipses, the orientation is worse than its"
        " covariances: --search-px. If they cannot, check size and kind of the targets (--signal,"
        " --size), the CRS of the ground points, and whether these are the photographs and the"
        " camera of this orientation"
    )
    return DataError(
        f"{figures['measured']} of {figures['windows']} targets found ({most}): nearly nothing is"
        " where it is expected, so no observations are written;"
        f" {trial or f'{TARGETS_PAGE} shows the windows. {guesses}'}"
    )


def _written(
    result: MeasurementResult, photographs: Photographs, directory: Path
) -> MeasurementResult:
    """Write the products, all of them or none; of a refusal the sheet and what was rejected."""
    inputs, windows, figures = result.inputs, result.windows, result.figures
    with together() as staging:
        into = staging.tree(directory)
        if result.refusal is None:
            figures["notes"] += write_measured(inputs, windows, into)
        write_rejected(inputs, windows, into / REJECTED_TABLE)
        atomic_write(into / TARGETS_PAGE, result.document(sheet_sections(inputs, windows)).html())
        image = np.unique(inputs.predictions.image[[w.row for w in windows]])
        looked = [photographs.files[k] for k in image.tolist()]
        used = (*paths_named_by(inputs.request), *(path for path in looked if path is not None))
        figures |= made_from(used, into / TARGETS_DOCUMENT, [*into.iterdir()])
        figures["products"] = sorted([*(p.name for p in into.iterdir()), TARGETS_DOCUMENT])
        write_json(into / TARGETS_DOCUMENT, figures)
        files = staging.goals()
        refuse_overwriting(files, _inputs_of(inputs.request), ANOTHER)
    return replace(result, files=files)


def _inputs_of(request: TargetRequest) -> tuple[Path | None, ...]:
    return request.eo, request.ground, request.camera, request.target.picture
