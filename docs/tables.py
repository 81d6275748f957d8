# SPDX-License-Identifier: MIT
"""Pages of the manual from what the program prints of itself: keys, quantities, commands."""
import json
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "install"))
import from_help  # noqa: E402


def said(program, *arguments):
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=True).stdout


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text, encoding="utf-8")


def plain(text):
    """Text that Markdown shows as it is, but for `code`."""
    parts = re.split(r"(`[^`|]+`)", text)
    return "".join(part if i % 2 else re.sub(r"([\\`*_{}\[\]<>#|~$])", r"\\\1", part) for i, part in enumerate(parts))


def row(*cells):
    return "| " + " | ".join(cells) + " |"


def head(*cells):
    return [row(*cells), row(*["---"] * len(cells))]


def bound(key):
    """Range of a key as --list-keys has it."""
    if key["type"] == "choice":
        return ", ".join(f"`{c}`" for c in key["choices"])
    if key["type"] == "bool":
        return "`true`, `false`"
    if "least" not in key:
        return "–"
    least, most = (f"{key[k]:g}" for k in ("least", "most"))
    return plain(f"{'(' if key['above_least'] else '['}{least}, {most}{')' if key['below_most'] else ']'}")


def default(key):
    if key["required"]:
        return "required"
    text = plain("= " + key["follows"]) if key["follows"] else f"`{key['default']}`"
    return text if key["default_at_sea"] else text + ", in the geographic frame none"


def table_of(keys):
    lines = head("key", "unit", "default", "range", "meaning")
    for key in keys:
        unit = key.get("unit") or {"integer": "whole number", "text": "text", "map": "map"}.get(key["type"], "–")
        lines.append(row(f"`{key['name']}`", plain(unit), default(key), bound(key), plain(key["doc"])))
    return lines


def keys(program, folder):
    table = json.loads(said(program, "--list-keys", "--json"))
    page = ["# Keys of a case", "", f"Every key of bergtow {said(program, '--version').split()[1]}, as "
            "`bergtow --list-keys` prints them. A number without a unit is in the unit shown here; other units of the "
            "same kind may be written behind it ([cases](../manual.md#write-and-check-a-case)). A default that begins "
            "with = follows from other keys.", ""]
    sections = {}
    for key in table["keys"]:
        sections.setdefault(key["name"].split(".")[0], []).append(key)
    for name, some in sections.items():
        page += [f"## {name}", "", *table_of(some), ""]
    page += ["## floes", "", "A list of floes given by hand; each is a map with these keys.", "",
             *table_of(table["floe_keys"]), "", "## base", "", *table_of(table["file_keys"]), "",
             "## Keys of a study", "", "A study file has these keys in place of sections ([studies]"
             "(../../cases/studies/README.md#study-file-format)).", "", *table_of(table["study_keys"]), ""]
    limits = said(program, "--list-keys").split("The program refuses anything beyond these limits", 1)[1]
    page += ["## Limits of size", "", "```text", "The program refuses anything beyond these limits" + limits.rstrip(),
             "```", ""]
    write(folder / "keys.md", "\n".join(page))


def cell(value):
    return "–" if value in (None, "") else plain(str(value))


def quantities(program, folder):
    table = json.loads(said(program, "--list-quantities", "--json"))
    page = ["# Quantities", "", "Every number that a run leaves, as `bergtow --list-quantities` prints them.", ""]
    for name, rows in table.items():
        if not isinstance(rows, list) or not rows:
            continue
        columns = [c for c in rows[0] if any(r.get(c) not in (None, "") for r in rows)]
        page += [f"## {name.replace('_', ' ').capitalize()}", "", *head(*(c.replace("_", " ") for c in columns))]
        page += [row(f"`{r[columns[0]]}`", *(cell(r.get(c)) for c in columns[1:])) for r in rows] + [""]
    write(folder / "quantities.md", "\n".join(page))


def commands(program, folder):
    found, own, codes = from_help.commands(program)
    page = ["# Commands", "", "Every command with its options, from `bergtow COMMAND --help`. `make install` also "
            "installs this as a man page (`man bergtow`), with completions for bash and zsh. `--help` is an option of "
            "each.", "", *head("command", "purpose")]
    page += [row(f"[{c.name}](#{c.name})", plain(c.summary)) for c in found]
    page += ["", *head("option of `bergtow` itself", "effect"), *(row(f"`{flag}`", plain(text)) for flag, text in own),
             "", plain(codes), ""]
    for command in found:
        page += [f"## {command.name}", "", f"`bergtow {command.name} [OPTION...] {command.operands}`", "",
                 plain(command.about), ""]
        options = [o for o in command.options if not {"--help", "--usage", "--version"} & {*o.flags}]
        if options:
            page += head("option", "effect")
            page += [row(", ".join(f"`{f}`" for f in o.flags) + (f" `{o.arg}`" if o.arg else ""), plain(o.text))
                     for o in options] + [""]
    write(folder / "commands.md", "\n".join(page))
