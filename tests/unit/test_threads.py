from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_info, threadpool_limits

from sma_bayes import threads
from sma_bayes.threads import one_thread


def threads_of_linear_algebra() -> set[int]:
    np.ones((200, 200)) @ np.ones((200, 200))  # so that the library has its threads up
    return {int(pool["num_threads"]) for pool in threadpool_info()}


def test_linear_algebra_has_one_thread_and_then_as_many_as_before() -> None:
    with threadpool_limits(limits=2):
        before = threads_of_linear_algebra()
        for _ in range(2):
            with one_thread():
                assert threads_of_linear_algebra() == {1}
            assert threads_of_linear_algebra() == before != {1}


def test_libraries_are_looked_for_again_only_where_modules_were_imported_since(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: list[ThreadpoolController] = []

    class Counted(ThreadpoolController):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            looked.append(self)

    monkeypatch.setattr(threads, "ThreadpoolController", Counted)
    threads._controller.cache_clear()
    for expected in (1, 1):
        with one_thread():
            assert len(looked) == expected
    monkeypatch.setitem(sys.modules, "sma_bayes_of_no_use", ModuleType("sma_bayes_of_no_use"))
    with one_thread():
        assert len(looked) == 2
    threads._controller.cache_clear()
