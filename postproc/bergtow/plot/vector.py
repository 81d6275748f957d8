# SPDX-License-Identifier: MIT
"""A figure as SVG for an HTML page: its colours follow the page's light or dark scheme, and its text remains text.

Each colour of style.DARK becomes a CSS variable, so that one drawing serves the light, the dark and the printed page;
all other colours, those of ice and water, are fixed. Rejected: two drawings, of which the browser shows one; they
double the page size. Text is kept as text, in the font used to compute its size or in Verdana, whose letters are as
wide; as outlines it could be neither searched nor copied.
"""
import io
import re

from bergtow.plot import style

import matplotlib

FONTS = "'DejaVu Sans', 'Bitstream Vera Sans', Verdana, sans-serif"
_COLOUR = re.compile(r"#[0-9a-f]{6}\b")


def variable(colour):
    return f"--figure-{colour.lstrip('#')}"


def styles():
    """Values of the variables, in light and dark: (light, dark), each the body of a CSS rule."""
    return tuple(" ".join(f"{variable(light)}: {(light, dark)[k]};" for light, dark in style.DARK.items())
                 for k in (0, 1))


def _unique(text, name):
    """Prefix every identifier with the name of the figure, because a page contains several figures."""
    text = re.sub(r'\bid="', f'id="{name}-', text)
    return re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)


def of_figure(figure, name, title):
    """The <svg> of a figure; the title is for readers who cannot see it."""
    file = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(file, format="svg", metadata={key: None for key in ("Date", "Creator", "Format", "Type")})
    text = file.getvalue()
    text = text[text.index("<svg"):]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r"<style[^>]*>.*?</style>\s*", "", text, flags=re.S)  # it would apply to all elements of the page
    text = text.replace("'DejaVu Sans'", FONTS)
    text = re.sub(r'style="[^"]*"', lambda found: _COLOUR.sub(
        lambda c: f"var({variable(c[0])})" if c[0] in style.DARK else c[0], found[0]), text)
    head, body = text.split(">", 1)
    view = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', head)
    escaped = title.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
    return (f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
            f'aria-label="{escaped}" viewBox="{view[0][9:-1]}">' + _unique(body, name))
