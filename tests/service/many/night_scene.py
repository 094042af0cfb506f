"""Small nights that differ: one simulated night whose samples are changed by a few codes each time."""

import shutil

import numpy as np

import catseye

CODES = 3  # largest change of a sample; the noise of one is some hundred


def small_night(directory):
    """A night of the whole telescope with three prisms on its dish, which takes a second."""
    return catseye.night(directory, dish_prisms=3, seed=7)


def nights_of(night, directory, count):
    """Paths of copies night-00, night-01 and so on, whose samples differ by a seeded draw."""
    paths = []
    for number in range(count):
        where = directory / f"night-{number:02d}"
        shutil.copytree(night, where)
        frames = np.load(where / "frames.npy")
        change = np.random.default_rng(number).integers(-CODES, CODES + 1, frames.shape, dtype=frames.dtype)
        limits = np.iinfo(frames.dtype)
        np.save(where / "frames.npy", np.clip(frames, limits.min + CODES, limits.max - CODES) + change)
        paths.append(where)
    return paths
