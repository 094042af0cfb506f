"""A file format once released always loads: one file a kind and version stays in tests/vectors/formats."""

from datetime import date

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.reading import Folder, read_record
from catseye.records.files.record import Record
from catseye.records.laboratory.certificate_job import CertificateJob, LaboratoryRecord
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.records.night.path_temperature import PathTemperature
from catseye.records.night.recording import AcousticSheet
from catseye.records.night.shot import ShotRow, read_buffers, release_buffers
from catseye.records.night.weather import WeatherSample
from catseye.records.panels.actuators import ActuatorCorrection, ActuatorPosition
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelCorner
from catseye.records.site.beam import BeamTrain
from catseye.records.site.design_layout import DesignLayout
from catseye.records.site.interlock import Interlocks
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.mirror import Mirror, MirrorGeometry
from catseye.records.site.monument import MonumentGeometry, MonumentRecord
from catseye.records.site.pointing_model import PointingModel
from catseye.records.site.site import SiteRecord
from catseye.records.site.solids import Solids
from catseye.records.site.structural_model import StructuralModel
from catseye.records.site.subreflector import SubreflectorMount
from catseye.records.site.target import BenchmarkRow, FeedArm, Targets
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.air.refractometer_night import PathSheet
from repository import TESTS

FORMATS = TESTS / "vectors" / "formats"
RECORDS: dict[str, type[Record]] = {
    "site-1.toml": SiteRecord,
    "monument-1.toml": MonumentRecord,
    "monument-1-signed.toml": MonumentRecord,
    "mirror-1.toml": Mirror,
    "mirror-1-signed.toml": Mirror,
    "triplet-1.toml": TripletRecord,
    "triplet-1-signed.toml": TripletRecord,
    "targets-1.toml": Targets,
    "feedarm-1.toml": FeedArm,
    "monument-1-pointing.toml": MonumentGeometry,
    "mirror-1-pointing.toml": MirrorGeometry,
    "keep-out-1.toml": KeepOut,
    "solids-1.toml": Solids,
    "structural-model-1.toml": StructuralModel,
    "triplet-measurement-1.toml": TripletMeasurement,
    "acoustic-1.toml": AcousticSheet,
    "refractometer-1.toml": PathSheet,
    "beam-1.toml": BeamTrain,
    "interlocks-1.toml": Interlocks,
    "panel-instrument-1.toml": PanelInstrument,
    "pointing-series-1.toml": PointingModel,
    "laboratory-1.toml": LaboratoryRecord,
    "job-1.toml": CertificateJob,
    "design-1.toml": DesignLayout,
    "subreflector-1.toml": SubreflectorMount,
}
TABLES: dict[str, tuple[type[Record], int]] = {
    "benchmarks-1.csv": (BenchmarkRow, 6),
    "weather-1.csv": (WeatherSample, 5),
    "shots-1.csv": (ShotRow, 5),
    "path-temperatures-1.csv": (PathTemperature, 3),
    "panel-layout-1.csv": (PanelCorner, 8),
    "actuators-1.csv": (ActuatorCorrection, 4),
    "actuator-positions-1.csv": (ActuatorPosition, 3),
}


@pytest.mark.parametrize("file", RECORDS)
def test_a_released_record_still_loads_and_survives_the_round_trip(file):
    record = read_record(FORMATS / file, RECORDS[file])
    assert RECORDS[file].model_validate(record.model_dump()) == record


@pytest.mark.parametrize("file", TABLES)
def test_a_released_table_still_loads(file):
    kind, rows = TABLES[file]
    records = Folder(FORMATS).table(file, kind)
    assert len(records) == rows
    assert all(kind.model_validate(record.model_dump()) == record for record in records)


def test_released_buffers_still_load():
    buffers = read_buffers(Folder(FORMATS), "frames-1.npy")
    assert buffers.shape == (2, 192)
    assert buffers[1, 0] == 192


def test_every_file_kept_here_is_tested():
    elsewhere = {
        "frames-1.npy",
        "network-1.toml",
        "archive-1",  # tests/records/archive/test_frozen.py
        "journal-1.db",
        "journal-2.db",
    }  # test_network_toml, test_journal_reader
    elsewhere |= {"stars-1.dat", "tilts-1.csv"}  # test_star_offsets, test_pointing_files
    assert {path.name for path in FORMATS.iterdir()} == {*RECORDS, *TABLES, *elsewhere}


@pytest.mark.parametrize("kind", ["monument", "mirror", "triplet"])
def test_missing_provenance_is_unknown(kind):
    signed = read_record(FORMATS / f"{kind}-1-signed.toml", RECORDS[f"{kind}-1.toml"])
    unsigned = read_record(FORMATS / f"{kind}-1.toml", RECORDS[f"{kind}-1.toml"])
    keys = ("serial", "measured_on", "valid_until", "by", "report")
    assert [getattr(signed, key) for key in keys] == ["A-7", date(2003, 5, 14), date(2004, 5, 14), "dhp", "GBT-0117"]
    assert [getattr(unsigned, key) for key in keys] == [None] * 5


@pytest.mark.parametrize("version", ["2", '"catseye-mirror-2"', '"catseye-monument-1"', "true", "1.0"])
def test_unknown_version_is_refused_with_the_supported_ones(tmp_path, version):
    text = (FORMATS / "mirror-1.toml").read_text(encoding="utf-8")
    (tmp_path / "M.toml").write_text(f"format = {version}\nnew_key = 1\n{text}", encoding="utf-8")
    shown = version.replace('"', "'").replace("true", "True")
    with pytest.raises(InputError) as refusal:
        read_record(tmp_path / "M.toml", Mirror)
    expected = "expected 1 or 'catseye-mirror-1', the supported versions"
    assert str(refusal.value) == f"M.toml: format = {shown} ({expected})"


def test_released_buffers_are_read_again():
    buffers = read_buffers(Folder(FORMATS), "frames-1.npy")
    before = np.array(buffers)
    release_buffers(buffers)
    release_buffers(before)  # an array of its own stays
    assert np.array_equal(buffers, before)
