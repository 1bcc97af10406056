"""``gbas abia``: avionics based integrity augmentation: link budget, tracking loops, masking by the airframe."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from gbas_cli.base import Json, new_out, print_json, print_places, print_table
from gbas_cli.siting import check, numbers_of

if TYPE_CHECKING:
    from gbas_airborne.abia.airframe.aircraft import Antenna
    from gbas_airborne.abia.airframe.mesh import Airframe
    from gbas_core.record import FloatArray
    from gbas_core.signal.link_budget import LinkTerms

app = typer.Typer(help="What an aircraft's own flight does to its navigation.", no_args_is_help=True)

G_MPS2: Final = 9.8
"""What the paper takes for g: 10 g/s is 98 m/s^3."""
_SIGNALS: Final = {"L1CA": ("G", "L1"), "L5": ("G", "L5"), "E1": ("E", "L1"), "E5a": ("E", "L5")}
_TERMS: Final = {
    "EIRP": "eirp_dbw",
    "beam": "beam_db",
    "distance": "spread_db",
    "oxygen": "oxygen_db",
    "scintillation": "scintillation_db",
    "antenna": "antenna_dbic",
}


@app.command("link-budget")
def link_budget(
    elevation_deg: Annotated[str, typer.Option(metavar="E[,E...]", help="Elevations of the satellite.")] = "10,90",
    eirp_dbw: Annotated[
        float | None, typer.Option(metavar="DBW", help="What it sends (default: the signal's).")
    ] = None,
    noise_figure_db: Annotated[float, typer.Option(metavar="DB", help="Of the receiver, over 290 K.")] = 3.0,
    antenna: Annotated[
        str, typer.Option(metavar="NAME", help="Receiver's: fighter (the paper's), patch, mla, isotropic.")
    ] = "fighter",
    beam: Annotated[str, typer.Option(metavar="paper|flat", help="Satellite's antenna.")] = "paper",
    signal: Annotated[str, typer.Option(metavar="|".join(_SIGNALS), help="With its orbit.")] = "L1CA",
    orbit_radius_km: Annotated[float | None, typer.Option(metavar="KM", help="In place of the system's.")] = None,
    bank_deg: Annotated[
        float, typer.Option(metavar="B", help="The antenna is this much lower on the satellite's side.")
    ] = 0.0,
    terms: Annotated[bool, typer.Option("--terms", help="Every term of the budget.")] = False,
    as_json: Json = False,
) -> None:
    """C/N0 by elevation, from what a satellite sends; eq (12) to (20) of Sabatini et al. (2013), corrected."""
    import numpy as np

    elevations = numbers_of("--elevation-deg", elevation_deg)
    check("--elevation-deg", elevation_deg, all(0.0 <= each <= 90.0 for each in elevations), "0 to 90 degrees each")
    check("--signal", signal, signal in _SIGNALS, " or ".join(_SIGNALS))
    check("--bank-deg", bank_deg, -180.0 <= bank_deg <= 180.0, "-180 to 180 degrees")
    radius = orbit_radius_km
    check("--orbit-radius-km", radius, radius is None or 6_400.0 <= radius <= 1e6, "6400 to 1000000 km")
    options = {"beam": beam, "antenna": antenna, "noise_figure_db": noise_figure_db}
    found = _terms(np.radians(elevations), math.radians(bank_deg), signal, eirp_dbw, radius, options)
    cn0 = found.cn0_dbhz.tolist()
    if as_json:
        document: dict[str, Any] = {"elevation_deg": list(elevations), "cn0_dbhz": cn0}
        if terms:
            parts = {name: np.broadcast_to(getattr(found, name), len(cn0)).tolist() for name in _TERMS.values()}
            document["terms"] = {**parts, "noise_dbwphz": found.noise_dbwphz}
        print_json(document)
        return
    shown = dict(_TERMS) if terms else {}
    columns = [np.broadcast_to(getattr(found, name), len(cn0)) for name in shown.values()]
    rows = [
        (f"{each:g}", *(f"{column[at]:.3f}" for column in columns), f"{cn0[at]:.2f}")
        for at, each in enumerate(elevations)
    ]
    print_table("", ("elevation, deg", *(f"{name}, dB" for name in shown), "C/N0, dB-Hz"), rows)
    if terms:
        print(f"noise density {found.noise_dbwphz:.2f} dBW/Hz")


def _terms(
    elevation_rad: FloatArray,
    bank_rad: float,
    signal: str,
    eirp_dbw: float | None,
    orbit_radius_km: float | None,
    options: dict[str, Any],
) -> LinkTerms:
    """The budget of one signal, each term ``(E,)`` or a number."""
    import numpy as np

    from gbas_core.satellites import N_SATS, SYSTEM_MASKS
    from gbas_core.signal.antenna import slant_range_m
    from gbas_core.signal.link_budget import LinkTerms, TransmitBudget
    from gbas_core.signals import BAND_INDEX

    system, band_name = _SIGNALS[signal]
    if eirp_dbw is not None:
        options |= {"gps_eirp_dbw": (eirp_dbw, eirp_dbw), "galileo_eirp_dbw": (eirp_dbw, eirp_dbw)}
    elevation = elevation_rad[:, np.newaxis] * np.ones(N_SATS)
    distance = None if orbit_radius_km is None else slant_range_m(elevation, 1e3 * orbit_radius_km)
    found = TransmitBudget(**options).terms(elevation, elevation - bank_rad, distance)
    satellite, band = int(np.argmax(SYSTEM_MASKS[system])), BAND_INDEX[band_name]
    parts = {
        name: getattr(found, name)[..., min(band, getattr(found, name).shape[-2] - 1), satellite]
        for name in _TERMS.values()
    }
    return LinkTerms(**parts, noise_dbwphz=found.noise_dbwphz)


@app.command()
def tracking(
    bandwidth_hz: Annotated[float, typer.Option(metavar="HZ", help="Noise bandwidth of the phase loop.")] = 18.0,
    integration_ms: Annotated[float, typer.Option(metavar="MS", help="Before detection.")] = 20.0,
    jerk_g_per_s: Annotated[float, typer.Option(metavar="G/S", help="Along the line of sight; g = 9.8 m/s^2.")] = 0.0,
    acceleration_g: Annotated[float, typer.Option(metavar="G", help="Along the line of sight.")] = 0.0,
    order: Annotated[int, typer.Option(metavar="2|3", help="Of the phase loop.")] = 3,
    allan_deviation: Annotated[float, typer.Option(metavar="A", help="Of the oscillator.")] = 1e-10,
    vibration_g2phz: Annotated[float, typer.Option(metavar="P", help="From 20 to 2000 Hz.")] = 0.005,
    vibration_sensitivity_per_g: Annotated[float, typer.Option(metavar="S", help="Of the oscillator.")] = 1e-9,
    aiding_residual: Annotated[
        float, typer.Option(metavar="R", help="Share of the motion that velocity aiding leaves; 1: unaided.")
    ] = 1.0,
    cn0_dbhz: Annotated[
        float | None, typer.Option(metavar="C", help="Unjammed C/N0: adds the jamming margin J/S.")
    ] = None,
    loops: Annotated[bool, typer.Option("--loops", help="Frequency and code loop, too.")] = False,
    as_json: Json = False,
) -> None:
    """What shakes a receiver's phase loop, and the C/N0 below which it loses the signal.

    Rules of thumb: eq (42) to (56) of Sabatini et al. (2013), corrected. The threshold is the phase loop's.
    """
    from gbas_core.signal import loop_thresholds as thresholds

    check("--integration-ms", integration_ms, 0.1 <= integration_ms <= 1000.0, "0.1 to 1000 ms")
    for option, value in (("--jerk-g-per-s", jerk_g_per_s), ("--acceleration-g", acceleration_g)):
        check(option, value, 0.0 <= value <= 1000.0, "0 to 1000")
    motion = thresholds.Motion(acceleration_mps2=G_MPS2 * acceleration_g, jerk_mps3=G_MPS2 * jerk_g_per_s)
    params = thresholds.LoopParams(
        phase_order=order,  # type: ignore[arg-type]  # checked there
        phase_bandwidth_hz=bandwidth_hz,
        integration_s=1e-3 * integration_ms,
        allan_deviation=allan_deviation,
        vibration_g2phz=vibration_g2phz,
        vibration_sensitivity_per_g=vibration_sensitivity_per_g,
        aiding_residual=aiding_residual,
    )
    found = thresholds.cn0_thresholds(params, motion)
    document: dict[str, Any] = {
        "vibration_deg": math.degrees(thresholds.vibration_rad(params)),
        "allan_deg": math.degrees(thresholds.oscillator_rad(params)),
        "dynamic_stress_deg": math.degrees(float(thresholds.phase_stress_rad(params, motion))),
        "cn0_threshold_dbhz": found.phase_dbhz,
    }
    if loops:
        document |= {
            "frequency_cn0_threshold_dbhz": found.frequency_dbhz,
            "code_cn0_threshold_dbhz": found.code_dbhz,
            "all_cn0_threshold_dbhz": found.all_dbhz,
        }
    if cn0_dbhz is not None:
        document["jamming_margin_db"] = float(thresholds.jamming_margin_db(cn0_dbhz, found.phase_dbhz))
    if as_json:
        print_json(document)
        return
    if not math.isfinite(found.phase_dbhz):
        print("the phase loop holds at no C/N0: what shakes it is beyond 15 degrees, one sigma, without any noise")
    for name, value in document.items():
        print(f"{name:28} {value:.3f}")


@app.command()
def mask(
    mesh: Annotated[
        str,
        typer.Argument(metavar="MESH", help="STL, OBJ, PLY or GLB; or fighter, fighter_swept, airliner, small_uav."),
    ],
    antenna: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Phase centre in the mesh's axes [m]; upper or lower of our aircraft.")
    ] = "upper",
    out: Annotated[Path | None, typer.Option(metavar="FILE.png", help="The picture (default: out/mask-N/).")] = None,
    looks: Annotated[str | None, typer.Option(metavar="up|down", help="Where the antenna looks (default: up).")] = None,
    horizon_deg: Annotated[float, typer.Option(metavar="E", help="Lowest elevation in the antenna's frame.")] = 5.0,
    axes: Annotated[
        str, typer.Option(metavar="LETTERS", help="What the mesh's x, y, z point to: f b, l r, u d.")
    ] = "flu",
    scale_m: Annotated[float, typer.Option(metavar="M", help="Metres a unit of the file.")] = 1.0,
    open_mesh: Annotated[bool, typer.Option("--open-mesh", help="Take a mesh with holes as it is.")] = False,
    as_json: Json = False,
) -> None:
    """Draw what an airframe hides from an antenna on it.

    Axes are forward, left, up (flu) unless told otherwise. The mesh must be closed and the antenna outside of it; with
    --open-mesh rays pass through its holes.
    """
    from gbas_airborne.abia.airframe.mask_table import MaskTable, share_unlike_rays
    from gbas_studies.abia.mask_figure import mask_figure

    check("--horizon-deg", horizon_deg, -90.0 <= horizon_deg < 90.0, "-90 to below 90 degrees")
    check("--looks", looks, looks in (None, "up", "down"), "up or down")
    if out is not None:
        check("--out", out, out.suffix.lower() in (".png", ".svg", ".pdf"), "a .png, .svg or .pdf file")
    airframe, placed = _mounted(mesh, antenna, looks, axes=axes, scale_m=scale_m, closed=not open_mesh)
    table = MaskTable.of_mesh(airframe, placed.place_m, horizon_rad=math.radians(horizon_deg), axis=placed.axis)
    unlike = share_unlike_rays(table, airframe, placed.place_m)
    picture = out or new_out(None, "mask") / "mask.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    mask_figure(table, airframe, placed.place_m).savefig(picture, dpi=130)
    document = {
        "mesh": airframe.name,
        "triangles": len(airframe.faces),
        "checked_for_holes": airframe.closed,
        "antenna_forward_right_down_m": list(placed.place_m),
        "horizon_deg": horizon_deg,
        "hidden_percent": 100.0 * table.blocked_share(),
        "hidden_above_horizon_percent": 100.0 * table.blocked_share(max(table.horizon_rad, 0.0)),
        "table_unlike_rays_percent": 100.0 * unlike,
        "picture": str(picture),
    }
    if as_json:
        print_json(document)
        return
    print(f"{airframe.name}: {len(airframe.faces)} triangles")
    if not airframe.closed:
        print("the mesh was not checked for holes: what is behind one counts as seen")
    print(f"hidden by the airframe      {document['hidden_percent']:.3f} % of the antenna's hemisphere")
    print(f"of what is above {horizon_deg:g} deg    {document['hidden_above_horizon_percent']:.3f} %")
    print(f"table against direct rays   {document['table_unlike_rays_percent']:.3f} % of 65536 directions differ")
    print_places({"picture": picture})


def _mounted(
    mesh: str, antenna: str, looks: str | None, *, axes: str, scale_m: float, closed: bool
) -> tuple[Airframe, Antenna]:
    """An airframe, ours or from a file, and an antenna on it."""
    from gbas_airborne.abia.airframe.aircraft import AIRCRAFT, BODY_DOWN, Antenna, aircraft_of
    from gbas_airborne.abia.airframe.mask_table import BODY_UP
    from gbas_airborne.abia.airframe.mesh import axes_of, read_airframe

    turn = axes_of(axes)
    named = mesh in AIRCRAFT
    airframe = aircraft_of(mesh).airframe if named else read_airframe(mesh, axes=axes, scale_m=scale_m, closed=closed)
    axis = {"up": BODY_UP, "down": BODY_DOWN, None: None}[looks]
    if named and "," not in antenna:
        known = aircraft_of(mesh).antenna(antenna)
        return airframe, known if axis is None else known._replace(axis=axis)
    bound = "X,Y,Z in metres, in the mesh's axes" + (", or the name of an antenna" if named else "")
    place = numbers_of("--antenna", antenna, bound)
    check("--antenna", antenna, len(place) == 3, bound)
    forward, right, down = (float(each) for each in turn @ place)
    return airframe, Antenna("given", (forward, right, down), axis or BODY_UP)
