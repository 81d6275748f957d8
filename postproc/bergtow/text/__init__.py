# SPDX-License-Identifier: MIT
"""Tables and sentences of what was found, at the terminal and as Markdown."""
