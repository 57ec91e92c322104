"""The files that are compared, written once."""

import pytest
from compared_files import Written, write_files


@pytest.fixture(scope="session")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_files(tmp_path_factory.mktemp("compared"))
