# SPDX-License-Identifier: MIT
"""Tables and sentences of results, at the terminal and as Markdown."""
