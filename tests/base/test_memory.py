"""How much memory a process may still take, from files as Linux writes them."""

import subprocess
import sys
from pathlib import Path

import pytest

from insgnss.base import memory
from insgnss.base.memory import available, give_back, keep_freed, kills

MEMINFO = "MemTotal: 16000000 kB\nMemAvailable: 8000000 kB\nSwapTotal: 1000 kB\nSwapFree: 500 kB\n"
FREE = 8_000_500 * 1024


@pytest.fixture
def system(tmp_path: Path) -> tuple[Path, Path]:
    """A machine with 8 GB left."""
    proc, groups = tmp_path / "proc", tmp_path / "cgroup"
    (proc / "self").mkdir(parents=True)
    groups.mkdir()
    (proc / "meminfo").write_text(MEMINFO)
    return proc, groups


def write(folder: Path, **files: object) -> None:
    """Files of a control group."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name.replace("__", ".")).write_text(f"{content}\n")


def test_the_machine_has_what_it_says(system: tuple[Path, Path]) -> None:
    """Oracle: kB of meminfo, with the free swap; nothing known, nothing said."""
    assert available(*system) == FREE
    (system[0] / "meminfo").write_text("MemTotal: 16000000 kB\n")
    assert available(*system) is None
    assert available(system[0] / "absent", system[1]) is None


def test_a_container_has_what_its_group_leaves(system: tuple[Path, Path]) -> None:
    """Oracle: version 2 of control groups: limit less use, of which cached files can be dropped;
    a limit above it counts as well, and "max" is none.
    """
    proc, groups = system
    (proc / "self" / "cgroup").write_text("0::/job/step\n")
    stat = "anon 5\ninactive_file 300"
    write(groups / "job/step", memory__max=2000, memory__current=900, memory__stat=stat)
    assert available(proc, groups) == 1400
    write(groups / "job", memory__max=1500, memory__current=1000, memory__stat="inactive_file 0")
    assert available(proc, groups) == 500
    write(groups / "job", memory__max="max")
    assert available(proc, groups) == 1400
    write(groups / "job/step", memory__current=9000)
    assert available(proc, groups) == 0


def test_a_group_of_the_first_version_is_read(system: tuple[Path, Path]) -> None:
    """Oracle: its names of the same; a limit of nearly 2^63 is none."""
    proc, groups = system
    (proc / "self" / "cgroup").write_text("12:cpu:/a\n4:hugetlb,memory:/a\n")
    own = groups / "memory/a"
    write(own, memory__limit_in_bytes=7000, memory__usage_in_bytes=4000)
    write(own, memory__stat="total_inactive_file 50")
    assert available(proc, groups) == 3050
    write(own, memory__limit_in_bytes=9223372036854771712)
    assert available(proc, groups) == FREE


def test_the_limit_of_a_process_counts(
    system: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: RLIMIT_AS less what is mapped."""
    resource = pytest.importorskip("resource")
    proc, groups = system
    (proc / "self" / "status").write_text("VmSize: 1000 kB\nVmData: 10 kB\n")

    def limit(which: int) -> tuple[int, int]:
        most = 3_000_000 if which == resource.RLIMIT_AS else resource.RLIM_INFINITY
        return most, most

    monkeypatch.setattr(resource, "getrlimit", limit)
    assert available(proc, groups) == 3_000_000 - 1_024_000


def test_memory_is_given_back_or_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without glibc there is no such function."""
    give_back()
    monkeypatch.setattr(memory, "_glibc_function", lambda name: None)
    give_back()
    keep_freed()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="glibc")
def test_freed_arrays_are_taken_again() -> None:
    """Oracle: the pages that the kernel clears for arrays that are freed and made again."""
    faults = []
    for setting in ("pass", "keep_freed()"):
        code = (
            "import resource; from insgnss.base.memory import keep_freed;"
            f" {setting}; count = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt;"
            " make = lambda: [b'x' * (k + (16 << 20)) for k in range(3)] and None; make();"
            " first = count(); [make() for _ in range(5)]; print(count() - first)"
        )
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        faults.append(int(run.stdout))
    assert faults[1] < 0.1 * faults[0]


def test_what_the_kernel_ended_is_counted(system: tuple[Path, Path]) -> None:
    """Oracle: its files: the own group's count goes before the machine's."""
    proc, groups = system
    assert kills(proc, groups) == 0
    (proc / "vmstat").write_text("pgfault 5\noom_kill 7\n")
    assert kills(proc, groups) == 7
    (proc / "self" / "cgroup").write_text("4:memory:/a\n0::/b\n")
    write(groups / "memory/a", memory__oom_control="oom_kill_disable 0\noom_kill 2")
    assert kills(proc, groups) == 2
    write(groups / "b", memory__events="oom 4\noom_kill 3")
    assert kills(proc, groups) == 3
