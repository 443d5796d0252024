"""sick: an iCon buffer, NAME.xml that tells the layout and NAME.dat that holds the components; 0 is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, read_bytes
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import MAX_POINTS, MAX_PROFILE_BYTES, Source, cell_value

Array = NDArray[np.float64]

NAME = "sick"
_TYPES = {"BYTE": "<u1", "WORD": "<u2", "INT": "<i4", "DWORD": "<u4", "FLOAT": "<f4", "DOUBLE": "<f8", "SHORT": "<i2"}
_MAX_XML = 4 * 2**20


def recognises(source: Source) -> bool:
    """By the XML's root, in the file or in the one beside it."""
    if "<icon_data_format" in source.head:
        return True
    xml = source.beside(".xml")
    if source.path.suffix.lower() != ".dat" or not xml.is_file():
        return False
    return b"<icon_data_format" in read_bytes(xml, _MAX_XML)[:4096]


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile a line of the buffer, in the units of its calibration."""
    xml, data = _pair(source)
    root = _parse(xml)
    component = next((c for c in root.iter("component") if _part(c, "range") is not None), None)
    if component is None:
        raise InputError(f"{xml}: tells of no component with a subcomponent Range")
    height = _whole(component, "height", xml)
    layout = _parameters(root).get("layout", "SUBCOMPONENT")
    parts = [p for c in root.iter("component") for p in c.iter("subcomponent")]
    if layout != "SUBCOMPONENT" and len(parts) > 1:
        raise InputError(f"{xml}: has the layout {layout[:40]}; only SUBCOMPONENT can be read with several components")
    arrays: dict[str, NDArray[Any]] = {}
    offset = 0
    for part in parts:
        kind = str(part.get("valuetype", "")).upper()
        if kind not in _TYPES:
            raise InputError(f'{xml}: the type "{kind[:40]}" of {part.get("name", "a subcomponent")} is unknown')
        dtype, width = np.dtype(_TYPES[kind]), _whole(part, "width", xml)
        count = width * height
        if count > MAX_POINTS or offset + count * dtype.itemsize > len(data):
            raise InputError(f"{xml}: announces more than the {len(data)} bytes of {xml.with_suffix('.dat').name}")
        arrays.setdefault(_name(part), np.frombuffer(data, dtype, count, offset).reshape(height, width))
        offset += count * dtype.itemsize
    return _scan_lines(component, arrays, told, xml)


def _pair(source: Source) -> tuple[Path, bytes]:
    """The XML's path and the data's bytes, whichever of the two was named."""
    if "<icon_data_format" in source.head:
        return source.path, read_bytes(source.beside(".dat"), MAX_PROFILE_BYTES, "buffer")
    return source.beside(".xml"), source.data


def _parse(path: Path) -> Any:
    """The XML without entities or external files."""
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import ParseError, fromstring

    try:
        return fromstring(read_bytes(path, _MAX_XML))
    except ParseError as error:
        raise InputError(f"{path}: is no XML ({str(error)[:80]})") from None
    except DefusedXmlException:
        raise InputError(f"{path}: declares entities, which no such file does") from None
    except (ValueError, LookupError, RecursionError) as error:
        raise InputError(f"{path}: is no XML ({str(error)[:80]})") from None


def _parameters(element: Any) -> dict[str, str]:
    return {str(p.get("name", "")): (p.text or "").strip() for p in element.findall("parameter")}


def _whole(element: Any, name: str, path: Path) -> int:
    text = _parameters(element).get(name, "")
    if not (text.isascii() and text.isdigit()) or len(text) > 9 or int(text) == 0:
        raise InputError(
            f'{path}: {element.get("name", "a component")} has {name} "{text[:20]}", a whole number is right'
        )
    return int(text)


def _name(part: Any) -> str:
    return str(part.get("name", "")).strip().casefold()


def _part(component: Any, name: str) -> Any:
    return next((p for p in component.iter("subcomponent") if _name(p) == name), None)


def _scan_lines(component: Any, arrays: dict[str, NDArray[Any]], told: Told, path: Path) -> tuple[ScanLine, ...]:
    traits = next(iter(component.iter("genistreamtraits")), None)
    values = {} if traits is None else _parameters(traits)
    ranges = arrays["range"]
    if values.get("unit", "millimeter").casefold() not in ("millimeter", "millimetre", "mm"):
        raise InputError(f'{path}: the unit is "{values["unit"][:40]}"; a calibrated buffer in millimetres is needed')
    scaled = "c axis range scale" in values
    if ranges.dtype.kind != "f" and not scaled:
        raise InputError(f"{path}: the buffer is not calibrated (no c axis range scale): its counts are no millimetres")
    z = _axis(ranges, "c", values, path)
    z[ranges == 0] = np.nan
    n = ranges.shape[1]
    if "range x" in arrays and arrays["range x"].shape == ranges.shape:
        y = _axis(arrays["range x"], "a", values, path)
    elif "a axis range scale" in values:
        y = np.broadcast_to(_axis(np.arange(n), "a", {**values, "a axis range missing": "false"}, path), ranges.shape)
    else:
        y = np.broadcast_to(told.lateral(n, path), ranges.shape)
    light = arrays.get("intensity", arrays.get("reflectance"))
    light = None if light is None or light.shape != ranges.shape else light.astype(float)
    several = len(z) > 1
    return tuple(
        ScanLine(np.array(y[k]), z[k], None if light is None else light[k], number=k if several else None)
        for k in range(len(z))
    )


def _axis(raw: NDArray[Any], axis: str, values: dict[str, str], path: Path) -> Array:
    def of(name: str, default: float) -> float:
        text = values.get(f"{axis} axis range {name}", "")
        value = cell_value(text, f"{path}: {axis} axis range {name}") if text else default
        if not np.isfinite(value):
            raise InputError(f"{path}: {axis} axis range {name} is not finite")
        return value

    out = raw.astype(float) * of("scale", 1.0) + of("offset", 0.0)
    if values.get(f"{axis} axis range missing", "").casefold() == "true":
        out = np.where(raw == of("missing value", 0.0), np.nan, out)
    return np.array(out)
