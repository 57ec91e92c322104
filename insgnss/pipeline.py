"""`insgnss.processing.pipeline` under the name that it had before 0.2.0, for one release."""

import warnings

from .processing.pipeline import ProcessResult, process

__all__ = ["ProcessResult", "process"]

warnings.warn(
    "insgnss.pipeline is called insgnss.processing.pipeline now, and insgnss.process serves most;"
    " the next release will not have the old name",
    FutureWarning,
    stacklevel=2,
)
