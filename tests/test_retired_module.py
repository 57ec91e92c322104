"""A module under the name that it had before."""

import importlib
import sys

import pytest


def test_the_old_name_of_the_pipeline_works_and_warns(monkeypatch):
    """Oracle: the function itself, and the name that the warning gives."""
    from insgnss.processing.pipeline import process

    monkeypatch.delitem(sys.modules, "insgnss.pipeline", raising=False)
    with pytest.warns(FutureWarning, match="insgnss.processing.pipeline now"):
        old = importlib.import_module("insgnss.pipeline")
    assert old.process is process
