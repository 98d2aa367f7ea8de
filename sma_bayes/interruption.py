"""Signals that ask a run to end: Ctrl-C, SIGTERM, SIGHUP. Each ends it in order, with one line; its work is kept."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

SIGNALS: Final = tuple(s for name in ("SIGINT", "SIGTERM", "SIGHUP") if (s := getattr(signal, name, None)))
"""Signals that are heeded, as far as the platform has them."""

GRACE_S: Final = 10.0
"""Time for an orderly end, after which the process ends as it is [s]."""
AGAIN_S: Final = 1.0
"""How often it is looked whether the exception of a signal got lost in a library's callback [s]."""

GO_ON: Final = {
    "demo": "; the same command goes on from here",
    "fit": "; the same command with --resume goes on from here",
    "gap": "; the same command with --resume begins the study anew, or draws the report of one that is finished",
    "compare": "; the same command with --resume begins anew, or draws the report of what is finished",
    "conditions": "; the same command with --resume begins anew, or draws the report of what is finished",
    "report": "; the same command begins anew",
    "run": "; the same command with --resume goes on from here",
    "watch": "; the same command goes on from here",
}
"""What to do after an interruption, by verb."""

_received: list[int] = []
_telling = threading.Lock()
_held: list[int] | None = None
"""Signals that came while none was to end the process; None where each does."""


class Interrupted(BaseException):
    """A signal asks the process to end.

    Not a `KeyboardInterrupt`, which libraries turn into exits of their own.
    """


@contextmanager
def ending_in_order() -> Iterator[None]:
    """Heed signals inside a ``with`` block: end it with one line on standard error and the exit status of a shell.

    That is 128 and the number of the signal: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP. A signal that the
    process was started to ignore, as under ``nohup``, stays ignored, and so does every signal after the first, as long
    as what that one raised is on its way.
    """
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    try:
        yield
    except (
        BaseException
    ):  # also what follows from the signal: workers that it ended, imports that it broke off
        if not _received:
            raise
        _leave_to_tidying_up()
        _end_children()
        _say()
        sys.exit(_status())
    finally:
        _leave_to_tidying_up()


def _leave_to_tidying_up() -> None:
    """Ignore signals: the work is done."""
    for number in SIGNALS:
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_IGN)


def interrupted() -> bool:
    """Whether a signal has asked the process to end."""
    return bool(_received)


@contextmanager
def held() -> Iterator[None]:
    """Let what is in a ``with`` block go on to its end: a signal that comes meanwhile ends the process after it."""
    global _held
    _held = []
    try:
        yield
    finally:
        came, _held = _held, None
    if came:
        _interrupt(came[0], None)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _held is not None:
        _held.append(number)
        return
    if _received:
        if _ends(sys.exception()):
            return
        raise Interrupted
    _received.append(number)
    warnings.simplefilter("ignore")
    sys.unraisablehook = lambda _: None
    threading.Thread(target=_see_to_the_end, args=(number,), daemon=True).start()
    raise Interrupted


def _ends(error: BaseException | None) -> bool:
    """Whether what is being handled comes from a signal."""
    while error is not None:
        if isinstance(error, Interrupted):
            return True
        error = error.__cause__ or error.__context__
    return False


def _see_to_the_end(number: int) -> None:
    """Send the signal again where its exception got lost in a library's callback; end where tidying up hangs."""
    end = time.monotonic() + GRACE_S
    while time.monotonic() < end:
        time.sleep(AGAIN_S)
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(threading.main_thread().ident or 0, number)
    _end_children()
    _say()
    os._exit(_status())


def _status() -> int:
    return 128 + _received[0]


def _end_children() -> None:
    """End processes that were started for this one; they have nothing to say after its last line."""
    if "multiprocessing" in sys.modules:
        from multiprocessing import active_children

        for child in active_children():
            kill(child)
            child.join()


def kill(child: BaseProcess) -> None:
    """End a process at once; those of loky have no method for it but SIGTERM, which they leave to their parent."""
    if os.name != "posix":
        child.terminate()
    elif child.pid is not None:
        with suppress(ProcessLookupError):
            os.kill(child.pid, signal.SIGKILL)


def _say() -> None:
    if not _telling.acquire(blocking=False):  # either the end in order or the last resort tells
        return
    with suppress(OSError, ValueError):  # the terminal may be gone
        print(f"interrupted{GO_ON.get(next(iter(sys.argv[1:]), ''), '')}", file=sys.stderr, flush=True)
