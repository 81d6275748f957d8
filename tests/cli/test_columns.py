# SPDX-License-Identifier: MIT
"""tests/columns.py, by which make lint finds long lines: characters are counted, and in Markdown only prose."""
import pytest

import columns

LONG = "word " * 24 + "x"  # 121 characters


def found(tmp_path, capsys, text, name="a.md"):
    """Numbers of the lines complained of."""
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    code = columns.main([str(path)])
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith(f"{path}:") for line in lines) and code == (1 if lines else 0)
    return [int(line.removeprefix(f"{path}:").split(":")[0]) for line in lines]


def test_characters_are_counted_not_bytes(tmp_path, capsys):
    assert found(tmp_path, capsys, "ø" * 120 + "\nshort\n" + "ø" * 121 + "\n" + "x" * 121, "a.sh") == [3, 4]


@pytest.mark.parametrize("text, lines", [
    (LONG, [1]),
    (f"text\n    {LONG}", [2]),                                   # goes on with the paragraph
    (f"- item\n\n  {LONG}\n", [3]),                               # a paragraph of the item
    (f"- item\n\n    {LONG}\n\ntext\n\n    {LONG}", [3]),          # of the item; code, now that the list has ended
    (f"- item\n\n      {LONG}\n", []),                            # code of the item
    (f"text\n\n    {LONG}\n    {LONG}\n\n    {LONG}\n{LONG}", [7]),  # code with an empty line in it
    (f"```\n{LONG}\n~~~\n{LONG}\n```\n{LONG}", [6]),
    (f"````\n```\n{LONG}\n````\n{LONG}", [5]),
    (f"| {LONG} |\n", []),
    (f"see [this]({'p/' * 60}x.md#part).\n[a]: {'p/' * 60}\n<https://example.org/{'p/' * 60}>\n", []),
    (f"see [this](x.md), {LONG}", [1]),
    (f"see [{LONG}](x.md)", [1]),
])
def test_in_markdown_tables_code_and_targets_of_links_may_be_long(tmp_path, capsys, text, lines):
    assert found(tmp_path, capsys, text) == lines
