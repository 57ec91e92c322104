"""What can be made again from its inputs: hashes, versions, products, what nobody knows of."""

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from insgnss import __version__
from insgnss.base.errors import UsageError
from insgnss.batch.season.archive import ArchiveResult, changed_since, examine_archive
from insgnss.cli import main


def sha(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Two results: of a block, and of `ppk`, each with inputs beside it."""
    for name, document in (("block", "adjust.json"), ("rover", "ppk.json")):
        out = tmp_path / "season" / name / "out"
        out.mkdir(parents=True)
        (out.parent / "in.csv").write_text(f"{name}\n")
        (out / "poses.csv").write_text("1 2 3\n")
        content: dict[str, Any] = {"versions": {"insgnss": __version__}}
        content["inputs_sha256"] = {"in.csv": sha(f"{name}\n")}
        content["products_sha256"] = {"poses.csv": sha("1 2 3\n")}
        (out / document).write_text(json.dumps(content))
    return tmp_path / "season"


def examined(archive: Path) -> ArchiveResult:
    return examine_archive(archive, False, lambda _: None)


def problems(archive: Path) -> list[str]:
    return [problem for run in examined(archive).runs for problem in run.problems]


def change(path: Path, **values: Any) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_what_is_there_as_it_was_can_be_made_again(archive: Path, tmp_path: Path) -> None:
    """Oracle: the files; the archive moved as a whole as well."""
    assert problems(archive) == []
    assert examined(archive).refusal is None
    assert "2 of 2 results can be made again" in examined(archive).summary()
    shutil.move(archive, tmp_path / "elsewhere")
    assert problems(tmp_path / "elsewhere") == []


def test_each_thing_that_is_missing_or_other_is_named(archive: Path) -> None:
    """Oracle: what was done to the files."""
    block = archive / "block"
    (block / "in.csv").write_text("other\n")
    assert ["input in.csv has changed" in p for p in problems(archive)] == [True]
    (block / "in.csv").unlink()
    assert problems(archive)[0].startswith("input in.csv is missing (looked for in")
    (block / "in.csv").write_text("block\n")
    (block / "out" / "poses.csv").write_text("1 2 4\n")
    assert problems(archive) == ["product poses.csv was changed after the run wrote it"]
    (block / "out" / "poses.csv").unlink()
    assert problems(archive) == ["product poses.csv is missing"]
    document = archive / "rover" / "out" / "ppk.json"
    change(document, versions={"insgnss": "0.0.1", "numpy": "1.0"})
    runs = examined(archive).runs
    assert runs[1].problems == (f"made by insgnss 0.0.1, not {__version__}",)
    assert "numpy" in runs[1].notes[0]
    refusal = examined(archive).refusal
    assert refusal is not None
    assert (refusal.exit_code, str(refusal)[:7]) == (4, "2 of 2 ")


def test_objects_of_python_and_products_without_document_are_named(archive: Path) -> None:
    """Oracle: a report of `estimate`, and an orientation that nobody says anything of."""
    change(
        archive / "block" / "out" / "adjust.json",
        flight={"imu": {"file": "given as object: <ImuSamples>"}},
    )
    assert problems(archive) == [
        "an input was a Python object, not a file, so that the run cannot be repeated"
    ]
    (archive / "old").mkdir()
    (archive / "old" / "eo.json").write_text("{}")
    assert examined(archive).orphans == (archive / "old" / "eo.json",)
    assert (
        "eo.json: no JSON document states the inputs of this product" in examined(archive).summary()
    )
    (archive / "noise.toml").write_text("n")
    products = {"noise.toml": sha("n")}
    made = {"versions": {"insgnss": __version__}, "inputs_sha256": {}, "products_sha256": products}
    (archive / "noise.json").write_text(json.dumps(made))
    assert examined(archive).orphans == (archive / "old" / "eo.json",)


def test_a_directory_without_results_is_refused(tmp_path: Path) -> None:
    """Oracle: an empty directory, and none."""
    with pytest.raises(UsageError, match="holds no results of insgnss"):
        examined(tmp_path)
    with pytest.raises(UsageError, match="is no directory"):
        examined(tmp_path / "none")


def test_the_verb_prints_and_refuses(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: exit codes 0 and 4, and the JSON document."""
    assert main(["archive", str(archive), "--json"]) == 0
    assert [run["problems"] for run in json.loads(capsys.readouterr().out)["runs"]] == [[], []]
    (archive / "rover" / "in.csv").unlink()
    assert main(["archive", str(archive), "-q"]) == 4
    out, err = capsys.readouterr()
    assert "rover/out: input in.csv is missing" in out
    assert err.count("\n") == 1
    assert "1 of 2 results cannot be made again" in err


def test_what_was_written_after_a_result_and_is_other_now_is_named(archive: Path) -> None:
    """Oracle: what was done to the file; one that was written again as it was is none."""
    document, given = archive / "block" / "out" / "adjust.json", archive / "block" / "in.csv"
    made = document.stat().st_mtime
    for text, after, names in (
        ("block\n", 5.0, ()),
        ("other\n", 5.0, ("in.csv",)),
        ("other\n", -5.0, ()),  # the archive's whole check reads it
    ):
        given.write_text(text)
        os.utime(given, (made + after, made + after))
        assert changed_since(document) == names
    assert changed_since(archive / "no.json") == ()


def test_a_flight_without_results_is_named(archive: Path) -> None:
    """Oracle: a flight file that no document names, and one that a document does."""
    assert examined(archive).unprocessed == ()
    (archive / "f06").mkdir()
    (archive / "f06" / "flight.toml").write_text('name = "f06"')
    result = examined(archive)
    assert result.unprocessed == (archive / "f06" / "flight.toml",)
    assert "f06/flight.toml: no results yet; run insgnss process" in result.summary().replace(
        "\\", "/"
    )
    assert result.as_dict()["unprocessed"] == [str(archive / "f06" / "flight.toml")]
