# SPDX-License-Identifier: MIT
"""The documentation names what there is: links, files, names in the code, commands, keys, make targets; its example
cases are valid, and its calls are taken by the command lines of program and scripts."""
import fnmatch
import functools
import itertools
import json
import re
import shlex
import sys

import pytest

import harness
from bergtow import cli, errors
from harness import BERGTOW, DONE, ROOT, call

sys.path.insert(0, str(ROOT / "docs"))
import stage  # noqa: E402
import tables  # noqa: E402

DOCS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES = [*DOCS, *sorted((ROOT / "docs/tutorials").glob("*.md")), *sorted((ROOT / "cases").glob("*/README.md"))]
PAGES += [ROOT / folder / "README.md" for folder in ("postproc", "tests", "partition")]
HEADS = ("src", "include", "partition", "tests", "cases", "docs", "postproc")
COMMANDS = {"run", "check", "field", "ensemble", "resume", "diff", "estimate", *cli.COMMANDS}
FOLLOWED = {"ice-from-an-image.md"}  # word for word, files and all, by test_import_map.py
MADE_BY_RUNS = {"bench.csv", "members.csv", "statistics.csv"}
# Words with a dot that begin like a section of a case and are none of its keys: files, and members of Python objects.
NO_KEYS = "h5 h c sh yml csv png md html pdf json geojson py mp4 part resolved append summary units polygons".split()
every_page = pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
every_doc = pytest.mark.parametrize("path", DOCS, ids=lambda path: str(path.relative_to(ROOT)))


# --- the parts of a page ---------------------------------------------------------------------------------------------


def without_fences(text):
    return re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)


def blocks(text):
    """Code blocks, fenced or indented, as (language, lines)."""
    for m in re.finditer(r"^```(\w*)\n(.*?)^```", text, re.S | re.M):
        yield m[1], m[2].splitlines()
    for m in re.finditer(r"(?<=\n\n)((?: {4}.*\n|\n(?= {4}))+)", without_fences(text)):
        yield "", [line[4:] for line in m[1].splitlines()]


def commands(text):
    """Lines of code blocks without their comments; a line that goes on in the next is one with it."""
    lines = (re.sub(r"\\\n\s*", "", "\n".join(lines)).split("\n") for _, lines in blocks(text))
    return [re.sub(r"(^|\s)#\s.*", "", line) for some in lines for line in some]


def spans(text):
    """Code within lines."""
    return [re.sub(r"\s+", " ", s) for s in re.findall(r"`([^`]+)`", without_fences(text).replace(r"\|", "/"))]


def calls(text, within_lines=True):
    """Each call of the program: the line, and its words after the program; of a row of a table that begins with one
    also the options that stand alone in it, one a call."""
    for line in commands(text) + (spans(text) if within_lines else []):
        if m := re.search(r"(?:^|\s)(?:build/\w+/)?bergtow\s+([a-z-].*)", line):
            yield line, shlex.split(re.sub(r"[|>].*", "", m[1]))
    for row in re.findall(r"^\| `bergtow [a-z-]+ .*", text, re.M) if within_lines else []:
        first, *rest = spans(row)
        for option in (s for s in rest if s.startswith("--")):
            yield first, [first.split()[1], *option.replace("\\", "").split()]


def script_calls(path, within_lines=True):
    """Each call of a script of Python on a page: the line, its path and its words."""
    text = path.read_text()
    for line in commands(text) + (spans(text) if within_lines else []):
        m = re.match(r"(?:/usr/bin/python3 )?([\w/]+\.py)(?: (.*))?$", line.strip())
        if m and (file := script(m[1], path.parent)):
            yield line, file, shlex.split(re.sub(r"[|>&].*", "", m[2] or ""))


def code(text):
    """What stands as code, but for the example of an error message."""
    text = re.sub(r".*: unknown key; did you mean .*", "", text)
    return " ".join(re.findall(r"`([^`]+)`", without_fences(text))) + "\n" + "\n".join(commands(text))


def anchor(heading):
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


# --- what there is ---------------------------------------------------------------------------------------------------


@functools.cache
def files():
    found = (p for head in HEADS for p in (ROOT / head).rglob("*") if p.is_file())
    return [p for p in found if "corpus" not in p.parts and "__pycache__" not in p.parts]


@functools.cache
def source():
    return "\n".join(p.read_text() for p in files() if p.suffix in (".c", ".h"))


@functools.cache
def called(*words):
    """Commands of the Python package in a copy (script_copy.py): most of a call is the start of Python."""
    return harness.script(*words) if words and words[0] in cli.COMMANDS else call(*words)


@functools.cache
def help_of(*command):
    done = called(*command, "--help")
    assert done.returncode == DONE, command
    return done.stdout


def options(command):
    return set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", help_of(command)))


@functools.cache
def script(name, beside):
    """A script that a page in the folder `beside` names, with its folder or alone; None for one that the reader
    makes."""
    found = [beside / name, ROOT / name, *(p for p in files() if p.name == name and p.parent.parent == ROOT)]
    return next((p for p in found if p.is_file()), None)


@functools.cache
def of_script(path, *words):
    """A script called with these words."""
    return harness.script(path, *words, cwd=ROOT)


@functools.cache
def keys():
    return {k["name"] for k in json.loads(call("--list-keys", "--json").stdout)["keys"]}


# --- tests -----------------------------------------------------------------------------------------------------------


def test_the_readme_is_a_page():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 100


@every_page
def test_lines_are_short(path):
    """Tables excepted, whose rows cannot be broken."""
    lines = enumerate(path.read_text().splitlines(), 1)
    assert not [n for n, line in lines if len(line) > 120 and not line.startswith("|")]


@every_page
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text()):
        if re.match(r"https?:", target):
            continue
        file, _, heading = target.partition("#")
        there = (path.parent / file).resolve() if file else path
        assert there.exists(), target
        headings = re.findall(r"^#+ (.*)", without_fences(there.read_text()), re.M) if heading else []
        assert not heading or heading in map(anchor, headings), target


@every_page
def test_files_named_exist(path):
    """Paths from the root or from the page's own folder; sources named alone, somewhere, or as a file that the
    reader is told to save. NAME stands for any."""
    text = re.sub(r"<!--.*?-->", "", path.read_text(), flags=re.S)
    own = [] if path in DOCS else [d.name for d in path.parent.iterdir() if d.is_dir()]
    paths = re.findall(rf"(?<![\w/.-])((?:{'|'.join([*HEADS, *own])})/[\w./*-]*\w)", text)
    assert paths or path not in DOCS
    for file in paths:
        assert "NAME" in file or (ROOT / file).exists() or (path.parent / file).exists(), file
    names = {p.name for p in files()} | MADE_BY_RUNS | set(re.findall(r"\bas\s+`(\w+\.\w+)`", text))
    for file in re.findall(r"(?<![\w/.<-])(\w+\.(?:c|h|py|sh|csv))\b(?!\()", text):
        assert file in names, file


def test_files_of_the_architecture_are_in_their_folders():
    """Each `name` of the table of files is a file of that folder, or the beginning of some with *."""
    page = (ROOT / "docs/architecture.md").read_text()
    layers, table = re.search(r"^## Layers\n(.*?)^## Files, folder by folder\n(.*?)^## ", page, re.S | re.M).groups()
    folders = {f"src/{d.name}" for d in (ROOT / "src").iterdir() if d.is_dir()} | {"partition/"}
    row = r"^\| ((?:src|partition)/\w*) \| (.*) \|$"
    assert folders == {m[0] for m in re.findall(row, layers, re.M)} == {m[0] for m in re.findall(row, table, re.M)}
    for folder, text in re.findall(row, table, re.M):
        there = [p.name for p in (ROOT / folder).iterdir()]
        for part in re.findall(r"`([\w.*]+)`", text):
            assert fnmatch.filter(there, part if "." in part else part + ".[ch]"), f"{folder}: {part}"


@every_page
def test_names_of_the_code_exist(path):
    names = set(re.findall(r"\bbt_\w+", path.read_text()))
    assert not [n for n in names if not re.search(rf"\b{n}\b", source())]


@every_doc
def test_functions_are_defined_where_the_page_says(path):
    """Written "src/a/b.c `name`", or in a table as `name` | src/a/b.c."""
    text = path.read_text()
    said = [(name, file) for file, name in re.findall(r"((?:src|partition)/[\w/]+\.[ch]) `(\w+)`", text)]
    for names, file in re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ((?:src|partition)/[\w/]+\.c) \|", text, re.M):
        said += [(name, file) for name in re.findall(r"\w+", names)]
    assert said or path.name != "architecture.md"
    for name, file in said:
        assert re.search(rf"^\w[\w *]*\b{name}\(", (ROOT / file).read_text(), re.M), f"{file}: {name}"


@every_page
def test_commands_and_options_are_known(path):
    found = list(calls(path.read_text()))
    assert len(found) > 30 or path.parent.name != "postproc"
    for line, words in found:
        if words[0].startswith("--"):
            assert set(words) <= {"--help", "--version", "--list-keys", "--list-quantities", "--json"}, line
            continue
        if words[0] == "help":
            assert set(words[1:]) <= COMMANDS | {"COMMAND"}, line
            continue
        assert words[0] in COMMANDS, line
        assert {w.split("=")[0] for w in words[1:] if re.match("-.", w)} <= options(words[0]), line
        assert {b.split("=")[0] for a, b in zip(words, words[1:]) if a in ("--set", "-s")} <= keys(), line
        assert all((ROOT / w).exists() for w in words if w.startswith("cases/")), line


@every_page
def test_scripts_and_their_options_are_known(path):
    for line, file, words in script_calls(path):
        assert all((ROOT / w).exists() for w in words if w.startswith("cases/")), line
        wanted = {w.split("=")[0] for w in words if re.match("-.", w)}
        if wanted:
            said = of_script(file, *itertools.takewhile(lambda w: w[0] != "-", words), "--help").stdout
            assert wanted <= set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", said)), line


@every_page
def test_command_lines_are_taken(path):
    """By the parser of the command, the values of options too: a --help at the end ends the call when every word before
    it has been read."""
    lines = [(line, functools.partial(called, *words))
             for line, words in calls(path.read_text(), within_lines=False) if words[0] in COMMANDS]
    lines += [(line, functools.partial(of_script, file, *words))
              for line, file, words in script_calls(path, within_lines=False) if words]
    for line, taken in lines:
        done = taken("--help")
        assert done.returncode == DONE and not done.stderr, f"{line}: {done.stderr}"


@every_page
def test_cases_are_valid_with_what_a_call_sets(path):
    """What takes no time, check and estimate, is called as it stands."""
    for line, words in calls(path.read_text()):
        if words[0] in COMMANDS and len(words) > 1 and words[1].startswith("cases/"):
            values = [b for a, b in zip(words, words[1:]) if a in ("--set", "-s")]
            quick = ["check", words[1], *(w for value in values for w in ("--set", value))]
            done = call(*(words if words[0] in ("check", "estimate") else quick))
            assert done.returncode == DONE, f"{line}: {done.stderr}"


def test_the_manual_has_every_command():
    """Or postproc/README.md has it. And the commands of this test are the program's."""
    text = "".join((ROOT / page).read_text() for page in ("docs/manual.md", "postproc/README.md"))
    listed = dict(re.findall(r"^  ([a-z][a-z-]*) +(.*)$", help_of(), re.M))
    assert set(listed) == COMMANDS
    assert {name: listed[name] for name in cli.COMMANDS} == {name: about for name, (_, about) in cli.COMMANDS.items()}
    assert {words[0] for _, words in calls(text)} >= COMMANDS


def test_exit_codes_are_those_of_the_header():
    """In Python, in --help and in the manual; 1 is that of `diff`."""
    header = (ROOT / "include/bergtow/base.h").read_text()
    codes = {name: int(code) for name, code in re.findall(r"BT_(?:ERR_)?([A-Z]+) = (\d+),", header)}
    assert codes and {name: getattr(errors, name) for name in codes} == codes
    section = (ROOT / "docs/manual.md").read_text().partition("## Errors and exit codes")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| (\d) \|", section, re.M)) - {"1"} == set(map(str, codes.values()))
    assert set(re.findall(r"\d", help_of().partition("Exit codes:")[2])) == set(map(str, codes.values()))


def test_the_reference_describes_every_option(tmp_path, monkeypatch):
    """In the table of its command, made from --help; but for those that every command has."""
    monkeypatch.setattr(tables.from_help, "said", lambda program, *words: help_of(*words[:-1]))
    tables.commands(BERGTOW, tmp_path)
    text = (tmp_path / "commands.md").read_text()
    found = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", text, re.S | re.M))
    assert set(found) == COMMANDS
    for command, section in found.items():
        rows = re.findall(r"^\| (`-.*?) \| .*\w.* \|$", section, re.M)
        described = set(re.findall(r"`(--?[a-z][a-z-]*)`", " ".join(rows)))
        for option in options(command) - {"--help", "--usage", "--version"} - described:
            begins_a_line = re.search(rf"^ {{2,8}}(?:-.*, )?{option}(?![\w-])", help_of(command), re.M)
            assert option.startswith("-h") or not begins_a_line, f"{command} {option}"
        assert described <= options(command)


@every_page
def test_make_targets_are_known(path):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    for line in commands(path.read_text()):
        for words in (part.split() for part in line.split("&&")):
            if words[:1] == ["make"]:
                asked = [w for w in words[1:] if re.fullmatch("[a-z-]+", w)]
                # In tests/README.md a word of explanation follows the target.
                assert set(asked[:1] if path.parent.name == "tests" else asked) <= targets, line


@every_page
def test_keys_named_exist(path):
    sections = {k.split(".")[0] for k in keys()}
    for word in re.findall(r"(?<![\w./-])([a-z]+(?:\.[a-z0-9_]+)+)\b(?!\()", code(path.read_text())):
        if word.split(".")[0] in sections and word.split(".")[-1] not in NO_KEYS:
            assert word in keys() or any(k.startswith(word + ".") for k in keys()), word


@pytest.mark.parametrize("path", [p for p in DOCS if p.name not in FOLLOWED], ids=lambda path: path.name)
def test_examples_are_valid_cases(path, tmp_path):
    examples = [lines for language, lines in blocks(path.read_text()) if language == "yaml"]
    assert examples or path.name not in ("README.md", "manual.md")
    for lines in examples:
        case = tmp_path / "case.yml"
        case.write_text("\n".join(lines) + "\n")
        done = call("check", case)
        assert done.returncode == DONE, done.stderr
        assert "warning" not in done.stdout + done.stderr


@pytest.mark.parametrize("page", ["README.md", "docs/tutorials/1-first-tow.md"])
def test_a_page_states_the_mean_that_its_case_gives(page, tmp_path):
    text = (ROOT / page).read_text()
    (tmp_path / "case.yml").write_text(re.search(r"^```yaml\n(.*?)^```", text, re.S | re.M)[1])
    done = call("run", tmp_path / "case.yml", "-o", tmp_path / "out", "--set", "output.frame_interval=-1 s")
    [stated] = re.findall(r"[\d.]+ kN, 95 % interval [\d.]+ kN to [\d.]+ kN", text)
    assert f"ice resistance    {stated}" in done.stdout and "), steady; " in done.stdout


def test_the_force_law_of_the_page_is_the_one_that_is_tested():
    page = (ROOT / "docs/how-to-add-a-force-law.md").read_text()
    first = next(lines for language, lines in blocks(page) if language == "c")
    assert first == (ROOT / "tests/examples/force_law.c").read_text().splitlines()


def test_every_linked_page_is_in_the_contents(tmp_path):
    """Red with a link to a page that no table of contents names: the manual is then refused (docs/build.py)."""
    stage.stage(tmp_path)
    listed = {(page.parent / f"{name}.md").resolve() for page in (ROOT / "docs").rglob("*.md")
              for block in re.findall(r":::\{toctree\}(.*?):::", page.read_text(), re.S)
              for name in re.findall(r"^[\w./-]+$", block, re.M)}
    linked = {ROOT / page.relative_to(tmp_path) for page in tmp_path.rglob("*.md")}
    assert not {page for page in linked - listed if not page.is_relative_to(ROOT / "docs")}
