"""One BLAS thread for small matrices, however deep the blocks lie in each other, in however many threads."""

from threading import Event, Thread

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from tensctl.threads import one_blas_thread


def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_a_block_within_a_block_leaves_the_limit_to_the_outer_one():
    before, within = threads(), one_blas_thread()(threads)
    with one_blas_thread():
        assert within() == {1}
        assert threads() == {1}
    assert threads() == before


def test_the_limit_ends_with_an_error_too():
    before = threads()
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        raise ZeroDivisionError
    assert threads() == before
    with one_blas_thread():
        assert threads() == {1}


def test_the_last_of_two_threads_to_leave_ends_the_limit():
    """The other one enters within the first's block and leaves after it; two threads are asked for on any machine."""
    with threadpool_limits(2, user_api="blas"):
        before, within, after = overlapping()
    assert 2 in before
    assert within == {1}
    assert after == before


def overlapping():
    """BLAS threads before two blocks that overlap, in the second when the first is left, and after both."""
    before, entered, left, seen = threads(), Event(), Event(), []

    def other():
        with one_blas_thread():
            entered.set()
            left.wait(10)
            seen.append(threads())

    beside = Thread(target=other)
    with one_blas_thread():
        beside.start()
        entered.wait(10)
    left.set()
    beside.join()
    return before, seen[0], threads()
