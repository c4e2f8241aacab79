"""What all tests share: one thread a process, and examples that run where they are written."""

from __future__ import annotations

import os
import sys

import pytest

# a process for each core already works; threads of the linear algebra only wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out examples of functions that a package only offers: their module runs them."""
    offered = [item for item in items if _is_offered(item)]
    if offered:
        config.hook.pytest_deselected(items=offered)
        items[:] = [item for item in items if item not in set(offered)]


def _is_offered(item: pytest.Item) -> bool:
    """Whether an item is the docstring of a public function, found in the package's names."""
    package, _, name = item.name.rpartition(".")
    if not isinstance(item, pytest.DoctestItem) or item.path.name != "__init__.py":
        return False
    return hasattr(getattr(sys.modules.get(package), name, None), "__wrapped__")
