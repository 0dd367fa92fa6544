"""The functions of `femupdate` for people: they show their progress in sessions."""

import functools
import sys
from typing import Any

from femupdate import interface
from femupdate.bars import Bars


def __getattr__(name: str) -> Any:
    verb = getattr(interface, name)
    # Someone waits: at a prompt, or in a notebook.
    if "progress" not in verb.__annotations__ or not (
        hasattr(sys, "ps1") or "ipykernel" in sys.modules
    ):
        return verb

    @functools.wraps(verb)
    def shown(*args: Any, **kwargs: Any) -> Any:
        with Bars() as bars:
            return verb(*args, **{"progress": bars, **kwargs})

    return shown
