"""Optional dependencies: imported where they are used, and asked for by the name of the extra that brings them."""

from __future__ import annotations

import importlib
from types import ModuleType


def need(module: str, extra: str) -> ModuleType:
    """An optional module.

    Raises:
        ImportError: it is not installed; the error names the extra that brings it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.split(".")[0]:
            raise
        raise ImportError(f"this needs {module}; install it with: pip install 'articulated[{extra}]'") from None
