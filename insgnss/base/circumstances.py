"""When, where and by which command a run was made, for its page."""

import os
import platform
import sys
from datetime import UTC, datetime
from pathlib import Path

from .wording import command_line


def circumstances() -> dict[str, str]:
    """Return date, operating system, machine and command of this run, as text by name."""
    name = Path(sys.argv[0]).name
    command = ["insgnss" if name == "__main__.py" else name or "python", *sys.argv[1:]]
    return {
        "date (UTC)": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S"),
        "operating system": platform.platform(),
        "machine": f"{platform.machine()}, {os.cpu_count() or 1} processors",
        "command": command_line(command),
    }
