"""Formulas of docstrings, written as plain text for `help()`, as MathML: no script, no network.

`field_n`, `Wᵀ`, `x²`, `√(a + b)`, `|u|` and `(a + b)/c` become subscripts, superscripts, roots,
bars and fractions; `matrix @ raw` a product; words of several letters stand upright.
"""

from __future__ import annotations

import re
from html import escape
from typing import NamedTuple

RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ᵀᵃᵇᶜᵏⁿ", "0123456789−+Tabckn")
LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉ₓᵢⱼ₊₋", "0123456789xij+−")
_TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<name>[^\W\d_]\u0302?(?:[^\W\d_]|(?<=[^\W\d_])\d)*(?:_[A-Za-z0-9]+)*)"
    r"|(?P<number>\d+(?:\.\d+)?)|(?P<sign>.)",
    re.DOTALL,
)
_SUPERSCRIPTS, _SUBSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ᵀᵃᵇᶜᵏⁿ", "₀₁₂₃₄₅₆₇₈₉ₓᵢⱼ₊₋"
_CLOSING = {"(": ")", "[": "]", "|": "|", "⟨": "⟩", "{": "}"}


class Token(NamedTuple):
    """A piece of a formula, and whether a space stands before it."""

    kind: str
    text: str
    apart: bool


def typeset_formula(text: str) -> str:
    """A formula as MathML that stands by itself.

    >>> typeset_formula("u = W x²").count("<msup>")
    1
    >>> typeset_formula("r = (|u| − F)/|s|").count("<mfrac>")
    1
    """
    tokens = list(_split(text.strip()))
    made, _ = _row(tokens, 0, "")
    return f'<math display="block">{"".join(made)}</math>'


def _split(text: str) -> list[Token]:
    """The tokens; signs above and below the line in runs of their own."""
    text = re.sub(f"([{_SUPERSCRIPTS}]+)", "\x01\\1\x02", text)
    text = re.sub(f"([{_SUBSCRIPTS}]+)", "\x03\\1\x02", text)
    tokens, apart, at = [], False, 0
    while at < len(text):
        if text[at] in "\x01\x03":
            end = text.index("\x02", at)
            kind = "raised" if text[at] == "\x01" else "lowered"
            tokens.append(Token(kind, text[at + 1 : end], False))
            at, apart = end + 1, False
            continue
        found = _TOKEN.match(text, at)
        assert found is not None
        kind = str(found.lastgroup)
        if kind == "space":
            apart = True
        else:
            tokens.append(Token(kind, found[0], apart))
            apart = False
        at = found.end()
    return tokens


def _row(tokens: list[Token], at: int, closing: str) -> tuple[list[str], int]:
    """Elements up to a closing sign, and where it stands."""
    made: list[str] = []
    operand = False  # whether the last element is one
    while at < len(tokens):
        token = tokens[at]
        if closing and token.text == closing and (closing != "|" or operand):
            return made, at
        if token.kind == "sign" and token.text == "/" and made and not token.apart and operand:
            below, at = _atom(tokens, at + 1)
            made[-1] = f"<mfrac>{_bare(made[-1])}{_bare(below)}</mfrac>"
        elif token.kind in ("name", "number") or token.text in "(|[⟨{√":
            if token.apart and operand:
                made.append('<mspace width="0.28em"/>')
            element, at = _atom(tokens, at)
            made.append(element)
            operand = True
        else:
            made.append(_operator(token))
            at, operand = at + 1, token.text in ")…′"
    return made, at


def _atom(tokens: list[Token], at: int) -> tuple[str, int]:
    """An operand with what stands above and below it, and where the next begins."""
    if at >= len(tokens):
        return "<mrow></mrow>", at
    token = tokens[at]
    if token.text == "√":
        inside, at = _atom(tokens, at + 1)
        made = f"<msqrt>{_bare(inside)}</msqrt>"
    elif token.text in _CLOSING:
        inside_row, end = _row(tokens, at + 1, _CLOSING[token.text])
        close = tokens[end].text if end < len(tokens) else ""
        made = f"<mrow>{_fence(token.text)}<mrow>{''.join(inside_row)}</mrow>{_fence(close)}</mrow>"
        at = end + 1
    else:
        made, at = _leaf(token), at + 1
    while at < len(tokens) and tokens[at].kind in ("raised", "lowered"):
        raised = tokens[at].kind == "raised"
        script = tokens[at].text.translate(RAISED if raised else LOWERED)
        tag = "msup" if raised else "msub"
        made = f"<{tag}>{made}<mrow>{_script(script)}</mrow></{tag}>"
        at += 1
    if at < len(tokens) and tokens[at].text == "^":
        power, at = _atom(tokens, at + 1)
        made = f"<msup>{made}{_bare(power)}</msup>"
    return made, at


def _leaf(token: Token) -> str:
    """A name with its subscripts, a number, or a sign that stands for an operand."""
    if token.kind == "number":
        return f"<mn>{token.text}</mn>"
    if token.kind != "name":
        return _operator(token)
    base, *below = token.text.split("_")
    made = _name(base)
    if below:
        made = f"<msub>{made}<mrow>{'<mo>,</mo>'.join(map(_name, below))}</mrow></msub>"
    return made


def _name(text: str) -> str:
    upright = ' mathvariant="normal"' if len(text.replace("\u0302", "")) > 1 else ""
    return f"<mi{upright}>{escape(text)}</mi>"


def _script(text: str) -> str:
    parts = re.findall(r"\d+|[A-Za-z]|.", text)
    return "".join(
        f"<mn>{p}</mn>" if p.isdigit() else _name(p) if p.isalpha() else f"<mo>{p}</mo>"
        for p in parts
    )


def _fence(text: str) -> str:
    return f'<mo fence="true" stretchy="true">{escape(text)}</mo>' if text else ""


def _bare(made: str) -> str:
    """A group without its parentheses, where it stands in a fraction or under a root."""
    found = re.fullmatch(
        r'<mrow><mo fence="true" stretchy="true">\(</mo>(<mrow>.*</mrow>)'
        r'<mo fence="true" stretchy="true">\)</mo></mrow>',
        made,
    )
    return found[1] if found else made


def _operator(token: Token) -> str:
    if token.text == "@":
        return '<mspace width="0.28em"/>'
    if token.text == ",":
        return '<mo separator="true">,</mo><mspace width="0.5em"/>'
    return f"<mo>{escape(token.text)}</mo>"
