"""A group of options: single options on the command line, one object in the command."""

from typing import Annotated, NamedTuple

import typer
from typer.testing import CliRunner

from catseye.cli.option_groups import grouped


class Light(NamedTuple):
    """Light, as it is asked for."""

    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="In vacuum.")]
    colours: Annotated[list[str] | None, typer.Option("--colour")] = None


def told(*arguments):
    heard = []
    app = typer.Typer()

    @app.command()
    @grouped
    def shine(*, where: Annotated[str, typer.Argument()], light: Light, loud: bool = False) -> None:
        """Let there be light."""
        heard.append((where, light, loud))

    return heard, CliRunner().invoke(app, arguments)


def test_a_group_comes_as_one_object_with_its_defaults():
    heard, done = told("here", "--wavelength-um", "0.78")
    assert (heard, done.exit_code) == ([("here", Light(0.78), False)], 0)
    heard, _ = told("there", "--colour", "red", "--colour", "blue", "--wavelength-um=0.6", "--loud")
    assert heard == [("there", Light(0.6, ["red", "blue"]), True)]


def test_an_option_of_a_group_without_a_default_is_needed():
    heard, done = told("here")
    assert (heard, done.exit_code) == ([], 2)
    assert "--wavelength-um" in done.output


def test_help_has_the_options_in_the_groups_place():
    _, done = told("--help")
    places = [done.output.index(word) for word in ("Let there be light.", "--wavelength-um", "--colour", "--loud")]
    assert places == sorted(places)
    assert "light" not in done.output.split("Options")[1]
