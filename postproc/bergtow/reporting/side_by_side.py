# SPDX-License-Identifier: MIT
"""One self-contained page with the reports of two runs side by side, each with its replay."""
from html import escape
from pathlib import Path

from bergtow import writing
from bergtow.reporting import page
from bergtow.result.origins import TITLE_BLOCK

STYLE = """body { margin: 0; font: 15px "DejaVu Sans", Verdana, sans-serif; color: #1d2733; background: #fff; }
header { margin: 1.2em 1.5em; } h1 { font-size: 1.4em; } pre { overflow-x: auto; font-size: 0.85em; }
main { display: flex; } section { flex: 1; min-width: 0; margin: 0 0.5em; } h2 { font-size: 1.1em; margin: 0.4em 1em; }
iframe { width: 100%; height: 88vh; border: 1px solid #dfe5ea; } img { max-width: 100%; }
"""


def write(title, words, picture, runs, path, force, size=8.0):
    """words: text below the title; picture: PNG as base64, or ""; runs: [(heading, folder)]; size: MB of each replay.
    Raises RunError."""
    given = dict.fromkeys(TITLE_BLOCK)
    sections = []
    for heading, folder in runs:
        html = page.pages(Path(folder), [Path("report.html")], given, (), size, True)[0][Path("report.html")]
        sections.append(f'<section><h2>{escape(heading)}</h2><iframe title="{escape(heading)}" '
                        f'srcdoc="{escape(html, quote=True)}"></iframe></section>')
    image = f'<img alt="map with the routes" src="data:image/png;base64,{picture}">' if picture else ""
    text = (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><meta name="generator" '
            f'content="{writing.MARK}"><title>{escape(title)}</title><style>{STYLE}</style></head><body><header>'
            f"<h1>{escape(title)}</h1><pre>{escape(words)}</pre>{image}</header><main>{''.join(sections)}</main></body>"
            "</html>\n")
    writing.write_text(text, path, force)
    print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
