# SPDX-License-Identifier: MIT
"""Exit codes and exceptions: one table and one hierarchy for the library, the functions and the commands."""
from __future__ import annotations

import copyreg
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Optional, Union

#: exit codes of the commands, those of bt_status (bergtow/base.h); IO also for numbers that members are missing from
OK, USAGE, CASE, IO, NUMERIC, SIGNAL = 0, 2, 3, 4, 5, 6


class Message(NamedTuple):
    """A message of the program, as written with BERGTOW_MESSAGES=json. code: its kind, for callers that act on it."""
    text: str
    code: Optional[str] = None
    warning: bool = False

    def __str__(self) -> str:
        return "warning: " * self.warning + self.text + (f" [{self.code}]" if self.code else "")


class BergtowError(Exception):
    """A request that cannot be fulfilled; the text gives the reason and the remedy. status: the exit code of a command
    that ends with this error."""

    def __init__(self, text: str, status: int = USAGE) -> None:
        super().__init__(text)
        self.status = status

    def __reduce__(self) -> tuple[object, ...]:
        # not by the constructors, whose arguments are not kept: a Pool hangs on an exception that it cannot load
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]


class CaseError(BergtowError, ValueError):
    """A case that is rejected; the text has one line for each error, with key and remedy."""


class RunError(BergtowError):
    """A folder or a file that cannot be used: "path: reason; remedy"."""

    def __init__(self, path: Union[str, os.PathLike[str]], reason: str, remedy: str, status: int = IO) -> None:
        super().__init__(f"{path}: {reason}; {remedy}", status)
        self.path, self.reason, self.remedy = Path(path), reason, remedy


class Refused(RunError):
    """An input that the program rejects, with the errors from its messages and its exit code. otherwise: the reason, in
    case the messages give none."""

    def __init__(self, path: Union[str, os.PathLike[str]], said: Sequence[Message], status: int,
                 otherwise: str) -> None:
        self.errors = [message for message in said if not message.warning] or [Message(otherwise)]
        self.path, self.reason, self.remedy = Path(path), "\n".join(map(str, self.errors)), ""
        BergtowError.__init__(self, self.reason, status)
