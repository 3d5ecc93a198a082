"""How far long calls are: a bar of tqdm, records of the logger ``sightline``, or a function that is told."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ._extra import missing

#: Seconds that a call takes before a bar or a record says how far it is.
DELAY = 2.0
#: Seconds between two records.
EVERY = 10.0

#: Silent unless the application sets logging up, as ``logging.basicConfig(level="INFO")`` does.
logger = logging.getLogger("sightline")
logger.addHandler(logging.NullHandler())


@dataclass(frozen=True)
class Progress:
    """How far a call is. A call may go through several kinds of work, one after the other."""

    #: Steps done of the work under way.
    done: int
    #: Steps in all, at most.
    total: int
    #: Since the work under way began.
    seconds: float
    #: Until it ends at the rate so far; ``None`` before anything is done.
    seconds_left: float | None
    #: Name of the steps, as ``"placements"``.
    work: str = ""


#: ``None``: a bar where tqdm is installed and stderr is a terminal or a notebook, else records. ``True``: a bar.
#: ``False``: nothing. A function is called with each :class:`Progress`, at most ten times a second.
Wanted = bool | Callable[[Any], object] | None


class Reporter:
    """Shows steps of a call; to be closed."""

    def __init__(self, progress: Wanted, seconds: float = 0.0) -> None:
        """``seconds`` is how long the call has taken so far. Raises ``ImportError`` for ``True`` without tqdm."""
        self._progress = progress
        self._begun = self._work_begun = time.monotonic() - seconds
        self._work: str | None = None
        self._first = 0
        self._bar: Any = None
        self._bars = _bars() if progress is True or (progress is None and _is_watched()) else None
        if progress is True and self._bars is None:
            raise missing("tqdm", "progress")
        self._logged: float | None = None

    def __call__(self, work: str, done: int, total: int) -> None:
        """Shows that ``done`` of ``total`` steps are done. An exception of a function goes on to the caller."""
        now = time.monotonic()
        if work != self._work:
            if self._work is not None:
                self._work_begun, self._first = now, done
            self._work = work
            self._put_away()
        if self._progress is False:
            return
        if callable(self._progress):
            self._progress(self._at(now, done, total))
        elif now - self._begun < DELAY:
            return
        elif self._bars is not None:
            self._draw(self._bars, work, done, total, now)
        elif self._logged is None or now - self._logged >= EVERY:
            self._logged = now
            logger.info("%s", _sentence(self._at(now, done, total)))

    def close(self) -> None:
        """Takes the bar away; says how long a call took that was recorded."""
        self._put_away()
        if self._logged is not None:
            logger.info("%s: ended after %s", self._work, _time(time.monotonic() - self._begun))

    def _at(self, now: float, done: int, total: int) -> Progress:
        seconds, steps = now - self._work_begun, done - self._first
        left = seconds * max(total - done, 0) / steps if steps > 0 else None
        return Progress(done, total, seconds, left, self._work or "")

    def _draw(self, bars: Callable[..., Any], work: str, done: int, total: int, now: float) -> None:
        if self._bar is None:
            self._bar = bars(total=total, desc=work, initial=self._first, leave=False, file=sys.stderr)
            self._bar.start_t -= now - self._work_begun
        self._bar.total = total
        self._bar.update(done - self._bar.n)

    def _put_away(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextmanager
def shown(progress: Wanted) -> Iterator[Reporter]:
    """A reporter that is closed at the end. Raises ``ValueError`` for another ``progress`` than calls take."""
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise ValueError(f"progress: is {progress!r:.60}; give True, False, None or a function")
    reporter = Reporter(progress)
    try:
        yield reporter
    finally:
        reporter.close()


def _is_watched() -> bool:
    """Whether somebody sees a bar on stderr: a terminal or a notebook."""
    if "ipykernel" in sys.modules:
        return True
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):
        # None without a console, closed by others.
        return False


def _bars() -> Callable[..., Any] | None:
    """The class of bars; ``None`` without tqdm."""
    try:
        with warnings.catch_warnings():
            # A notebook without widgets gets bars of text, and no advice to install some.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm  # type: ignore[no-any-return]


def _sentence(at: Progress) -> str:
    share = f"{100 * at.done / at.total:.0f} %" if at.total else "0 %"
    left = "" if at.seconds_left is None else f", {_time(at.seconds_left)} left"
    return f"{at.work}: {at.done} of {at.total}, {share}{left}"


def _time(seconds: float) -> str:
    """Seconds in words, in two units at most."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
