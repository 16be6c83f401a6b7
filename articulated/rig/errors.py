"""What is said of a rig that cannot be used, and where in its source it is wrong."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches


class RigError(ValueError):
    """A rig is malformed or cannot be simulated.

    Attributes:
        source: the file, or the name of a rig built in Python.
        line: line in the file, or None.
        element: what is wrong there, such as "joint 'left_knee'".
        reason: what is wrong with it.
        remedy: what to do about it.
    """

    def __init__(self, source: str, line: int | None, element: str, reason: str, remedy: str = ""):
        self.source, self.line, self.element, self.reason, self.remedy = source, line, element, reason, remedy
        where = source if line is None else f"{source}:{line}"
        super().__init__(": ".join(part for part in (where, element, reason) if part) + (f"; {remedy}" if remedy else ""))

    def __reduce__(self):
        return RigError, (self.source, self.line, self.element, self.reason, self.remedy)


class RigWarning(UserWarning):
    """Something in a rig was dropped, guessed or looks like a mistake."""


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """The end of a message about a name that is not known: those of the known ones that look like it, if any do."""
    close = get_close_matches(str(name), list(known), n=3)
    return f"; did you mean {' or '.join(map(repr, close))}?" if close else ""


@dataclass(frozen=True)
class Place:
    """Where in a source an element stands."""

    source: str
    element: str = ""
    line: int | None = None

    def error(self, reason: str, remedy: str = "") -> RigError:
        return RigError(self.source, self.line, self.element, reason, remedy)

    def warn(self, reason: str, remedy: str = "") -> None:
        """Warn of this element, on behalf of whoever called the project."""
        message = str(self.error(reason, remedy))
        warnings.warn(message, RigWarning, stacklevel=_outside())


def _outside() -> int:
    """The stack level of the first caller outside this package."""
    import sys

    level, frame = 2, sys._getframe(2)
    while frame is not None and str(frame.f_globals.get("__name__", "")).split(".")[0] == "articulated":
        frame, level = frame.f_back, level + 1
    return level
