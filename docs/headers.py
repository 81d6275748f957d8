# SPDX-License-Identifier: MIT
"""Pages of the manual from the public headers: what a header says at its head, then its declarations with the comments
above or beside them. Functions become entries of Sphinx's C domain, so that index and search find them; anything else
is shown as it stands."""
import re

from tables import plain, write

ATTRIBUTE = re.compile(r"\s*__attribute__\s*\(\(.*?\)\)(?=\s*[;,])", re.S)
FOR_CPP = re.compile(r"^#ifdef __cplusplus\b.*?^#endif\n|^BT_(?:BEGIN|END)_C\n", re.S | re.M)
NAME = re.compile(r"\b(bt_\w+|BT_\w+)\s*\(")


def parts(text):
    """(comment lines, declaration) of a header, in order; a comment without a declaration has ''."""
    comment, declaration, depth = [], [], 0
    for line in text.splitlines():
        bare = re.sub(r"//.*", "", line)
        if not declaration and line.startswith("//"):
            comment.append(line.lstrip("/!").removeprefix(" "))
            continue
        if not declaration and not line.strip():
            if comment:
                yield comment, ""
            comment = []
            continue
        if not declaration and re.match(r"#(?!define)|#define \w+_H$", line):
            if comment:
                yield comment, ""
            comment = []
            continue
        declaration.append(line)
        depth += bare.count("{") + bare.count("(") - bare.count("}") - bare.count(")")
        ends = bare.rstrip().endswith((";", "}")) if not declaration[0].startswith("#define") else \
            not line.endswith("\\")
        if depth == 0 and ends:
            yield comment, "\n".join(declaration)
            comment, declaration = [], []


def prototype(declaration):
    """The prototype of a function in one line, or None."""
    bare = ATTRIBUTE.sub("", re.sub(r"//.*", "", declaration))
    if "{" in bare or bare.startswith(("typedef", "#define", "extern", "enum", "struct", "static const")):
        return None
    one = " ".join(bare.split()).rstrip(";").replace("_Noreturn ", "")
    return one if NAME.search(one) and one.endswith(")") else None


def paragraph(comment):
    """Comment lines as Markdown: indented lines are formulas and tables, and keep their shape."""
    out, code = [], False
    for line in comment:
        if line.startswith("  ") != code and line.strip():
            code = not code
            out += ["", "```text"] if code else ["```", ""]
        out.append(line if code else plain(line.strip()))
    return out + (["```"] if code else [])


def beside(declaration):
    """Comments behind a declaration."""
    return [m.strip() for m in re.findall(r"//+<?\s?(.*)", declaration)]


def page(path):
    text = FOR_CPP.sub("", path.read_text(encoding="utf-8").split("*/")[-1])
    text = re.sub(r"^// SPDX.*\n", "", text)
    out = [f"# bergtow/{path.name}", ""]
    for comment, declaration in parts(text):
        if not declaration:
            out += [*paragraph(comment), ""]
        elif call := prototype(declaration):
            fence = "`" * 3
            out += [f"{fence}{{c:function}} {call}", *[plain(line.strip()) for line in comment + beside(declaration)],
                    fence, ""]
        else:
            out += [*paragraph(comment), "", "```c", declaration, "```", ""]
    return "\n".join(out)


def pages(folder, out):
    names = sorted(folder.glob("*.h"))
    for path in names:
        write(out / f"{path.stem}.md", page(path))
    write(out / "index.md", "\n".join([
        "# C API", "", "The public headers, with the comments they carry. Programs begin with "
        "[simulation.h](simulation.md); an example and the contract: [the library](../../library.md).", "",
        ":::{toctree}", ":maxdepth: 1", "", *(path.stem for path in names), ":::", ""]))
