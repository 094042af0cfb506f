"""Figures from Python: one figure and its numbers each, written whole or not at all."""

from dataclasses import replace

import pytest

import catseye
from catseye.errors import ArgumentError, InputError, ValidityError

NIGHT = "night-01"
SKY = (f"{NIGHT}/monuments/ZY103.toml", f"{NIGHT}/mirrors/ZP103.toml", 52_892.75)


def test_a_figure_has_numbers_a_table_and_a_file(tmp_path):
    answer = catseye.plot_air(20.0, 933.0, 50.0, u_temperature_c=0.3)
    assert answer.verdict.word == "good"
    assert list(catseye.show(answer)) == ["air"]
    assert answer.to_object()["written"] is None
    table = answer.to_table()
    assert "group_refractivity_ppm" in set(table["name"])
    path = answer.save_figure(tmp_path / "air.pdf")
    assert path.read_bytes().startswith(b"%PDF")
    assert replace(answer, written=path).to_object()["written"] == str(path)
    with pytest.raises(InputError, match="unknown figure format"):
        answer.save_figure(tmp_path / "air.jpg")
    assert catseye.save(answer, tmp_path / "air").joinpath("air.svg").exists()


def test_a_figure_never_replaces_its_input_nor_what_is_not_ours(tmp_path):
    train = tmp_path / "head.svg"
    train.write_text(catseye.examples("beams/head.toml").read_text())
    answer = catseye.plot_beam(train)
    with pytest.raises(InputError, match="is an input"):
        answer.save_figure(train)
    (tmp_path / "mine.svg").write_text("<svg/>")
    with pytest.raises(InputError, match="not a catseye file"):
        answer.save_figure(tmp_path / "mine.svg")


def test_examples_are_named_and_a_slew_has_two_ends():
    slew = {"start": (18500, 10000), "end": (21500, 12000)}
    sky = catseye.plot_sky(*SKY, longitude_deg=-79.84, keep_out="keep-out.toml", **slew)
    assert sky.kind == "sky"
    assert "route" in sky.numbers
    with pytest.raises(ArgumentError, match="go together") as refused:
        catseye.plot_sky(*SKY, longitude_deg=-79.84, start=(1, 2))
    assert refused.value.names == ("start", "end")


@pytest.mark.parametrize(
    ("draw", "problem"),
    [
        (lambda: catseye.plot_servo(counts=0), ArgumentError),
        (lambda: catseye.plot_servo(axis=2), ArgumentError),
        (lambda: catseye.plot_coating(incidence_deg=95.0), ArgumentError),
        (lambda: catseye.plot_coating(["butter"]), ValidityError),
        (lambda: catseye.plot_air(model="bogus"), ArgumentError),
        (lambda: catseye.plot_aberration(beam_radius_mm=0.0), ValidityError),
        (lambda: catseye.plot_polarization(glass="butter"), ValidityError),
    ],
)
def test_invalid_arguments_are_refused(draw, problem):
    with pytest.raises(problem):
        draw()


@pytest.mark.parametrize("draw", [catseye.plot_return, catseye.plot_servo, catseye.plot_polarization])
def test_the_others_are_drawn(draw):
    answer = draw()
    assert len(catseye.show(answer)) == 1
    assert len(answer.passages()) >= 2
