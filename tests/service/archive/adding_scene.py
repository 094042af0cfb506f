"""Campaigns to archive, and the work of one process that adds them."""

import shutil

import numpy as np

from catseye.service.archive.adding import change_archive
from journal_scene import NIGHT


def campaign_copy(folder, samples=0):
    """night-01 in a folder of its own, each sample changed by so many codes."""
    shutil.copytree(NIGHT, folder)
    if samples:
        np.save(folder / "frames.npy", np.load(folder / "frames.npy") + np.int16(samples))
    return folder


def added(directory, *sources, **options):
    """Outcomes of one process that adds sources."""
    defaults = {"remove": (), "compact": False, "processes": 1, "cluster": None, "progress": None}
    return change_archive(directory, list(map(str, sources)), **{**defaults, **options})
