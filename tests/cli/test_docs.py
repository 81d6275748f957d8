# SPDX-License-Identifier: MIT
"""The documentation names what there is: links, files, names of the code, commands, keys and make targets; and its examples are valid cases."""
import functools
import json
import re
import shlex

import pytest

from harness import DONE, ROOT, call

DOCS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES = [*DOCS, *sorted((ROOT / "cases").glob("*/README.md")), *(ROOT / d / "README.md" for d in ("postproc", "tests", "partition"))]
COMMANDS = {"run", "check", "field", "ensemble", "resume", "diff", "estimate"}


def name(path):
    return str(path.relative_to(ROOT))


def without_comments(text):
    return re.sub(r"<!--.*?-->", "", text, flags=re.S)


def blocks(text):
    """Code blocks, indented or fenced, as (language, lines)."""
    for m in re.finditer(r"^```(\w*)\n(.*?)^```", text, re.S | re.M):
        yield m[1], m[2].splitlines()
    for m in re.finditer(r"(?:(?<=\n\n)|\A)((?: {4}.*\n|\n(?= {4}))+)", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)):
        yield "", [line[4:] for line in m[1].splitlines()]


def code(text):
    text = re.sub(r".*: unknown key; did you mean .*", "", text) # the example of an error
    return " ".join(re.findall(r"`([^`]+)`", text)) + "\n" + "\n".join("\n".join(lines) for _, lines in blocks(text))


@functools.cache
def source():
    files = [p for d in ("src", "include", "partition", "tests") for e in ("*.c", "*.h") for p in (ROOT / d).rglob(e) if "corpus" not in p.parts]
    return "\n".join(p.read_text() for p in files)


@functools.cache
def options(command):
    done = call(command, "--help")
    assert done.returncode == DONE, command
    return set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", done.stdout))


@functools.cache
def keys():
    listed = json.loads(call("--list-keys", "--json").stdout)
    return {k["name"] for k in listed["keys"]}


def anchor(heading):
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def calls(text):
    """Each `bergtow ...` of a code block, as its words after the program."""
    for _, lines in blocks(text):
        for line in lines:
            line = re.sub(r"\s#\s.*", "", line)
            if m := re.search(r"(?:^|\s|\()(?:build/\w+/)?bergtow\s+(\S.*)", line):
                yield line, shlex.split(re.sub(r"[|>].*", "", m[1]))


def test_the_readme_is_a_page():
    lines = (ROOT / "README.md").read_text().splitlines()
    assert len(lines) <= 100


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_lines_are_short(path):
    """Tables excepted, whose rows cannot be broken."""
    long = [(i, len(line)) for i, line in enumerate(path.read_text().splitlines(), 1) if len(line) > 120 and not line.startswith("|")]
    assert not long


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text()):
        if re.match(r"https?:", target):
            continue
        file, _, heading = target.partition("#")
        there = (path.parent / file).resolve() if file else path
        assert there.exists(), target
        if heading:
            text = re.sub(r"^```.*?^```", "", there.read_text(), flags=re.S | re.M)
            assert heading in {anchor(h) for h in re.findall(r"^#+ (.*)", text, re.M)}, target


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_files_named_exist(path):
    found = 0
    for file in re.findall(r"(?<![\w/.-])((?:src|include|partition|tests|cases|docs|postproc)/[\w./*-]*\w)", without_comments(path.read_text())):
        found += 1
        assert (ROOT / file).exists(), file
    assert found > 0 or path not in DOCS


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_names_of_the_code_exist(path):
    missing = [n for n in set(re.findall(r"\bbt_\w+", path.read_text())) if not re.search(rf"\b{n}\b", source())]
    assert not missing


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_commands_and_options_are_known(path):
    for line, words in calls(path.read_text()):
        if words[0].startswith("--"):
            assert set(w for w in words if w.startswith("-")) <= {"--help", "--version", "--list-keys", "--json"}, line
            continue
        assert words[0] in COMMANDS, line
        for word in words[1:]:
            if word.startswith("-") and word != "-":
                assert word.split("=")[0] in options(words[0]), line
        for word in [b for a, b in zip(words, words[1:]) if a in ("--set", "-s")]:
            assert word.split("=")[0] in keys(), line
        for word in words[1:]:
            assert not word.startswith("cases/") or (ROOT / word).exists(), line


def test_every_command_is_in_the_manual():
    """And every option of the help text."""
    text = (ROOT / "docs/manual.md").read_text()
    assert {words[0] for _, words in calls(text)} >= COMMANDS
    general = {"--help", "--usage", "--version", "--output", "--scale", "--threads", "--quiet", "--no-wait"}
    for command in sorted(COMMANDS):
        for option in options(command):
            assert not option.startswith("--") or option in text or option in general, f"{command} {option}"


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_make_targets_are_known(path):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)) | {"install"}
    for _, lines in blocks(path.read_text()):
        for line in lines:
            for part in re.sub(r"\s#\s.*", "", line).split("&&"):
                words = part.split()
                if words[:1] == ["make"]:
                    asked = [w for w in words[1:] if re.fullmatch(r"[a-z-]+", w)]
                    assert path.parent.name == "tests" or set(asked) <= targets, line
                    assert not asked or asked[0] in targets, line


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_keys_named_exist(path):
    sections = {k.split(".")[0] for k in keys()}
    # run.sh, field.h5 and the like are files; run.summary is Python.
    other = re.compile(r"\.(h5|h|c|sh|yml|csv|png|md|html|json|geojson|py|mp4|part|resolved|append|summary|units|polygons|pose|seek)\b")
    for word in re.findall(r"(?<![\w./-])([a-z]+(?:\.[a-z0-9_]+)+)\b(?!\()", code(path.read_text())):
        if word.split(".")[0] in sections and not other.search(word):
            assert word in keys() or any(k.startswith(word + ".") for k in keys()), word


@pytest.mark.parametrize("path", DOCS, ids=name)
def test_examples_are_valid_cases(path, tmp_path):
    examples = [lines for language, lines in blocks(path.read_text()) if language == "yaml"]
    assert examples or path.name not in ("README.md", "manual.md")
    for lines in examples:
        case = tmp_path / "case.yml"
        case.write_text("\n".join(lines) + "\n")
        done = call("check", case)
        assert done.returncode == DONE, done.stderr
        assert "warning" not in done.stdout + done.stderr


def test_the_commands_are_those_of_the_program():
    assert set(re.findall(r"^  ([a-z]+)  ", call("--help").stdout, re.M)) == COMMANDS
