"""``gbas process``: recorded receiver files through the whole chain, offline."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gbas_airborne.modes import configured_modes
from gbas_airborne.params import ALL_MODES, AirborneParams, airborne_section
from gbas_bringup.resources import config_path
from gbas_chain.chain import AirborneOutput, Chain
from gbas_chain.mode_results import mode_summary, write_modes_csv
from gbas_chain.results import Row, summarise, write_json, write_solution_csv
from gbas_core.configuration import read_configuration
from gbas_core.errors import ConfigError, GbasError
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_core.io.rinex import NavigationFile, ObservationFile
from gbas_core.positioning.approach_keys import RECORD_KEY
from gbas_ground.claims.broadcast_claims import statements
from gbas_ground.params import SECTION, GroundParams
from gbas_msgs_py.codes import EventKind, Signal
from gbas_msgs_py.events import Event
from gbas_msgs_py.products import PRODUCT_INDEX, PRODUCTS
from gbas_msgs_py.records import ModesEpoch
from gbas_vdb.messages.path_point import path_points_of
from gbas_vdb.transmission.burst import SLOT_NAMES

NOMINAL_STATION = "nominal_station.yaml"
"""Station values assumed for recorded data when no station file is given; a file a person can read and copy."""

ALL_SERVICES = "all"
"""Instead of a service: every processing mode, with guidance of GAST-C."""
Progress = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class ProcessRequest:
    """What to process.

    Attributes
    ----------
    ground : tuple of Path
        Observation files of one to four reference receivers: RINEX or recorded RTCM 3, like all files here.
    ground_xyz_m : tuple of (x, y, z)
        Their antenna positions, ECEF [m]; empty takes the approximate positions of the file headers, and says so.
    user : Path
        Observation file of the user.
    navigation, user_navigation : tuple of Path
        Navigation files; the user's own only when they differ.
    gps_week : int or None
        GPS week of the first epoch of RTCM 3 streams; None where they have ephemerides that say it.
    service : str
        Service type that guides, ``"C"`` to ``"IF-30"``, or ``"all"``: C, with every mode beside it.
    systems : str
        Satellite systems, ``"G"``, ``"E"`` or ``"GE"``; with ``"all"`` and ``"GE"`` each alone, too.
    station, fas, airborne : Path or None
        Configuration files: station (section ``ground``), final approach, airborne receiver (section ``airborne``).
    """

    ground: tuple[Path, ...]
    user: Path
    navigation: tuple[Path, ...]
    ground_xyz_m: tuple[tuple[float, float, float], ...] = ()
    user_navigation: tuple[Path, ...] = ()
    gps_week: int | None = None
    service: str = "C"
    systems: str = "G"
    station: Path | None = None
    fas: Path | None = None
    airborne: Path | None = None


@dataclass(frozen=True, kw_only=True)
class ProcessResult:
    """Everything a run gave.

    Attributes
    ----------
    rows : tuple of Row
        One for each epoch of the user.
    outputs : tuple of AirborneOutput
        The records behind the rows.
    events : tuple of Event
        Of both ends, in order.
    notes : tuple of str
        What was assumed, left out or repaired.
    ground : GroundParams
    airborne : AirborneParams
    run_file : dict
        The same run as a ROS parameter file for ``gbas run``.
    simulated : bool
        Whether any of the files says that it is simulated.
    """

    rows: tuple[Row, ...]
    outputs: tuple[AirborneOutput, ...]
    events: tuple[Event, ...]
    notes: tuple[str, ...]
    ground: GroundParams
    airborne: AirborneParams
    run_file: dict[str, Any]
    simulated: bool = False

    def modes(self) -> tuple[ModesEpoch, ...]:
        """All modes of every epoch; empty where there is one mode."""
        return tuple(output.modes for output in self.outputs if output.modes is not None)

    def summary(self) -> dict[str, Any]:
        """Body of ``summary.json``."""
        modes = {"modes": mode_summary(self.modes(), self.airborne.systems)} if self.modes() else {}
        return {
            **summarise(self.rows),
            **modes,
            "events": _event_counts(self.events),
            "notes": list(self.notes),
            "station": {"id": self.ground.station.id, "designator": self.ground.accuracy.designator},
            "rests_on": list(statements(self.ground)),
            "simulated": self.simulated,
        }


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """A recording with the parameters it is processed with."""

    recording: Recording
    ground: GroundParams
    airborne: AirborneParams
    notes: tuple[str, ...]
    run_file: dict[str, Any]

    def epochs(self) -> list[RecordedEpoch]:
        """The epochs in which both the station and the user were observing."""
        first, last = self.recording.overlap
        return list(self.recording.epochs(first=first, last=last))

    def chain(self) -> Chain:
        """A chain that has seen nothing yet."""
        return Chain(self.ground, self.airborne, self.recording.ephemerides(), self.recording.user_ephemerides())


def prepare(request: ProcessRequest) -> Prepared:
    """Read the files and make the parameters.

    Raises
    ------
    RinexError, RtcmError, RecordingError, GbasError, ValueError
        With one line that names what cannot be used.
    """
    if request.ground_xyz_m and len(request.ground_xyz_m) != len(request.ground):
        raise GbasError(
            f"--ground-xyz: {len(request.ground_xyz_m)} positions for {len(request.ground)} ground files; "
            "expected one each"
        )
    _wanted(request)
    recording = Recording.open(
        request.ground,
        request.user,
        request.navigation,
        user_navigation=request.user_navigation,
        gps_week=request.gps_week,
    )
    notes = list(recording.notes())
    ground_source, sections = _ground_sections(request, recording, notes)
    ground = GroundParams.from_mapping(sections, source=ground_source)
    airborne_values = _airborne_values(request, recording, ground)
    airborne = AirborneParams.from_mapping(airborne_values, source=str(request.airborne or "gbas process"))
    return Prepared(
        recording=recording,
        ground=ground,
        airborne=airborne,
        notes=tuple(notes),
        run_file=_run_file(request, sections, airborne_values),
    )


def process(request: ProcessRequest, *, progress: Progress | None = None, count: int | None = None) -> ProcessResult:
    """Run the chain over recorded files, over the first `count` epochs or all.

    `progress` is called with epochs done and epochs in all.
    """
    prepared = prepare(request)
    epochs = prepared.epochs()[:count]
    outputs: list[AirborneOutput] = []
    events: list[Event] = []
    for output in prepared.chain().run(_counted(epochs, progress)):
        events += output.events
        if isinstance(output, AirborneOutput):
            outputs.append(output)
    return ProcessResult(
        rows=tuple(Row.of(output.solution, output.protection) for output in outputs),
        outputs=tuple(outputs),
        events=tuple(events),
        notes=prepared.notes,
        ground=prepared.ground,
        airborne=prepared.airborne,
        run_file=prepared.run_file,
        simulated=any(file.simulated for file in _files(prepared.recording)),
    )


def _files(recording: Recording) -> tuple[ObservationFile | NavigationFile, ...]:
    """All files of a recording."""
    user = () if recording.user is None else (recording.user,)
    return (*recording.ground, *user, recording.navigation, recording.user_navigation)


def write_results(result: ProcessResult, out: Path) -> dict[str, Any]:
    """Write the results into a folder; returns the summary.

    ``solution.csv``, ``modes.csv`` where several modes run, ``summary.json``, ``events.jsonl``, and ``run.yaml``: the
    same files through live nodes with ``gbas run run.yaml``.
    """
    out.mkdir(parents=True, exist_ok=True)
    write_solution_csv(out / "solution.csv", result.rows)
    if result.modes():
        write_modes_csv(out / "modes.csv", result.modes(), result.airborne.systems)
    (out / "events.jsonl").write_text("".join(event.to_json() + "\n" for event in result.events), encoding="utf-8")
    summary = result.summary()
    write_json(out / "summary.json", summary)
    (out / "run.yaml").write_text(yaml.safe_dump(result.run_file, sort_keys=False), encoding="utf-8")
    return summary


def _counted(epochs: Sequence[RecordedEpoch], progress: Progress | None) -> Iterator[RecordedEpoch]:
    for done, epoch in enumerate(epochs, start=1):
        yield epoch
        if progress is not None:
            progress(done, len(epochs))


def _event_counts(events: Sequence[Event]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for event in events:
        if event.kind is not EventKind.FINISHED:
            name = f"{event.kind.value}:{event.cause}"
            counts[name] = counts.get(name, 0) + 1
    return dict(sorted(counts.items()))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(path, f"cannot be read: {error}") from None


def _document(path: Path) -> Any:
    try:
        return yaml.safe_load(_text(path))
    except yaml.YAMLError as error:
        raise ConfigError(path, f"is not YAML: {error}") from None


def _run_file(request: ProcessRequest, ground: Mapping[str, Any], airborne: Mapping[str, Any]) -> dict[str, Any]:
    """ROS parameter file of the same run through live nodes."""
    replay: dict[str, Any] = {
        "ground_files": [str(path.resolve()) for path in request.ground],
        "user_file": str(request.user.resolve()),
        "nav_files": [str(path.resolve()) for path in request.navigation],
        "systems": request.systems,
    }
    if request.user_navigation:
        replay["user_nav_files"] = [str(path.resolve()) for path in request.user_navigation]
    if request.gps_week is not None:
        replay["gps_week"] = request.gps_week
    sections = {name: values for name, values in ground.items() if values}
    return {
        "/**": {"ros__parameters": {"ground": sections, "airborne": dict(airborne)}},
        "/gbas/receiver_replay": {"ros__parameters": replay},
    }


def _ground_sections(
    request: ProcessRequest, recording: Recording, notes: list[str]
) -> tuple[str, dict[str, dict[str, Any]]]:
    """Sections of the station's configuration, and where they come from."""
    path = request.station or config_path(NOMINAL_STATION)
    if request.station is None:
        notes.append(f"no station file: nominal values of {NOMINAL_STATION} are assumed")
    sections = read_configuration(path).section(SECTION)
    positions = request.ground_xyz_m or _header_positions(recording, notes)
    latitude, longitude, height = geodetic_from_ecef(np.array(positions[0]))
    station = sections.setdefault("station", {})
    if request.station is None or "latitude_deg" not in station:
        station |= {
            "latitude_deg": float(np.degrees(latitude)),
            "longitude_deg": float(np.degrees(longitude)),
            "height_m": float(height),
        }
    station["systems"] = request.systems
    receivers = sections.setdefault("receivers", {})
    for key in [key for key in receivers if key.endswith("_ecef_m")]:
        del receivers[key]
    receivers |= {f"rr{number}_ecef_m": list(place) for number, place in enumerate(positions, start=1)}
    receivers.setdefault("minimum", min(2, len(positions)))
    smoothing = sections.setdefault("smoothing", {})
    smoothing.setdefault("max_gap_s", max(3.5, 1.5 * max(file.interval_s or 0.0 for file in recording.ground)))
    power = sections.setdefault("signal_power", {})
    without = [file.path.name for file in recording.ground if not np.isfinite(file.cn0_dbhz[:, 0]).any()]
    if without and "require_cn0" not in power:
        power["require_cn0"] = False
        notes.append(f"{', '.join(without)}: no C/N0 in the file, so signal power is not monitored")
    _make_corrections(request, sections)
    if request.fas is not None:
        sections["approaches"] = {"fas": dict(_fas(request.fas))}
    return str(path), sections


def _service_values(service: str) -> dict[str, Any]:
    """Values of the receiver for the service asked for."""
    return {"service": "C", "modes": [ALL_MODES]} if service == ALL_SERVICES else {"service": service}


def _wanted(request: ProcessRequest) -> AirborneParams:
    """A receiver of the service asked for, before anything is read."""
    return AirborneParams.from_mapping(_service_values(request.service), source="--service")


def _make_corrections(request: ProcessRequest, sections: dict[str, dict[str, Any]]) -> None:
    """Let the station make and send what the modes need, where its file does not say; it may use every slot then."""
    products = {name for mode in configured_modes(_wanted(request)) for name in mode.products}
    second = sorted(name for name in products if PRODUCTS[PRODUCT_INDEX[name]].signal is Signal.L5)
    if "l1_30" in products:
        # a station that is taken for one claims nothing, so it need not have the monitors behind the claims
        sections["gast_d"] = {"enabled": True, "required": request.station is not None} | sections.get("gast_d", {})
    if second:
        sections.setdefault("second_band", {}).setdefault("products", second)
    if request.station is None and products != {"l1_100"}:
        sections.setdefault("vdb", {})["slots"] = "".join(SLOT_NAMES)


def _header_positions(recording: Recording, notes: list[str]) -> tuple[tuple[float, float, float], ...]:
    positions = []
    for file in recording.ground:
        if file.approx_position_m is None:
            raise GbasError(
                f"{file.path}: has no antenna position (APPROX POSITION XYZ in RINEX, message 1005 or 1006 in RTCM 3); "
                "give it with --ground-xyz"
            )
        notes.append(f"{file.path.name}: antenna position taken from the file, where it may be approximate")
        x, y, z = (float(value) for value in file.approx_position_m)
        positions.append((x, y, z))
    return tuple(positions)


def _fas(path: Path) -> Mapping[str, Any]:
    """Keys of a final approach: of a YAML file, or of the one ARINC 424 path point record in a text file."""
    records = [record for _, record in path_points_of(_text(path))]
    if len(records) > 1:
        raise ConfigError(path, f"holds {len(records)} ARINC 424 path point records; expected one")
    if records:
        return {RECORD_KEY: records[0]}
    document = _document(path)
    fas = document.get("fas", document) if isinstance(document, Mapping) else None
    if not isinstance(fas, Mapping):
        raise ConfigError(path, "is no mapping of final approach fields, and no ARINC 424 path point record")
    return fas


def _airborne_values(request: ProcessRequest, recording: Recording, ground: GroundParams) -> dict[str, Any]:
    """Values of the receiver's configuration."""
    given = {} if request.airborne is None else airborne_section(request.airborne)
    assert recording.user is not None
    interval_s = max(file.interval_s or 0.0 for file in recording.ground)
    values: dict[str, Any] = {
        **_service_values(request.service),
        "systems": request.systems,
        "max_gap_s": max(3.5, 1.5 * (recording.user.interval_s or 0.0)),
        "station_data_timeout_s": min(max(60.0, 30.0 * interval_s), 3600.0),  # they come round in 20 epochs
        "use_unhealthy": True,  # without a service; a station that claims one is not affected
    }
    if request.station is None:
        values["gast_d"] = {"require_authentication": False}  # of a station that claims nothing
    if ground.approaches:
        values["rpds"] = ground.approaches[0].rpds
    return {**values, **given}
