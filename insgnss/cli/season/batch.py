"""The verb `batch`: the flights of a season."""

import argparse
from typing import TYPE_CHECKING

from ...base.errors import InsgnssError
from ...base.wording import duration
from ...batch.season.request import SeasonRequest
from ..console import Progress
from ..verb import Judged, Result, Verb

if TYPE_CHECKING:
    from ...batch.season.work import Outcome

EXAMPLE = """  insgnss batch season
  insgnss batch "season/*/flight.toml" --workers 4 --parquet
  insgnss batch flights.csv --out overview
  insgnss batch season --scheduler tcp://10.0.0.5:8786"""
SELDOM_S = 20.0  # time between lines of progress without a terminal (s): logs stay short


def run(options: argparse.Namespace, progress: Progress) -> Result | Judged:
    """Do what the parsed command line asks for."""
    from ...batch.season.run import line_of, run_season

    request = options.records[SeasonRequest]
    lines = _ProgressLines(progress, silent=options.json)
    result = run_season(request, lambda outcome: lines.show(outcome, line_of(outcome)), lines.tick)
    if not result.exit_code:
        return result
    count = sum(outcome.exit_code != 0 for outcome in result.outcomes)
    where = next(file for file in result.files if file.suffix == ".html")
    failure = InsgnssError(
        f"{count} of {len(result.outcomes)} flights failed; the reasons are in {where}"
    )
    failure.exit_code = result.exit_code
    return Judged(result, failure)


class _ProgressLines:
    """Lines of flights on standard output, progress and time left on standard error.

    Time is left for the flights that are not done at the pace of those that were processed: those
    that were kept took no time.
    """

    def __init__(self, progress: Progress, silent: bool) -> None:
        self._progress, self._silent = progress, silent
        self._last = 0.0

    def show(self, outcome: "Outcome", line: str) -> None:
        """Print the line of a flight."""
        self._progress.clear()
        if self._silent:
            return
        print(line, flush=True)
        for note in outcome.notes:
            print(f"  {outcome.name}: warning: {note}", flush=True)

    def tick(self, worked: int, done: int, count: int, seconds: float) -> None:
        """Say how far it is; seldom where no line renews itself."""
        if not self._progress.renews and seconds - self._last < SELDOM_S:
            return
        self._last = seconds
        remaining = f", some {duration((count - done) * seconds / worked)} left" if worked else ""
        self._progress(f"{done} of {count} flights{remaining}")


VERB = Verb("batch", EXAMPLE, (SeasonRequest,), run)
