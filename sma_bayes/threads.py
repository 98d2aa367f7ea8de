"""Linear algebra on one thread: on several it may round differently."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep the libraries for linear algebra to one thread in a ``with`` block.

    To look for these libraries among all that a process has loaded takes milliseconds, several times for each record.
    They come with modules, so they are looked for again where modules were imported since.
    """
    with _controller(len(sys.modules)).limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _controller(modules: int) -> ThreadpoolController:
    return ThreadpoolController()
