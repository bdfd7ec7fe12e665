"""One BLAS thread for small matrices, however deep the blocks lie in each other."""

import pytest
from threadpoolctl import threadpool_info

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
