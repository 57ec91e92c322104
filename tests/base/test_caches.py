"""Where compiled kernels and fonts are kept, in processes of their own. No test needs another user:
what cannot be made is below a file.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import insgnss

pytestmark = pytest.mark.skipif(
    os.name == "nt", reason="there each user has a directory of his own"
)

PLACE = "import os, insgnss; print(os.environ.get('NUMBA_CACHE_DIR', ''))"
FONTS = "import insgnss, matplotlib; print(matplotlib.get_configdir())"
KERNEL = "import insgnss.io.formats.text._kernels as k, numba; print(numba.config.CACHE_DIR)"
UNSET = {"NUMBA_CACHE_DIR", "MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "HOME"}


@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    """An installation in which no __pycache__ can be made: files stand in the way."""
    root = tmp_path_factory.mktemp("installation")
    shutil.copytree(
        Path(insgnss.__file__).parent,
        root / "insgnss",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    for room in {file.parent for file in root.rglob("*.py")}:
        (room / "__pycache__").touch()
    return root


def _python(installation, *words, **variables):
    kept = {key: value for key, value in os.environ.items() if key not in UNSET}
    environment = (
        kept
        | {"PYTHONPATH": str(installation), "PYTHONDONTWRITEBYTECODE": "1"}
        | {k: str(v) for k, v in variables.items()}
    )
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        env=environment,
        timeout=120,
        check=False,
        cwd=installation,
    )


@pytest.mark.slow
@pytest.mark.parametrize("before", ["", "import numba; "])
def test_without_any_place_kernels_go_to_a_directory_of_the_user(locked, tmp_path, before):
    """Oracle: numba itself, which defines no kernel without a place; owner and mode of the
    directory.
    """
    done = _python(
        locked, "-c", before + KERNEL, HOME=locked / "insgnss/__main__.py/none", TMPDIR=tmp_path
    )
    assert done.returncode == 0, done.stderr
    place = Path(done.stdout.strip())
    assert place == tmp_path / f"insgnss-{os.getuid()}"
    assert place.stat().st_mode & 0o777 == 0o700
    assert place.stat().st_uid == os.getuid()


def test_without_our_directory_numba_refuses(locked, tmp_path):
    """Oracle: the error that a stranger saw; if numba no longer raises it, the module is not
    needed.
    """
    plain = (
        "import sys; sys.modules['insgnss.base.caches'] = type('none', (), {'settle':"
        " staticmethod(str)}); " + KERNEL
    )
    done = _python(locked, "-c", plain, HOME=locked / "insgnss/__main__.py/none", TMPDIR=tmp_path)
    assert "no locator available" in done.stderr


def test_a_directory_that_others_made_or_may_write_is_not_used(locked, tmp_path):
    """Oracle: the other directory, still empty; ours is gone with the process."""
    (tmp_path / f"insgnss-{os.getuid()}").mkdir()
    (tmp_path / f"insgnss-{os.getuid()}").chmod(0o777)
    done = _python(locked, "-c", KERNEL, HOME=locked / "insgnss/__main__.py/none", TMPDIR=tmp_path)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).parent == tmp_path
    assert [(d.name, list(d.iterdir())) for d in tmp_path.iterdir()] == [
        (f"insgnss-{os.getuid()}", [])
    ]


def test_where_numba_has_a_place_nothing_is_set(locked, tmp_path):
    """Oracle: the three places of numba's documentation; the temporary directory stays empty."""
    temporary, none = tmp_path / "tmp", locked / "insgnss/__main__.py/none"
    temporary.mkdir()
    assert _python(locked, "-c", PLACE, HOME=tmp_path / "home", TMPDIR=temporary).stdout == "\n"
    assert (
        _python(
            locked, "-c", PLACE, HOME=none, XDG_CACHE_HOME=tmp_path / "cache", TMPDIR=temporary
        ).stdout
        == "\n"
    )
    open_one = Path(insgnss.__file__).parents[1]
    if os.access(open_one, os.W_OK):
        assert _python(open_one, "-c", PLACE, HOME=none, TMPDIR=temporary).stdout == "\n"
    own = tmp_path / "own"
    assert (
        _python(locked, "-c", PLACE, HOME=none, NUMBA_CACHE_DIR=own, TMPDIR=temporary).stdout
        == f"{own}\n"
    )
    assert [list(place.iterdir()) for place in temporary.iterdir()] == [[]]  # for fonts


def test_matplotlib_gets_a_place_without_a_line(locked, tmp_path):
    """Oracle: matplotlib's own function; it says on standard error where it makes itself a place
    for one run.
    """
    done = _python(locked, "-c", FONTS, HOME=locked / "insgnss/__main__.py/none", TMPDIR=tmp_path)
    assert (done.stdout, done.stderr) == (
        f"{tmp_path / f'insgnss-{os.getuid()}' / 'matplotlib'}\n",
        "",
    )
    done = _python(
        locked,
        "-c",
        FONTS,
        HOME=locked / "insgnss/__main__.py/none",
        TMPDIR=tmp_path,
        MPLCONFIGDIR=tmp_path / "own",
    )
    assert done.stdout == f"{tmp_path / 'own'}\n"


@pytest.mark.slow
def test_the_command_says_so_in_one_line_and_help_does_not(locked, tmp_path):
    """Oracle: standard error and exit code."""
    nowhere = {"HOME": locked / "insgnss/__main__.py/none", "TMPDIR": tmp_path}
    assert _python(locked, "-m", "insgnss", "--help", **nowhere).stderr == ""
    (tmp_path / "imu.csv").write_text(
        "tow,gx,gy,gz,ax,ay,az\n"
        + "".join(f"{100 + k / 100:.2f},0,0,0,0,0,-9.81\n" for k in range(3000))
    )
    done = _python(locked, "-m", "insgnss", "inspect", str(tmp_path / "imu.csv"), "-q", **nowhere)
    (line,) = (line for line in done.stderr.splitlines() if "warning" in line)
    assert (
        f"compiled functions are kept in {tmp_path / f'insgnss-{os.getuid()}'}; set NUMBA_CACHE_DIR"
        in line
    )
    assert "internal error" not in done.stderr
    assert "imu.csv" in done.stdout
