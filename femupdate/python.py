"""The functions of `femupdate` for people: messages in Python's words, progress in notebooks."""

import functools
import sys
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from femupdate import interface
from femupdate.errors import FemupdateError, in_python

P = ParamSpec("P")
T = TypeVar("T")


class NotebookBars:
    """Progress as bars of a notebook."""

    def __init__(self) -> None:
        self._bar: Any = None

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        from tqdm.auto import tqdm

        self.close()
        self._bar = tqdm(total=total, desc=label, leave=False)

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(min(count, self._bar.total - self._bar.n))

    def say(self, text: str) -> None:
        """Write a line above the bar."""
        from tqdm.auto import tqdm

        tqdm.write(in_python(text))

    def close(self) -> None:
        """End the bar."""
        if self._bar is not None:
            self._bar.close()


def _spoken(verb: Callable[P, T]) -> Callable[P, T]:
    shows = "progress" in verb.__annotations__

    @functools.wraps(verb)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> T:
        shell = sys.modules.get("IPython")
        in_notebook = shell is not None and hasattr(shell.get_ipython(), "kernel")
        bars = NotebookBars() if shows and "progress" not in kwargs and in_notebook else None
        try:
            if bars is not None:
                kwargs["progress"] = bars
            return verb(*args, **kwargs)
        except FemupdateError as error:
            error.args = (in_python(str(error)),)
            raise
        finally:
            if bars is not None:
                bars.close()

    return wrapper


calibrate = _spoken(interface.calibrate)
compare = _spoken(interface.compare)
diagnose = _spoken(interface.diagnose)
inspect = _spoken(interface.inspect)
predict = _spoken(interface.predict)
reduce = _spoken(interface.reduce)
repair = _spoken(interface.repair)
simulate = _spoken(interface.simulate)
status = _spoken(interface.status)
train = _spoken(interface.train)
write_report = _spoken(interface.write_report)
