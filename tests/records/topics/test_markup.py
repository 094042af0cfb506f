"""Pages in MyST as plain Markdown."""

import pytest

from catseye.records.topics.formulas import plain_formula
from catseye.records.topics.markup import linked_pages, page_title, plain_markdown

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
