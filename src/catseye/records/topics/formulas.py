"""Formulas in TeX as one line of Unicode, for terminals."""

import re
from collections.abc import Iterator
from unicodedata import normalize

TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
SYMBOLS = {
    **dict(zip(("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta"), "αβγδεζηθ", strict=True)),
    **dict(zip(("iota", "kappa", "lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau"), "ικλμνξπρστ", strict=True)),
    **dict(zip(("upsilon", "phi", "chi", "psi", "omega"), "υφχψω", strict=True)),
    **dict(zip(("Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma"), "ΓΔΘΛΞΠΣ", strict=True)),
    **dict(zip(("Phi", "Psi", "Omega", "varepsilon", "varphi", "vartheta"), "ΦΨΩεφϑ", strict=True)),
    **dict(zip(("cdot", "times", "pm", "mp", "infty", "partial", "nabla"), "·×±∓∞∂∇", strict=True)),
    **dict(zip(("sum", "prod", "int", "in", "ldots", "dots", "cdots"), "∑∏∫∈………", strict=True)),
    **dict(zip(("circ", "prime", "top", "mid", "ell", "hbar", "degree"), "°′ᵀ|ℓħ°", strict=True)),
    **dict(zip(("leq", "le", "geq", "ge", "neq", "ne", "approx", "sim"), "≤≤≥≥≠≠≈~", strict=True)),
    **dict(zip(("to", "rightarrow", "Rightarrow", "propto", "equiv", "ll", "gg"), "→→⇒∝≡≪≫", strict=True)),
    **dict.fromkeys(("left", "right", "limits", "displaystyle", "big", "Big"), ""),
    "quad": "\u2003",
    "qquad": "\u2003\u2003",
}
RELATION = re.compile(r" *([≤≥≠≈→⇒∝≡≪≫]) *")
SPACES = {",": " ", ";": " ", ":": " ", "!": "", " ": " ", "\\": "\n"}
ACCENTS = {"hat": "\u0302", "bar": "\u0304", "vec": "\u20d7", "dot": "\u0307", "tilde": "\u0303", "overline": "\u0304"}
UPPER = dict(zip("0123456789+-−=()nTi", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁻⁼⁽⁾ⁿᵀⁱ", strict=True)) | {"°": "°", "′": "′", "ᵀ": "ᵀ"}
LOWER = dict(zip("0123456789+-=()", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎", strict=True))


def plain_formula(tex: str) -> str:
    r"""Formula in TeX, readable as a line of text; rows of an environment are lines.

    >>> plain_formula(r"\hat\lambda_g = \frac{c}{n_g f}, \quad L^2 \approx 10^{-6}\,\mathrm{m}")
    'λ̂_g = c/(n_g f),   L² ≈ 10⁻⁶ m'
    """
    tokens = iter(TOKEN.findall(tex))
    text = RELATION.sub(r" \1 ", re.sub(" +", " ", _text(tokens)))
    return "\n".join(line.strip().replace("\u2003", "  ") for line in text.split("\n") if line.strip())


def _text(tokens: Iterator[str], end: str | None = None) -> str:
    """Text of the tokens up to an end."""
    parts: list[str] = []
    for token in tokens:
        if token == end:
            break
        if token in "^_":
            parts.append(_script(token, _argument(tokens)))
        else:
            parts.append(_item(token, tokens))
    return "".join(parts)


def _argument(tokens: Iterator[str]) -> str:
    """Text of the next item: a group, a command or a character."""
    for token in tokens:
        if not token.isspace():
            return _item(token, tokens)
    return ""


def _item(token: str, tokens: Iterator[str]) -> str:
    """Text of one item that begins with this token."""
    if token == "{":
        return _text(tokens, "}")
    if not token.startswith("\\") or token == "\\":
        return "" if token in "&\\" else " " if token.isspace() or token == "~" else token
    name = token[1:]
    if name in SPACES:
        return SPACES[name]
    if name in ("frac", "tfrac", "dfrac"):
        numerator, denominator = _argument(tokens), _argument(tokens)
        return f"{_grouped(numerator)}/{_grouped(denominator)}"
    if name == "sqrt":
        return f"√{_grouped(_argument(tokens))}"
    if name in ACCENTS:
        base = _argument(tokens)
        return normalize("NFC", base + ACCENTS[name]) if len(base) == 1 else base
    if name in ("begin", "end"):
        _argument(tokens)
        return ""
    if name in ("mathrm", "text", "mathbf", "mathit", "operatorname", "boldsymbol", "mathsf", "textrm"):
        return _argument(tokens)
    return SYMBOLS.get(name, name)


def _grouped(text: str) -> str:
    """Text in parentheses unless it is one factor."""
    return text if re.fullmatch(r"[\w.′°^₀-₉⁰-⁹]+", text) else f"({text})"


def _script(kind: str, text: str) -> str:
    """Superscript or subscript in Unicode where it has the characters."""
    letters = UPPER if kind == "^" else LOWER
    if all(c in letters for c in text):
        return "".join(letters[c] for c in text)
    return kind + (text if re.fullmatch(r"[\w.]+", text) else f"({text})")
