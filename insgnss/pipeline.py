"""`insgnss.processing.pipeline` under the name that it had before: scripts written for it go on
working.
"""

from .processing.pipeline import ProcessResult, process

__all__ = ["ProcessResult", "process"]
