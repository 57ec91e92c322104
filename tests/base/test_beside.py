"""Work beside the main line."""

import threading

import pytest

from insgnss.base import beside
from insgnss.base.beside import Beside
from insgnss.base.errors import DataError


@pytest.fixture(params=[1, 2])
def processors(request, monkeypatch):
    """A machine of so many processors."""
    monkeypatch.setattr(beside, "processors", lambda: request.param)
    return request.param


def test_a_job_is_done_once_and_in_a_thread_only_where_that_gains(processors):
    """Oracle: the thread that the job ran in, and how often it ran."""
    ran = []

    def job():
        ran.append(threading.current_thread() is threading.main_thread())
        return 7

    work = Beside(job)
    assert (work.result(), work.result()) == (7, 7)
    assert ran == [processors == 1]


def test_what_a_job_raises_is_raised_where_its_result_is_asked_for(processors):
    """Oracle: the error itself, whose line and exit code the command line shows."""
    error = DataError("the filter diverged")

    def job():
        raise error

    work = Beside(job)
    for _ in range(2):
        with pytest.raises(DataError) as caught:
            work.result()
        assert caught.value is error
