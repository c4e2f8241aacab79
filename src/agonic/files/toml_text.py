"""Values as TOML has them."""

from __future__ import annotations

import json
from typing import Any


def write_value(value: Any) -> str:
    r"""A text, number or list as a value of TOML: as in JSON, but for the delete character.

    >>> write_value('a "b"'), write_value([1.5, 2])
    ('"a \\"b\\""', '[1.5, 2]')
    """
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
