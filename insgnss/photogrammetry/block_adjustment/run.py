"""The whole job of `insgnss adjust`: read, adjust, judge, write."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.errors import DataError
from ...base.findings import Finding
from ...base.provenance import refuse_other_results
from ...base.received.outputs import refuse_outside
from ...base.received.trusted import at_home
from ...flight.config.block_file import OBSERVATION_GROUPS, BlockFile
from ...flight.config.flight_file import Flight
from ...flight.processing.pipeline import ProcessResult
from ...report.notebook import Shown
from .figures import figures_of
from .inputs import BlockInputs, inputs_of
from .judgement import CHECK_POINTS, Judgement, accepted_as, judge_block
from .page import document_of
from .plausibility import refuse_implausible, worse_than_stated
from .products import ADJUST_DOCUMENT, CONTRADICTED, write_products
from .solve import AdjustedBlock, solve_block
from .trajectory import TRAJECTORY_DIRECTORY as TRAJECTORY
from .trajectory import corrected_trajectory, refuse_unfit
from .trials import converging

ORIENTATION = "eo.json"


@dataclass(frozen=True, eq=False)
class AdjustmentResult(Shown):
    """An adjusted block and what is said of it.

    Parameters
    ----------
    solved : AdjustedBlock
        Values and covariances.
    figures : dict
        What adjust.json holds.
    judgement : Judgement
        Headline, findings, what was determined.
    files : tuple of Path
        The products.
    trajectory : ProcessResult or None
        The flight after the images, where it was asked for.
    uncorrected : Finding or None
        The contradiction for which the images corrected no flight.
    """

    solved: AdjustedBlock
    figures: dict[str, Any]
    judgement: Judgement
    files: tuple[Path, ...]
    trajectory: ProcessResult | None = None
    uncorrected: Finding | None = None

    @property
    def refusal(self) -> DataError | None:
        """Why no orientation or no trajectory was written; None where they were."""
        if not (refused := self.judgement.refused):
            if (finding := self.uncorrected) is None:
                return None
            return DataError(
                f"{finding.sentence}; the orientation is written, the trajectory is not; to"
                f' write both, set adjustment.accept = ["{accepted_as(finding.name)}"] in the'
                " block file"
            )
        if self.solved.inputs.file.adjustment.write_anyway:
            problem = f"{refused[0].sentence}; the orientation in {CONTRADICTED}/ has it"
            return DataError(f"{problem}{self._of_earlier_run()}")
        names = ", ".join(dict.fromkeys(f'"{accepted_as(finding.name)}"' for finding in refused))
        return DataError(
            f"{refused[0].sentence}; no orientation is written, adjust.html shows the residuals;"
            f" --write-anyway writes it into {CONTRADICTED}/, adjustment.accept = [{names}] in the"
            f" block file overrules{self._of_earlier_run()}"
        )

    def _of_earlier_run(self) -> str:
        """Say that an orientation lies beside the products of a refused run; empty where none."""
        directories = {path.parent for path in self.files if path.name == ADJUST_DOCUMENT}
        if not any((directory / ORIENTATION).exists() for directory in directories):
            return ""
        return f"; the {ORIENTATION} that lies there is of an earlier run"

    def summary(self) -> str:
        """Return the text for the terminal."""
        return document_of(self.solved, self.figures, self.judgement, files=self.files).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return self.figures


@at_home
def adjust(
    file: BlockFile,
    out: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
    write: bool = True,
    force: bool = False,
    flight: Flight | None = None,
) -> AdjustmentResult:
    """Adjust the block of a block file.

    Parameters
    ----------
    file : BlockFile
        The block file.
    out : Path, optional
        Directory of the products; by default as the block file says.
    progress : callable
        Is called with the name of each step.
    write : bool
        Whether to write the products.
    force : bool
        Whether results of other image observations are overwritten.
    flight : Flight, optional
        The flight file of the orientation, whose trajectory the images are to correct; those of a
        block that contradicts itself correct none.

    Returns
    -------
    AdjustmentResult
        The result.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    DataError
        Files contradict each other, or the observations do not determine the unknowns.
    UsageError
        The products cannot be written, or would overwrite those of other image observations.
    """
    directory = directory_of(file, out) if write else file.output.directory
    observed = [path for path in (file.images.file,) if path is not None]
    if write:
        refuse_other_results("adjust", directory / ADJUST_DOCUMENT, observed, force)
    inputs = inputs_of(file, progress)
    if flight is not None:
        refuse_unfit(inputs, flight)
    progress("looking whether the files belong to each other")
    refuse_implausible(inputs)
    try:
        done = solve_block(inputs, progress)
    except DataError as failure:
        raise _explain_failure(failure, inputs, progress) from None
    figures = figures_of(done)
    judgement = judge_block(done, figures, progress)
    figures["headline"] = judgement.headline
    figures["verdict"] = "contradiction" if judgement.contradicted else "consistent"
    figures["findings"] = [f.limit for f in judgement.findings]
    figures["determined"] = [
        {"unknown": name, "verdict": verdict, "value": value}
        for name, verdict, value in judgement.determined
    ]
    files: tuple[Path, ...] = ()
    trajectory, contradiction = None, _not_accepted(file, judgement)
    if flight is not None and contradiction is None:
        into = directory / TRAJECTORY if write else None
        trajectory, change = corrected_trajectory(done, flight, into, progress, force)
        figures["notes"].append(change)
        files = trajectory.files
    if write:
        progress(f"writing {directory}")
        files = (*write_products(done, figures, judgement, directory), *files)
    uncorrected = None if flight is None else contradiction
    return AdjustmentResult(done, figures, judgement, files, trajectory, uncorrected)


def _not_accepted(file: BlockFile, judgement: Judgement) -> Finding | None:
    """Return the worst contradiction that the block file does not accept."""
    judged_names = {*OBSERVATION_GROUPS, CHECK_POINTS} - {*file.adjustment.accept}
    wrong = (f for f in judgement.findings if f.rank >= 1.0 and accepted_as(f.name) in judged_names)
    return next(wrong, None)


def directory_of(file: BlockFile, out: Path | None) -> Path:
    """Return the directory of the products.

    Parameters
    ----------
    file : BlockFile
        The block file.
    out : Path or None
        The directory in place of the block file's.

    Raises
    ------
    InputError
        The block file names one outside of its own directory.
    """
    if out is not None:
        return Path(out)
    refuse_outside(file.path, "output.directory", [file.output.directory])
    return file.output.directory


def _explain_failure(
    failure: DataError, inputs: BlockInputs, progress: Callable[[str], None]
) -> DataError:
    """Return a failure with what makes the adjustment converge, where something does."""
    try:
        refuse_implausible(inputs, failed=True)
    except DataError as named:
        return named
    if inputs.eo is None or (trial := converging(inputs, progress)) is None:
        return DataError(f"{failure}{worse_than_stated(inputs)}")
    where = (
        "" if inputs.file.aerial_control.positions_alone else ", or correct it in the flight file"
    )
    return DataError(
        "the adjustment does not converge with the settings of the block file; it converges"
        f" with {trial.name} estimated, {trial.shown}: {trial.remedy}{where}"
    )
