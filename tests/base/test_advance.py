"""How far a step is, and how much time is left: what a person sees of long steps."""

import io
import math
import re
import threading
import time

import pytest

from insgnss.base.advance import converged_share, listening, share, through, within
from insgnss.cli.console import LONG_STEP_S, REPEATED_S, Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    """A clock that the test moves."""

    def __init__(self, monkeypatch):
        self.now = 100.0
        monkeypatch.setattr(time, "monotonic", lambda: self.now)
        monkeypatch.setenv("TERM", "xterm")


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


def _shown(terminal):
    return terminal.getvalue().split("\r\x1b[K")[-1].partition("] ")[2]


def test_a_loop_says_the_share_before_each_item():
    """Oracle: k of n by hand; nothing is said to who listens no longer."""
    heard = []
    with listening(heard.append):
        assert list(through("abcd")) == list("abcd")
    share(0.9)
    assert heard == [0.0, 0.25, 0.5, 0.75]


def test_a_part_scales_what_is_said_within():
    """Oracle: halves of the third quarter by hand; compiling has no scale."""
    heard = []
    with listening(heard.append), within(0.0, 0.5), within(0.5, 1.0):
        list(through("ab"))
        share(math.nan)
    with listening(heard.append):
        share(0.5)
    assert heard[:4] == [0.0, 0.25, 0.25, 0.375]
    assert math.isnan(heard[4])
    assert heard[5:] == [0.5]


def test_a_long_loop_of_quick_items_says_a_thousand_shares():
    """Oracle: a million items; the listener would cost more than they do."""
    heard = []
    with listening(heard.append):
        assert sum(1 for _ in through(range(1_000_000))) == 1_000_000
    assert 900 < len(heard) <= 1000


def test_another_thread_says_nothing_but_that_it_compiles():
    """Oracle: which thread says it; the main line may wait for a kernel of the other one."""
    heard = []

    def beside():
        with within(0.5, 1.0):
            share(0.5)
            share(math.nan)

    with listening(heard.append):
        thread = threading.Thread(target=beside)
        thread.start()
        thread.join()
    assert len(heard) == 1
    assert math.isnan(heard[0])


@pytest.mark.parametrize(
    ("step", "longest", "last", "done"), [(1e-2, 1.0, 1e-4, 0.5), (1e-5, 1.0, 1e-4, 1.0)]
)
def test_an_iteration_has_come_as_far_as_its_steps_have_fallen(step, longest, last, done):
    """Oracle: two of four orders of magnitude; no further than its end."""
    assert converged_share(step, longest, last) == pytest.approx(done)
    assert converged_share(last, last, last) == 1.0


def test_the_line_is_no_longer_than_the_terminal(clock, monkeypatch):
    """Oracle: 40 columns; a line that wraps is not taken away by a carriage return."""
    monkeypatch.setenv("COLUMNS", "40")
    terminal = Terminal()
    Progress(terminal, None)("x" * 100)
    assert len(terminal.getvalue().removeprefix("\r\x1b[K")) == 39


def test_time_left_is_that_of_a_constant_speed(clock):
    """Oracle: 30 % in 12 s leave 28 s."""
    terminal = Terminal()
    progress = Progress(terminal, None)
    progress("filter")
    clock.now += 12.0
    progress.share(0.3)
    assert _shown(terminal) == "filter: 30 %, 28 s left"


@pytest.mark.parametrize(
    ("left", "words"), [(0.4, "0 s"), (99.0, "99 s"), (150.0, "2 min"), (9000.0, "2.5 h")]
)
def test_time_left_is_in_a_unit_that_one_reads(left, words, clock):
    """Oracle: the same time by hand."""
    terminal = Terminal()
    progress = Progress(terminal, None)
    progress("filter")
    clock.now += 10.0
    progress.share(10.0 / (10.0 + left))
    assert _shown(terminal).endswith(f", {words} left")


def test_a_step_that_ends_soon_says_nothing_of_itself(clock):
    """Oracle: half of it in 2 s are 4 s, under the bar of five; its name stays."""
    assert LONG_STEP_S == 5.0
    terminal = Terminal()
    progress = Progress(terminal, None)
    progress("filter")
    clock.now += 2.0
    progress.share(0.5)
    assert _shown(terminal) == "filter"


def test_what_was_compiled_says_nothing_of_the_speed(clock):
    """Oracle: 80 s of compiling, then a tenth in 2 s: 16 s for the eight tenths that are left."""
    terminal = Terminal()
    progress = Progress(terminal, None)
    progress("filter")
    progress.share(0.0)
    progress.share(math.nan)
    assert "compiling" in _shown(terminal)
    clock.now += 80.0
    progress.share(0.1)
    clock.now += 2.0
    progress.share(0.2)
    assert _shown(terminal) == "filter: 20 %, 16 s left"


def test_a_log_gets_a_line_now_and_then(clock):
    """Oracle: a line every REPEATED_S, and one a step about what is compiled."""
    lines = io.StringIO()
    progress = Progress(io.StringIO(), lines)
    progress("filter")
    for _ in range(5):
        progress.share(math.nan)
    for tenth in range(10):
        progress.share(tenth / 10)
        clock.now += 0.5 * REPEATED_S
    texts = re.findall(r"] (.*)", lines.getvalue())
    assert texts[1].startswith("filter: compiling")
    assert [text.split(" %")[0] for text in texts[2:]] == [f"filter: {n}" for n in (20, 40, 60, 80)]
    progress("smoother")
    progress.share(math.nan)
    first = lines.getvalue()
    for seconds in (0.9, 0.2):
        clock.now += seconds * REPEATED_S
        progress.share(math.nan)
    assert (
        lines.getvalue()
        .removeprefix(first)
        .endswith(" smoother: compiling, once after an installation (8)\n")
    )
    assert lines.getvalue().count("\n") == first.count("\n") + 1
    assert first.endswith("smoother: compiling, once after an installation\n")


def test_a_quiet_run_says_nothing_of_its_steps(clock):
    """Oracle: both streams, empty."""
    terminal, lines = Terminal(), io.StringIO()
    progress = Progress(terminal, lines, quiet=True)
    progress("filter")
    clock.now += 100.0
    progress.share(math.nan)
    progress.share(0.1)
    clock.now += 100.0
    progress.share(0.2)
    assert terminal.getvalue() == lines.getvalue() == ""


def test_a_function_that_is_compiled_is_told_of(tmp_path, monkeypatch):
    """Oracle: numba compiles a new function when it is first called, and never again."""
    from insgnss.base.compilation import njit

    double = njit()(lambda x: 2.0 * x)
    heard = []
    with listening(heard.append):
        assert double(1.5) == 3.0
        count = len(heard)
        double(2.5)
    assert count >= 1
    assert len(heard) == count
    assert all(math.isnan(value) for value in heard)
