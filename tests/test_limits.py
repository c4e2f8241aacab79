"""Every limit that a verdict uses, with why, on one page that is made from the code.

`python -m tests.test_limits` writes it anew.
"""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "limits.md"
MODULES = ("health/evidence", "health/states", "model/verdict", "model/average", "model/posterior")
HEAD = """# Limits

What the verdict of a fit rests on, made from the code by `python -m tests.test_limits`. Facts of
the record beside them (`health/`) and the other wings have limits of their own, on the pages of
their jobs.

| limit | value | why | where |
|---|---:|---|---|
"""


def list_limits(module: str) -> list[tuple[str, str, str]]:
    """Public constants of a module with their values and docstrings."""
    body = ast.parse((ROOT / "src" / "agonic" / f"{module}.py").read_text()).body
    found = []
    for node, after in zip(body, [*body[1:], ast.Pass()], strict=True):
        if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
            continue
        name = node.targets[0].id
        if name.startswith("_") or not any(
            isinstance(part, ast.Constant) and isinstance(part.value, int | float)
            for part in ast.walk(node.value)
        ):
            continue
        told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        why = " ".join(str(after.value.value).split()) if told else ""
        found.append((name, ast.unparse(node.value), why))
    return found


def write_page() -> str:
    """The page."""
    rows = [
        f"| `{name}` | {value} | {why} | `{module}` |\n"
        for module in MODULES
        for name, value, why in list_limits(module)
    ]
    return HEAD + "".join(rows)


def test_the_page_of_limits_is_that_of_the_code() -> None:
    assert PAGE.read_text() == write_page(), "python -m tests.test_limits writes it anew"


def test_every_limit_says_why() -> None:
    silent = [name for module in MODULES for name, _, why in list_limits(module) if not why]
    assert silent == []


if __name__ == "__main__":
    PAGE.write_text(write_page())
