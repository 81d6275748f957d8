# SPDX-License-Identifier: MIT
"""The manual as Sphinx makes it: no warning, no link that leads nowhere, every key, quantity, function and picture."""
import html
import json
import re
import subprocess
import sys
from urllib.parse import unquote

import pytest
import yaml

from harness import BERGTOW, ROOT, call

sys.path.insert(0, str(ROOT / "docs"))
import headers  # noqa: E402


@pytest.fixture(scope="module")
def manual(tmp_path_factory):
    """The folder of the HTML."""
    out = tmp_path_factory.mktemp("docs")
    done = subprocess.run(["/usr/bin/python3", str(ROOT / "docs/build.py"), BERGTOW, str(out), "--no-pdf"],
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and "WARNING" not in done.stderr, done.stderr
    return out / "html"


def page(manual, name):
    return (manual / "docs" / name).read_text(encoding="utf-8")


@pytest.mark.slow
def test_links_lead_somewhere(manual):
    """Every link and picture of every page, with the place within the page it leads to."""
    texts = {p: p.read_text(encoding="utf-8") for p in manual.rglob("*.html")}
    places = {p: set(re.findall(r'\b(?:id|name)="([^"]+)"', text)) for p, text in texts.items()}
    seen = 0
    for path, text in texts.items():
        for target in re.findall(r'(?:href|src)="([^"]+)"', text):
            target = html.unescape(target)
            if re.match(r"[a-z]+:", target) or target.startswith("data:"):
                continue
            file, _, place = target.partition("#")
            there = (path.parent / unquote(file.split("?")[0])).resolve() if file else path
            assert there.exists(), f"{path.relative_to(manual)}: {target}"
            assert not place or there.suffix != ".html" or unquote(place) in places[there], f"{path.name}: {target}"
            seen += 1
    assert seen > 2000 and len(texts) > 50


@pytest.mark.slow
def test_the_start_is_the_manual(manual):
    assert "docs/index.html" in (manual / "index.html").read_text()


@pytest.mark.slow
def test_every_key_and_quantity_is_there(manual):
    table = json.loads(call("--list-keys", "--json").stdout)
    text = page(manual, "reference/keys.html")
    shown = set(map(html.unescape, re.findall(r'<span class="pre">([^<]+)</span>', text)))
    del table["units"]  # symbols, which are no keys
    for keys in table.values():
        assert {k["name"] for k in keys} <= shown
    text = page(manual, "reference/quantities.html")
    shown = set(map(html.unescape, re.findall(r'<span class="pre">([^<]+)</span>', text)))
    for rows in json.loads(call("--list-quantities", "--json").stdout).values():
        if isinstance(rows, list):
            assert {next(iter(r.values())) for r in rows} <= shown


@pytest.mark.slow
def test_every_command_is_there(manual):
    text = page(manual, "reference/commands.html")
    for name in re.findall(r"^  ([a-z]+)  ", call("--help").stdout, re.M):
        assert f'id="{name}"' in text


@pytest.mark.slow
def test_every_function_of_the_headers_is_there(manual):
    found = "".join(p.read_text(encoding="utf-8") for p in (manual / "docs/reference/c").glob("*.html"))
    entries = set(re.findall(r'id="c\.(bt_\w+)"', found))
    wanted = set()
    for path in (ROOT / "include/bergtow").glob("*.h"):
        text = re.sub(r"//.*", "", path.read_text())
        text = re.sub(r"\{[^{}]*\}", ";", re.sub(r"\{[^{}]*\}", ";", text))  # members, and bodies of inline functions
        wanted |= set(re.findall(r"^(?!typedef|static|#|extern)[a-z][\w *]*?\b(bt_\w+)\([^;]*;", text, re.M))
    assert len(wanted) > 60 and wanted <= entries, wanted - entries


def test_comments_go_with_their_declarations():
    text = "// SPDX\n// What it is.\n#ifndef A_H\n#define A_H\n\n/// Adds.\nint bt_add(int a,\n           int b);\n" \
           "double bt_g(void); ///< m/s2\n\nstruct bt_a {\n    int n; ///< number\n};\n#define BT_N 3\n"
    assert list(headers.parts(text)) == [
        (["SPDX", "What it is."], ""), (["Adds."], "int bt_add(int a,\n           int b);"),
        ([], "double bt_g(void); ///< m/s2"), ([], "struct bt_a {\n    int n; ///< number\n};"), ([], "#define BT_N 3")]
    assert headers.prototype("_Noreturn void bt_x(const char *f, ...) __attribute__((format(printf, 1, 2)));") == \
        "void bt_x(const char *f, ...)"
    assert headers.prototype("typedef void (*bt_y)(void);") is None


@pytest.mark.slow
def test_the_python_package_is_there(manual):
    text, names = page(manual, "reference/python.html"), {}
    exec(re.search(r"^__all__ = .*?\]", (ROOT / "postproc/bergtow/__init__.py").read_text(), re.M | re.S)[0], names)
    assert all(re.search(f'id="(module-)?bergtow.{name}"', text) for name in names["__all__"])


@pytest.mark.slow
def test_every_picture_of_the_cases_is_in_the_gallery(manual):
    text = page(manual, "reference/gallery.html")
    named = [picture for readme in (ROOT / "cases").glob("*/README.md")
             for picture in re.findall(r"!\[[^\]]*\]\(([\w-]+\.png)\)", readme.read_text())]
    assert len(named) >= 15 and [name for name in named if name not in text] == []


# ---- files for people who cite and contribute ----


def test_citation():
    """What the Citation File Format 1.2.0 asks for; version and licence are those of the program."""
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(found)
    assert set(found) <= {"cff-version", "message", "title", "authors", "type", "abstract", "version", "license",
                          "keywords", "references", "repository-code", "url", "date-released", "doi"}
    version = re.search(r'BT_VERSION "(.*)"', (ROOT / "include/bergtow/base.h").read_text())[1]
    assert str(found["version"]) == version and found["cff-version"] == "1.2.0" and found["type"] == "software"
    assert found["license"] == "MIT" and "MIT" in (ROOT / "LICENSE").read_text()
    for entry in found["authors"] + [a for r in found["references"] for a in r["authors"]]:
        assert set(entry) in ({"name"}, {"family-names", "given-names"})
    assert all({"type", "title", "authors"} <= set(r) for r in found["references"])


def test_changes_name_the_version():
    version = re.search(r'BT_VERSION "(.*)"', (ROOT / "include/bergtow/base.h").read_text())[1]
    heads = re.findall(r"^## (.*)", (ROOT / "docs/CHANGELOG.md").read_text(), re.M)
    assert heads[0] == "Unreleased" and version in heads
