"""Programs that results are held against, from the extra `oracles`; tests of one that is not
installed are skipped.
"""

from typing import Any

import pytest


def oracle(name: str) -> Any:
    """The module `name`; where it is not installed the test is skipped with a line that says how to
    have it.
    """
    return pytest.importorskip(name, reason=f"{name} is not installed: pip install '.[oracles]'")
