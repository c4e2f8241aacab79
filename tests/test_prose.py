"""What a user reads is plain English: turns of phrase that needed a second reading stay out."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / "docs").glob("[!l]*.md"),
    *(ROOT / "docs" / "jobs").glob("*.md"),
    ROOT / "README.md",
]

INSTEAD = {
    r"beg[iau]ns? anew|begin anew|made anew|writes? .* anew|learnt anew": "start again, again",
    r"all the same(?= (and|that|\())|right all the same|found all the same": "still, nevertheless",
    r"\bto and fro\b": "back and forth",
    r"\b(told|tell) apart\b": "separated",
    r"\bmend\b": "correct, repair",
    r"\b(passed over|left aside|lets? go of|laid aside)\b": "skipped, not used",
    r"\bgoes on running|\bruns on\b|what ran before": "stays in use",
    r"\bcount(s|ing)? as one\b": "effective sample size",
    r"\berrs\b|\berr by\b": "has an error of",
    r"\bboasts?\b|the prior's word|what swings|as things were|late beside": "see the field's words",
    r"(?<!there )\b(is|are) no (number|time|place|rotation|mounting|plan|box|sensor|column)\b":
        "is not a …",
    r"\bis none; ": "is not possible",
    r"\bas much: |off by as much\b|wrong by as much\b": "by the same amount",
    r"\b(does|do|did) so oppositely\b|\bdisturb\w* oppositely\b": "with opposite signs",
    r"\bof then\b|\bof the place too\b": "in force at that time",
    r"\bstray(s|ed)?\b(?!_nT)": "outlier",
    r"\btaught|\bteacher\b": "reference, aided by attitude",
    r"\bforetold|\bforetell\b": "predicted",
}  # fmt: skip
"""A phrase, and what is said instead."""


def said_by(path: Path) -> Iterator[tuple[int, str]]:
    """Sentences of a module or lines of a page, with their numbers."""
    if path.suffix == ".md":
        yield from enumerate(path.read_text("utf-8").splitlines(), start=1)
        return
    tree = ast.parse(path.read_text("utf-8"))
    notes = set() if "command" in str(path.relative_to(ROOT)) else set(map(id, docstrings(tree)))
    for node in ast.walk(tree):
        if id(node) in notes:
            continue
        if isinstance(node, ast.JoinedStr):
            parts = [part.value for part in node.values if isinstance(part, ast.Constant)]
            yield node.lineno, " … ".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


def docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    """What stands alone in a body; in modules of commands it is their help."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node.value


def is_sentence(text: str) -> bool:
    return len(re.findall(r"[A-Za-z]{2,}", text)) >= 4 and "\n\n" not in text


@pytest.mark.parametrize("folder", sorted(p.name for p in (ROOT / "src/agonic").iterdir()))
def test_findings_errors_and_helps_are_plain(folder: str) -> None:
    path = ROOT / "src/agonic" / folder
    modules = path.rglob("*.py") if path.is_dir() else [path] * (path.suffix == ".py")
    assert not list(find_turns_of_phrase(modules))


def test_pages_are_plain() -> None:
    assert not list(find_turns_of_phrase(PAGES))


def test_a_turn_of_phrase_is_found(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("The clock begins anew at every station.\n")
    [found] = find_turns_of_phrase([tmp_path / "page.md"])
    assert found.endswith("'begins anew'; say: start again, again")


def find_turns_of_phrase(paths: Iterator[Path] | list[Path]) -> Iterator[str]:
    for path in paths:
        for line, text in said_by(path):
            if not is_sentence(text):
                continue
            for phrase, better in INSTEAD.items():
                if found := re.search(phrase, text):
                    yield f"{path.name}:{line}: {found[0]!r}; say: {better}"
