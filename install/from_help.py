#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The man page and the completions of bergtow, made from what it says of itself.

    install/from_help.py BERGTOW FOLDER

writes FOLDER/bergtow.1, bergtow.bash and _bergtow (zsh). Rejected: texts kept by hand, which fall behind the options.
"""
import os
import re
import subprocess
import sys
from pathlib import Path

OPTION = re.compile(r"^ {2,8}(?P<forms>-\S.*?)(?: {2,}(?P<text>\S.*))?$")
HERE = Path(__file__).resolve().parent
WORDS = {"DIR": "folder", "FILE": "file", "CASE.yml": "file", "STUDY.yml": "file"}


def said(program, *arguments):
    """Standard output of the program; '' and a line on stderr where it cannot say it."""
    result = subprocess.run([program, *arguments], capture_output=True, text=True,
                            env=os.environ | {"BERGTOW_HOME": str(HERE.parent)})
    if result.returncode == 0:
        return result.stdout
    print(f"from_help.py: {Path(program).name} {' '.join(arguments)}: {result.stderr.strip()}", file=sys.stderr)
    return ""


class Option:
    def __init__(self, match):
        forms = [re.match(r"([\w?-]+)(?:[ =](.+))?", form) for form in re.split(r", +(?=-)", match["forms"])]
        self.flags = [form[1] for form in forms]
        self.arg, self.text = forms[-1][2], match["text"] or ""


class Command:
    """What `bergtow NAME --help` says: usage, a paragraph, options."""

    def __init__(self, program, name, summary):
        self.name, self.summary, self.options, about = name, summary, [], []
        text = said(program, name, "--help")
        usage, _, rest = text.partition("\n" if text.startswith("Usage") else "\n\n")
        usage = re.sub(r"\s+", " ", usage)
        operands = re.search(r" ((?:CASE|STUDY|DIR|MAP|RUN|A)\b\S*(?: FILE\.h5| \[B\]| \[RUN \.\.\.\])?)$",
                             usage.strip())
        self.operands = operands[1] if operands else ""
        for line in rest.splitlines():
            match = OPTION.match(line)
            if match:
                self.options.append(Option(match))
            elif self.options and line.startswith(" " * 12):
                self.options[-1].text = f"{self.options[-1].text} {line.strip()}".strip()
            elif not self.options and not line.startswith(("positional", "options", "  ")):
                about.append(line.strip())
        self.about = re.sub(r"\s+", " ", " ".join(about)).strip() or f"{summary}."


def commands(program):
    """The commands and the program's own options, from `bergtow --help`."""
    text = said(program, "--help")
    listed = re.findall(r"^  ([a-z][a-z-]*) +(\S.*)$", text, re.MULTILINE)
    own = re.findall(r"^  (--[\w-]+) +(\S.*)$", text, re.MULTILINE)
    codes = text[text.index("Exit codes:"):]
    return [Command(program, *c) for c in listed], own, re.sub(r"\s+", " ", codes).strip()


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def options_of(command):
    out = []
    for o in command.options:
        arg = f"=\\fI{roff(o.arg)}\\fR" if o.arg else ""
        out += [".TP", ", ".join(f"\\fB{roff(f)}\\fR" for f in o.flags) + arg, roff(o.text)]
    return out


def terms(pairs):
    return [line for name, text in pairs for line in (".TP", f"\\fB{name}\\fR", text)]


def man_page(found, own, codes, version):
    out = [f'.TH BERGTOW 1 "" "bergtow {version}" "User Commands"', ".SH NAME",
           "bergtow \\- simulate a body that is towed through broken sea ice", ".SH SYNOPSIS"]
    for c in found:
        out += [".B bergtow " + c.name, "[\\fIOPTION\\fR...] \\fI" + roff(c.operands) + "\\fR", ".br"]
    out += [".SH OPTIONS"]
    for flag, text in own:
        out += [".TP", f"\\fB{roff(flag)}\\fR", roff(text)]
    out += [".SH COMMANDS"]
    for c in found:
        out += [f".SS bergtow {c.name} [\\fIOPTION\\fR...] \\fI{roff(c.operands)}\\fR", roff(c.about)]
        out += options_of(c)
    out += [".SH EXIT STATUS", roff(codes.removeprefix("Exit codes: ")), ".SH ENVIRONMENT",
            *terms([("OMP_NUM_THREADS", "threads of a rank unless option or case sets them"),
                    ("BERGTOW_MPI", "yes or no: start MPI, or not"),
                    ("BERGTOW_DIVIDE", "always: all ranks share the field, even where one alone would be faster"),
                    ("BERGTOW_HOME", "folder that holds postproc/, where the Python package is"),
                    ("PYTHON", "Python of the commands that the package has; default /usr/bin/python3")])]
    return "\n".join(['.\\" made by install/from_help.py', *out]) + "\n"


def with_values(found):
    """The options that take a file, and those that take something else, as patterns of bash."""
    takes_file = sorted({f for c in found for o in c.options if o.arg and WORDS.get(o.arg) for f in o.flags})
    takes_word = sorted({f for c in found for o in c.options if o.arg and not WORDS.get(o.arg) for f in o.flags}
                        - set(takes_file))
    return "|".join(takes_file) or "''", "|".join(takes_word) or "''"  # none, where Python lacks what --help needs


def bash(found, own):
    cases = [f"    {c.name}) options='{' '.join(f for o in c.options for f in o.flags)}' ;;" for c in found]
    takes_file, takes_word = with_values(found)
    return "\n".join([
        "# bash completion of bergtow, made by install/from_help.py", "_bergtow()", "{",
        "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} options=", "    COMPREPLY=()",
        "    if [ \"$COMP_CWORD\" -eq 1 ]; then",
        f"        COMPREPLY=($(compgen -W '{' '.join([c.name for c in found] + [f for f, _ in own])}' -- \"$word\"))",
        "        return", "    fi", "    case $before in", f"    {takes_word}) return ;;",
        f"    {takes_file}) COMPREPLY=($(compgen -f -- \"$word\")); return ;;", "    esac",
        "    case ${COMP_WORDS[1]} in", *cases, "    esac", "    case $word in",
        "    -*) COMPREPLY=($(compgen -W \"$options\" -- \"$word\")) ;;",
        "    *) COMPREPLY=($(compgen -f -- \"$word\")) ;;", "    esac", "}",
        "complete -o filenames -F _bergtow bergtow", ""])


def quoted(text):
    """A text inside a specification of _arguments in single quotes."""
    return re.sub(r"([\[\]:\\])", r"\\\1", text).replace("'", "'\\''")


def zsh_options(command):
    out = []
    for o in command.options:
        value = f":{quoted(o.arg)}:{'_files' if WORDS.get(o.arg) else ' '}" if o.arg else ""
        equals = "=" if o.arg else ""
        for flag in o.flags:
            out.append(f"    '{flag}{equals if flag.startswith('--') else ''}[{quoted(o.text)}]{value}' \\")
    return out + ["    '*:file:_files'"]


def zsh(found, own):
    out = ["#compdef bergtow", "# made by install/from_help.py", "local -a commands options", "commands=("]
    out += [f"  '{c.name}:{quoted(c.summary)}'" for c in found] + [")"]
    out += ["if (( CURRENT == 2 )); then", "  _describe command commands",
            "  options=(" + " ".join(f"'{flag}:{quoted(text)}'" for flag, text in own) + ")",
            "  _describe option options", "  return", "fi", "shift words; (( CURRENT-- ))", "case $words[1] in"]
    for c in found:
        out += [f"  {c.name}) _arguments -s \\", *zsh_options(c)]
        out[-1] += " ;;"
    return "\n".join(out + ["esac", ""])


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    found, own, codes = commands(program)
    version = said(program, "--version").split()[1]
    (folder / "bergtow.1").write_text(man_page(found, own, codes, version))
    (folder / "bergtow.bash").write_text(bash(found, own))
    (folder / "_bergtow").write_text(zsh(found, own))


if __name__ == "__main__":
    main()
