# SPDX-License-Identifier: MIT
"""Tables and sentences of results, for the terminal and as Markdown."""
