"""Air of a network file: displayed distances with weather, and what all of them share.

    [air]        wavelength_um; reference_index, or reference_temperature_c, reference_pressure_hpa and
                 reference_humidity_percent: the group index for which the instrument displays lengths; model, co2_ppm;
                 u_ppm: standard uncertainty of the index common to all distances; u_station_ppm: of each station's
    [[weather]]  point: a station; temperature_c, pressure_hpa, humidity_percent, or group_index

A distance has these keys itself, or the weather of its station (`from`), or `index`: what it displays for a metre.
"""

from catseye.atmosphere.index.air import group_refractivity
from catseye.errors import ValidityError
from catseye.estimation.network.names import name_key
from catseye.names import AIR_MODEL, AIR_MODELS
from catseye.records.files.refusal import shown
from catseye.records.files.toml_fields import RATIO, Fields
from catseye.records.network.draft import NetworkDraft

WEATHER = ("temperature_c", "pressure_hpa", "humidity_percent")
GIVEN = (*WEATHER, "group_index")
HIGHEST_INDEX = 1.001  # of air: a larger value is an index in ppm, or of glass
U_PPM = {"ppm": RATIO["ppm"]}


class NetworkAir:
    """Air of one file: index of each distance, parameters of its errors.

    fields    table [air]
    weather   tables [[weather]]
    draft     the network so far
    """

    def __init__(self, fields: Fields, weather: list[Fields], draft: NetworkDraft) -> None:
        self.draft = draft
        self.wavelength_um = fields.number("wavelength_um")
        self.model = fields.text("model", AIR_MODEL)
        if self.model not in AIR_MODELS:
            raise fields.refuse(f"model = {shown(self.model)} (expected {', '.join(AIR_MODELS)})")
        self.co2_ppm = fields.number("co2_ppm", 450.0)
        self.reference = self._reference(fields)
        self.u, self.u_station = (fields.quantity(stem, U_PPM, 0.0) for stem in ("u", "u_station"))
        if min(self.u, self.u_station) < 0.0:
            raise fields.refuse("u_ppm or u_station_ppm is negative (expected 0 or above)")
        fields.refuse_unused()
        self.common = draft.parameter("air", 0.0, self.u, "1") if self.u else -1
        self.of_station: dict[str, int] = {}
        self.stations: dict[str, float] = {}
        for item in weather:
            name = name_key(item.text("point"))
            if name in self.stations:
                raise item.refuse(f"weather of {shown(name)} occurs twice (expected each station once)")
            index = self._index(item)
            if index is None:
                raise item.refuse(f"has no weather (expected {', '.join(WEATHER)}, or group_index)")
            self.stations[name] = index
            item.refuse_unused()

    def reading(self, fields: Fields, station: str) -> float:
        """Displayed length of a metre: the group index over the reference index.

        Raises InputError for a distance without weather.
        """
        index = self._index(fields)
        if index is None:
            index = self.stations.get(name_key(station))
        if index is None:
            raise fields.refuse(
                f"has no weather (expected {', '.join(WEATHER)}, or group_index, or [[weather]] of "
                f"{shown(station)}, or index = 1 for a length without air)"
            )
        return index / self.reference

    def parameters(self, station: str) -> dict[str, int]:
        """Parameters of the air's errors by role, for a distance from a station."""
        roles = {"air": self.common} if self.common >= 0 else {}
        if self.u_station:
            name = name_key(station)
            if name not in self.of_station:
                self.of_station[name] = self.draft.parameter(f"air at {station}", 0.0, self.u_station, "1")
            roles["station_air"] = self.of_station[name]
        return roles

    def _reference(self, fields: Fields) -> float:
        keys = [f"reference_{key}" for key in WEATHER]
        written = [key for key in keys if fields.has(key)]
        if fields.has("reference_index") == bool(written):
            raise fields.refuse(f"expected reference_index, or {', '.join(keys)}")
        if written:
            return 1.0 + self._refractivity(fields, keys)
        return self._checked_index(fields, "reference_index")

    def _index(self, fields: Fields) -> float | None:
        """Group index by a table's weather; None without any."""
        written = [key for key in GIVEN if fields.has(key)]
        if not written:
            return None
        if "group_index" in written:
            if len(written) > 1:
                raise fields.refuse(f"has group_index and {written[0]} (expected the index, or the weather)")
            return self._checked_index(fields, "group_index")
        return 1.0 + self._refractivity(fields, list(WEATHER))

    def _checked_index(self, fields: Fields, key: str) -> float:
        index = fields.number(key)
        if not 1.0 <= index <= HIGHEST_INDEX:
            raise fields.refuse(f"{key} = {index:.10g} (expected 1 to {HIGHEST_INDEX:g})")
        return index

    def _refractivity(self, fields: Fields, keys: list[str]) -> float:
        values = [fields.number(key) for key in keys]
        try:
            return float(
                group_refractivity(*values, wavelength_um=self.wavelength_um, model=self.model, co2_ppm=self.co2_ppm)
            )
        except ValidityError as problem:
            raise fields.refuse(str(problem)) from problem
