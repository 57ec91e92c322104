"""Put compiled kernels into a wheel, so that the first run on another machine compiles nothing.

    python scripts/platform_wheel.py dist/insgnss-*-none-any.whl --out dist

They are compiled by the Python, numba and numpy that run this script, for the processor that
`insgnss.base.shipped` names for this machine; the wheel is tagged with that Python and
this platform. `pip install wheel` before.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import llvmlite

from insgnss.base.shipped import NUMBA_VARIABLES, PROCESSORS


def platform_tag() -> str:
    """Return the platform that the machine code runs on; it calls no library of the system."""
    system, machine = platform.system(), platform.machine()
    if system == "Linux":
        return f"manylinux_2_17_{machine}"  # the oldest that numba has wheels for
    if system == "Darwin":
        return "macosx_11_0_arm64" if machine == "arm64" else f"macosx_10_15_{machine}"
    raise SystemExit(f"no kernels are shipped for {system}: users compile them at the first run")


def run(*command: str, **variables: str) -> None:
    """Run Python with arguments."""
    subprocess.run([sys.executable, *command], check=True, env=os.environ | variables)


def compile_kernels(root: Path) -> None:
    """Compile the kernels of an unpacked wheel beside their sources."""
    name, features = PROCESSORS[platform.machine()]
    own = {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": ""}
    own |= dict(zip(NUMBA_VARIABLES, (name, ""), strict=True))
    run("-P", "-m", "insgnss", "doctor", "--compile", **own)
    for lock in root.rglob("compiling.lock"):
        lock.unlink()
    described = {"name": name, "features": features, "llvmlite": llvmlite.__version__}
    (root / "insgnss/base/processor.json").write_text(json.dumps(described) + "\n")
    print(f"{len(list(root.rglob('*.nbc')))} kernels for {name}")


def main() -> None:
    """Unpack the wheel, compile, pack it with its tag."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--out", type=Path, default=Path("dist"))
    arguments = parser.parse_args()
    tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
    with tempfile.TemporaryDirectory() as scratch:
        tags = "--python-tag", tag, "--abi-tag", "none", "--platform-tag", platform_tag()
        run("-m", "wheel", "unpack", str(arguments.wheel.resolve()), "--dest", scratch)
        (root,) = Path(scratch).iterdir()
        compile_kernels(root)
        run("-m", "wheel", "pack", str(root), "--dest-dir", scratch)
        (packed,) = Path(scratch).glob("*.whl")
        run("-m", "wheel", "tags", "--remove", *tags, str(packed))
        (tagged,) = Path(scratch).glob("*.whl")
        arguments.out.mkdir(parents=True, exist_ok=True)
        print(tagged.rename(arguments.out / tagged.name))


if __name__ == "__main__":
    main()
