# SPDX-License-Identifier: MIT
"""tests/prose.py, by which make lint finds phrases that make a reader stumble: in prose, and only there."""
import pytest

import prose


def found(tmp_path, capsys, text):
    """(line, phrase) of each complaint."""
    path = tmp_path / "a.md"
    path.write_text(text, encoding="utf-8")
    code = prose.main([str(path)])
    lines = capsys.readouterr().out.splitlines()
    assert code == (1 if lines else 0)
    return [(int(line.removeprefix(f"{path}:").split(":")[0]), line.split('"')[1]) for line in lines]


@pytest.mark.parametrize("text, phrase", [
    ("Lost is what was not written.", "what was"),
    ("What is left out\nis counted.", "What is"),
    ("the speed at which it moves", "at which"),
    ("The run goes on.", "goes on"),
    ("It is no force that ice takes.", "is no force that"),
    ("the state of before", "of before"),
    ("a longer run, one that jams", "one that"),
    ("keys of its own", "of its own"),
    ("a file is told by name", "is told"),
    ("It fails and says so.", "says so"),
    ("| a | it goes on |", "goes on"),
])
def test_a_form_is_found(tmp_path, capsys, text, phrase):
    assert found(tmp_path, capsys, "# A page\n\n" + text) == [(3, phrase)]


def test_a_form_is_found_over_the_end_of_a_line_and_not_of_a_paragraph(tmp_path, capsys):
    assert found(tmp_path, capsys, "The run goes\non.\n\nIt goes\n\non a line") == [(1, "goes on")]


@pytest.mark.parametrize("text", ["# What is needed", "What is a floe?",
                                  "| Which document is this, of which revision? | title block |",
                                  "`check` says what is wrong; it shows exactly what the case needs.",
                                  "a run, which stops", "There is no floe that moves.",
                                  "`goes on`, and \"it is said that it\ngoes on\"",
                                  "```\ngoes on\n```\n\n    goes on\n", ])
def test_what_is_right_is_left_alone(tmp_path, capsys, text):
    assert found(tmp_path, capsys, text) == []


def test_an_open_section_ends_with_the_next_of_its_level(tmp_path):
    page = tmp_path / "a.md"
    page.write_text("## Open\n\nIt goes on.\n\n### Part\n\nIt goes on.\n\n## Clean\n\nIt goes on.\n", encoding="utf-8")
    assert [line for line, *_ in prose.faults(page, ("Open",))] == [11]


def test_pages_and_sections_listed_are_there():
    """A page renamed is not left out in silence."""
    assert all(list(prose.ROOT.glob(pattern)) for pattern in prose.CLEAN)
    for page, headings in prose.OPEN.items():
        text = (prose.ROOT / page).read_text(encoding="utf-8")
        assert all(f" {heading}\n" in text for heading in headings)
