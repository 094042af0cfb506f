"""Pages in MyST as plain Markdown."""

import pytest

from catseye.records.topics.formulas import plain_formula
from catseye.records.topics.markup import has_prose, linked_pages, page_title, plain_markdown

PAGE = """---
kernelspec:
  name: python3
---
(first-page)=
# A `page` of all sorts
% a comment
Range $d = \\frac{N\\lambda_g}{2} + z_0$, see [the **terms**](../glossary.md#range) and [a site](https://example.org/x).
{term}`dew period`, {ref}`the section <first-page>`; `$HOME` costs 3 $ or 4 $.

$$
u^2 = \\sum_{i} u_i^2
$$ (eq-sum)

```{code-cell} python
:tags: [hide-input]

print("$x$ [a](b.md)")
```

```{command}
:lines: 12
catseye reduce night-01 \\
--out night
catseye view night
```

```{command-figure} night/sky.svg
:alt: Sky of a ranger
```

:::{note}
Mind $x$.
:::

::::{grid} 2
:::{grid-item-card} Tour
Eight pages.
:::
::::

```{toctree}
:hidden:
one
two
```

```{list-of-reports} all
```

```toml
# docs stay: {note} $x$
```
"""

PLAIN = """# A `page` of all sorts
Range `d = Nλ_g/2 + z₀`, see the **terms** and [a site](https://example.org/x).
`dew period`, `the section`; `$HOME` costs 3 $ or 4 $.

```
u² = ∑_i u_i²
```

```python
print("$x$ [a](b.md)")
```

```console
$ catseye reduce night-01 \\
  --out night
$ catseye view night
```

*[Figure: Sky of a ranger]*

> **Note.** Mind `x`.

**Tour**

Eight pages.

*(made by the build of the documentation: list-of-reports all)*

```toml
# docs stay: {note} $x$
```
"""


def test_every_part_of_a_page_becomes_plain_markdown():
    assert plain_markdown(PAGE) == PLAIN


def test_plain_markdown_stays_as_it_is():
    text = plain_markdown(PAGE)
    assert plain_markdown(text) == text


def test_the_title_is_the_first_heading_outside_code():
    assert page_title("```\n# no\n```\n# Yes `code`\n") == "Yes code"
    assert page_title("no heading") == ""


@pytest.mark.parametrize(
    ("page", "text"),
    [
        ("```{command-file} a.csv\nx,y\n```\n", "File `a.csv`:\n\n```text\nx,y\n```\n"),
        ("```{command}\n:hide:\ncatseye air\n```\nWords.\n", "Words.\n"),
        (
            ":::{grid-item-card} Tour\n:link: tour/index\n:link-type: doc\n\nPages.\n:::\n",
            "**Tour** (`catseye help tour`)\n\nPages.\n",
        ),
        ("```{command-reference} air\n```\n", "Options: `catseye air --help`\n"),
        ("```{public} air sound\n```\n", "In Python: `help(catseye.air)`, `help(catseye.sound)`\n"),
        ("```{formulas} catseye.signal.drift\n```\n", "In Python: `help('catseye.signal.drift')`\n"),
        ("```{references}\n```\n", "In Python: `from catseye.bibliography import SOURCES`\n"),
        (
            "```{gallery} catseye.air(1)\n:command: catseye air\n\nplan = From above\n```\n",
            "Figures of `catseye air`:\n\n- plan: From above\n",
        ),
    ],
)
def test_what_the_build_makes_is_said_in_words(page, text):
    assert plain_markdown(page) == text


@pytest.mark.parametrize(
    ("page", "prose"),
    [
        ("# A\n\n```{formulas} a.b\n```\n", False),
        ("# A\n\n```{eval-rst}\n.. x::\n```\n", False),
        ("# A\n\nWords.\n", True),
        ("# A\n\n```{command-reference} air\n```\n", True),
    ],
)
def test_a_page_has_prose_or_waits_for_the_build(page, prose):
    assert has_prose(page) is prose


def test_linked_pages_are_those_of_the_prose():
    assert linked_pages(PAGE) == ["../glossary.md"]


def test_a_fence_that_is_never_closed_ends_with_the_page():
    assert plain_markdown("# A\n```{note}\nopen\n") == "# A\n> **Note.** open\n"


@pytest.mark.parametrize(
    ("tex", "text"),
    [
        (r"10^{-6}", "10⁻⁶"),
        (r"x_{12}", "x₁₂"),
        (r"L_{AB}^2", "L_AB²"),
        (r"e^{x+y}", "e^(x+y)"),
        (r"\sqrt{a + b}", "√(a + b)"),
        (r"\frac{1}{2}", "1/2"),
        (r"\frac{a+b}{\lambda}", "(a+b)/λ"),
        (r"\hat{x} \le \bar y", "x̂ ≤ ȳ"),
        (r"20^\circ\mathrm{C}", "20°C"),
        (r"\begin{aligned} a &= b \\ c &= d \end{aligned}", "a = b\nc = d"),
        (r"\unknown{x}", "unknownx"),
        (r"a^", "a"),
        (r"{open", "open"),
    ],
)
def test_a_formula_is_a_line_of_unicode(tex, text):
    assert plain_formula(tex) == text


@pytest.mark.parametrize(("tag", "shown"), [("hide-input", True), ("remove-input", False), ("remove-cell", False)])
def test_code_that_the_built_page_leaves_out_is_left_out(tag, shown):
    cell = f"# Page\n\n```{{code-cell}} ipython3\n:tags: [{tag}]\n%config Backend.formats = 1\n```\n\nText.\n"
    assert ("%config" in plain_markdown(cell)) == shown


def test_a_title_has_no_backslash_of_its_markdown():
    assert page_title("# Surveys of STAR\\*NET and `CSV`\n") == "Surveys of STAR*NET and CSV"
