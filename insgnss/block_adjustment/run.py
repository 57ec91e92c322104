"""The whole job of `insgnss adjust`: read, adjust, judge, write."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..config.block_file import BlockFile
from .figures import figures_of
from .inputs import inputs_of
from .judgement import Judgement, judged
from .plausibility import refuse_implausible
from .products import written
from .solve import Solved, solved


@dataclass(frozen=True, eq=False)
class AdjustmentResult:
    """An adjusted block and what is said of it.

    Parameters
    ----------
    solved : Solved
        Values and covariances.
    figures : dict
        What adjust.json holds.
    judgement : Judgement
        Headline, findings, what was determined.
    files : tuple of Path
        The products.
    """

    solved: Solved
    figures: dict[str, Any]
    judgement: Judgement
    files: tuple[Path, ...]

    def summary(self) -> str:
        """Return the text for the terminal."""
        judgement = self.judgement
        lines = [judgement.headline]
        if judgement.contradicted:
            lines[0] = f"CONTRADICTION: {lines[0]}"
        first = next((f for f in judgement.findings if f.rank >= 1.0), None)
        lines += [f.sentence for f in judgement.findings if f is not first]
        verdict = "not determined"
        undetermined = [name for name, word, _ in judgement.determined if word == verdict]
        if undetermined:
            lines.append(f"not determined by this block: {', '.join(undetermined)}")
        lines += [f"note: {note}" for note in self.solved.inputs.notes]
        return "\n".join([*lines, *(f"wrote {file}" for file in self.files)])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return self.figures


def adjust(
    file: BlockFile,
    out: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
    write: bool = True,
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
        The products cannot be written.
    """
    inputs = inputs_of(file, progress)
    progress("looking whether the files belong to each other")
    refuse_implausible(inputs)
    done = solved(inputs, progress)
    figures = figures_of(done)
    judgement = judged(done, figures, progress)
    figures["headline"] = judgement.headline
    figures["verdict"] = "contradiction" if judgement.contradicted else "consistent"
    figures["findings"] = [
        {"topic": f.topic, "rank": f.rank, "text": f.text, "help": f.help}
        for f in judgement.findings
    ]
    figures["determined"] = [
        {"unknown": name, "verdict": verdict, "value": value}
        for name, verdict, value in judgement.determined
    ]
    files: tuple[Path, ...] = ()
    if write:
        directory = file.output.directory if out is None else Path(out)
        progress(f"writing {directory}")
        files = written(done, figures, judgement, directory)
    return AdjustmentResult(done, figures, judgement, files)
