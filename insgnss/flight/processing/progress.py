"""How a run says where it is: the name of each step, and the processor time that it took."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from ...base.errors import OptionError
from ...base.memory import give_back

Progress = Callable[[str], None]
"""Receives the name of each step as it begins."""


def quiet(_: str) -> None:
    """Take no notice of a step."""


@dataclass
class StepClock:
    """The processor time of each step of a run.

    Parameters
    ----------
    progress : Progress
        Receives the name of each step.
    seconds : dict of str to float
        Processor time by step, s; a step that comes again adds up.

    Raises
    ------
    UsageError
        Where `progress` is no function.
    """

    progress: Progress
    seconds: dict[str, float] = field(default_factory=dict)
    _step: str = ""
    _since: float = 0.0

    def __post_init__(self) -> None:
        if not callable(self.progress):
            problem = "must be a function that takes one text; leave progress out for no messages"
            raise OptionError("progress", problem, self.progress)

    def step(self, name: str) -> None:
        """End the step that runs and begin another one; "" begins none."""
        now = time.process_time()
        if self._step:
            self.seconds[self._step] = self.seconds.get(self._step, 0.0) + now - self._since
        self._step, self._since = name, now
        give_back()
        if name:
            self.progress(name)
