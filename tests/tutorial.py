#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""A tutorial of docs/tutorials as a newcomer follows it: in a clean copy of the sources, by the page's words alone.

Blocks are taken in their order. `sh` is run by a shell that ends at the first error; what comes under "Save ... as
`NAME`:" is written to that file; `text` must have been printed by the command before, line by line; `console` is for a
cluster, and is not run. Any other block is an error: there is nothing on a page that no one has tried.

    tests/tutorial.py SOURCES [COMMAND...]      all of them, one after the other, in the folder SOURCES; each shell is
                                                started by COMMAND, which may enter a machine of its own (roots.sh)
"""
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from harness import ROOT, environment

BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
SAVE = re.compile(r"\b[Ss]ave\b[^`]*\bas\s+`([\w./-]+)`[^`]*\Z|\band\s+this\s+as\s+`([\w./-]+)`[^`]*\Z")
FILES = ("yaml", "python", "c")
CLUSTER = ("sbatch", "squeue", "srun")
NOT_A_NEWCOMERS = ("BERGTOW", "PYTHONPATH", "MAKEFLAGS", "OMPI_ALLOW_RUN_AS_ROOT")  # how names of variables begin


def blocks(page):
    """(language, text, name of the file that it is saved as)"""
    text, end = page.read_text(encoding="utf-8"), 0
    for match in BLOCK.finditer(text):
        name = SAVE.search(text[end:match.start()])
        yield match[1], match[2], name and (name[1] or name[2])
        end = match.end()


def sources():
    """Names of the files that git has, or would take; of an unpacked archive all but what is built and made."""
    if not (ROOT / ".git").exists():
        return [p.relative_to(ROOT) for p in ROOT.rglob("*") if p.relative_to(ROOT).parts[0] not in ("build", "out")]
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT,
                            capture_output=True, text=True, check=True).stdout
    return filter(None, listed.split("\0"))


def clean_copy(to):
    """The sources, with the objects that are built, so that make has little to do."""
    for name in sources():
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    shutil.copytree(ROOT / "build/release", to / "build/release", symlinks=True,
                    ignore=shutil.ignore_patterns("tests", "fuzz*", "partition_quality"))


@dataclass
class Reader:
    """Someone who follows a page in a folder of sources."""

    folder: Path
    home: Path
    machine: tuple = ()  # the command that starts a shell there
    printed: str = ""
    exported: dict = field(default_factory=dict)

    def follow(self, page):
        """Errors: AssertionError, with the block at which it went wrong."""
        tried = 0
        for language, text, name in blocks(page):
            if language == "sh":
                self.run(text)
            elif language == "text":
                self.compare(text)
            elif language == "console":
                assert text.split()[0] in CLUSTER, f"not for a cluster, and not run:\n{text}"
                continue
            else:
                assert language in FILES and name, f"a block of `{language}` without a name:\n{text}"
                (self.folder / name).write_text(text, encoding="utf-8")
            tried += 1
        assert tried, page

    def run(self, text):
        self.exported |= dict(re.findall(r"^export (\w+)=(\S+)$", text, re.M))
        env = environment(HOME=self.home,
                          OMPI_MCA_rmaps_base_oversubscribe=1, MPLCONFIGDIR=self.home, PYTHONDONTWRITEBYTECODE=1)
        before = "".join(f"export {name}={value}\n" for name, value in self.exported.items())
        done = subprocess.run([*self.machine, "bash", "-e", "-o", "pipefail", "-c", before + text], cwd=self.folder,
                              env={k: v for k, v in env.items() if not k.startswith(NOT_A_NEWCOMERS)},
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=1800)
        self.printed = done.stdout
        assert done.returncode == 0, f"{text}ended with {done.returncode}:\n{done.stdout}"

    def compare(self, text):
        lines = iter(self.printed.splitlines())
        for wanted in text.splitlines():
            assert any(wanted.strip() in line for line in lines), f"not printed: {wanted}\nbut:\n{self.printed}"


def pages(sources=ROOT):
    found = sorted((Path(sources) / "docs/tutorials").glob("*.md"))
    assert found, f"no tutorials in {sources}"
    return found


def follow(name, folder):
    """A newcomer who follows one page in a clean copy below the folder; the Reader."""
    sources, home = folder / "bergtow", folder / "home"
    home.mkdir(parents=True)
    sources.mkdir()
    clean_copy(sources)
    reader = Reader(sources, home)
    reader.follow(ROOT / "docs/tutorials" / name)
    return reader


def main(sources, *machine):
    failed = 0
    for page in pages(sources):
        try:
            Reader(Path(sources), Path("/root"), machine).follow(page)
            print(f"{page.name}: followed", flush=True)
        except (AssertionError, subprocess.TimeoutExpired) as e:
            failed += 1
            print(f"{page.name}: {e}", flush=True)
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
