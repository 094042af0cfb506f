"""Many small matrices: a pool of BLAS threads would only spin."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="package")
def one_blas_thread():
    with threadpool_limits(limits=1, user_api="blas"):
        yield
