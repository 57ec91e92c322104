"""The pages of formats that are written only: their examples are what the writers write."""

from pathlib import Path

import pytest
from ba_scene import worked
from format_pages import Example, examples, on_page, without_version

from insgnss.base.errors import InputError
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii

OF_OTHER_TESTS = {
    "colmap_priors",  # no text
    *("eo_json", "eo_local_plane", "relative"),  # with their readers, in test_data_specs
    "g2o",  # of two images that err alike, in test_graph_exports
    "geopackage",  # its columns, in test_gis_exports
    "image_tags",
}


@pytest.mark.parametrize("shown", examples(), ids=lambda shown: f"{shown.export} {shown.kind}")
def test_the_example_is_what_is_written(shown: Example, tmp_path: Path) -> None:
    """Oracle: the page, for the worked example of formats.md 0.2; all but the version."""
    export = EXPORTS[shown.export]
    assert shown.page == export.page
    export.write(worked(shown.frame), tmp_path / export.product, **shown.options)
    text = (tmp_path / (shown.file or export.product)).read_text()
    assert without_version(text) == without_version(on_page(shown.page, shown.kind))


def test_every_export_has_its_example() -> None:
    """Oracle: the registry."""
    assert {shown.export for shown in examples()} == set(EXPORTS) - OF_OTHER_TESTS


def test_a_bad_line_of_a_table_is_refused_as_printed(tmp_path: Path) -> None:
    """Oracle: the page of generic_ascii."""
    path = tmp_path / "table.txt"
    path.write_text(on_page("generic_ascii"))
    assert read_generic_ascii(path).images == ("8001.tif",)
    path.write_text(on_page("generic_ascii") + on_page("generic_ascii", "bad"))
    with pytest.raises(InputError) as refusal:
        read_generic_ascii(path)
    assert on_page("generic_ascii", "message").strip() in str(refusal.value)
