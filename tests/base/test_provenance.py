"""Results of other measurements are not overwritten: what is known of them, and the verbs."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from insgnss.base.errors import UsageError
from insgnss.base.inputs import sha256
from insgnss.base.output.staging import together
from insgnss.base.provenance import (
    DIGESTS_KEY,
    DIRECTORY_KEY,
    INPUTS_KEY,
    hashes_of,
    made_from,
    other_results,
    paths_named_by,
    refuse_other_results,
)


def results(root: Path, **files: str) -> Path:
    """A document of results that were made from files of this content."""
    for name, text in files.items():
        (root / f"{name}.csv").write_text(text)
    inputs = [root / f"{name}.csv" for name in files]
    (root / "report.json").write_text(json.dumps({INPUTS_KEY: hashes_of(inputs, root)}))
    return root / "report.json"


def test_results_of_the_same_measurements_are_not_in_the_way(tmp_path: Path) -> None:
    """Oracle: hashes of the same bytes under another name, and files that are settings."""
    document = results(tmp_path, imu="a", gnss="b", settings="c")
    (tmp_path / "moved.csv").write_text("a")
    assert other_results(document, [tmp_path / "moved.csv", tmp_path / "gnss.csv"]) is None
    (tmp_path / "settings.csv").write_text("changed")
    assert other_results(document, [tmp_path / "imu.csv", tmp_path / "gnss.csv"]) is None
    assert other_results(tmp_path / "none.json", [tmp_path / "imu.csv"]) is None


def test_results_of_others_are_refused(tmp_path: Path) -> None:
    """Oracle: a file that changed, of the same size and name; --force; one of two is enough."""
    document = results(tmp_path, imu="a", gnss="b")
    files = [tmp_path / "imu.csv", tmp_path / "gnss.csv"]
    before = sha256(files[1])
    files[1].write_text("B")
    assert sha256(files[1]) != before  # kept by what the system says of a file, not by its name
    with pytest.raises(UsageError, match=r"process: .*report\.json was not made from gnss\.csv"):
        refuse_other_results("process", document, files)
    refuse_other_results("process", document, files, force=True)
    assert other_results(document, files, one_is_enough=True) is None
    files[0].write_text("A")
    assert "was not made from imu.csv" in str(other_results(document, files, one_is_enough=True))


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"inputs_sha256": 3}', "\xff"])
def test_a_document_that_does_not_say_is_refused(tmp_path: Path, text: str) -> None:
    """Oracle: what is no document of results."""
    (tmp_path / "report.json").write_text(text, encoding="latin-1")
    reason = other_results(tmp_path / "report.json", [])
    assert reason is not None
    assert reason.endswith("does not state from which measurements it was made")


def test_what_is_made_is_told_by_paths_and_hashes_before_it_is_moved(tmp_path: Path) -> None:
    """Oracle: hashes of the files in their places afterwards; paths from the document, inputs from
    a directory of their own where one is given; whatever is no file is left out.
    """
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "imu.csv").write_text("a")
    inputs = [tmp_path / "in" / "imu.csv", tmp_path / "in", tmp_path / "none.csv"]
    out, alone = tmp_path / "out", tmp_path / "beside.txt"
    with together() as staging:
        into = staging.tree(out)
        (into / "new").mkdir()
        (into / "new" / "eo.json").write_text("b")
        staging.file(alone).write_text("c")
        made = made_from(inputs, into / "run.json", [into / "new" / "eo.json", alone])
        assert made_from(inputs, out / "run.json", staging.goals()) == made
        moved = made_from(inputs, into / "run.json", [], tmp_path / "in")
    assert made[INPUTS_KEY] == {"../in/imu.csv": sha256(inputs[0])}
    assert made[DIGESTS_KEY] == {
        "../beside.txt": sha256(alone),
        "new/eo.json": sha256(out / "new" / "eo.json"),
    }
    assert DIRECTORY_KEY not in made
    assert (moved[INPUTS_KEY], moved[DIRECTORY_KEY]) == ({"imu.csv": sha256(inputs[0])}, "../in")
    assert {"insgnss", "python", "numpy"} == set(made["versions"])
    assert made["run"]["command"]


def test_paths_are_found_at_any_depth_of_options() -> None:
    """Oracle: dataclasses, mappings and sequences in each other."""

    @dataclass(frozen=True)
    class Inner:
        file: Path
        count: int = 3

    @dataclass(frozen=True)
    class Outer:
        inner: Inner
        more: tuple[Path | None, ...]
        named: dict[str, object]

    outer = Outer(Inner(Path("a")), (Path("b"), None), {"x": [Inner(Path("c"))], "y": "d"})
    assert list(paths_named_by(outer)) == [Path("a"), Path("b"), Path("c")]
