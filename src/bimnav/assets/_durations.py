"""Durations and days as exporters and people write them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import date
from typing import Any

from bimnav.assets._names import squeezed

__all__ = ["day_after", "day_of", "duration_text"]

_YEAR, _MONTH = 365.25, 30.4375  # days
_UNITS = {"years": _YEAR, "months": _MONTH, "weeks": 7.0, "days": 1.0, "hours": 1 / 24, "seconds": 1 / 86400}
_UNIT_WORDS = {
    word: unit
    for unit, words in {
        "years": "year years yr yrs y a jahr jahre jahren jaar ans annees anni anos лет года 年",
        "months": "month months mo monat monate monaten maand maanden mois mesi meses месяцев ヶ月 月",
        "weeks": "week weeks woche wochen weken",
        "days": "day days d tag tage tagen dag dagen jours giorni dias дней 日",
        "hours": "hour hours h hr hrs stunde stunden uur heures ore horas часов",
        "seconds": "second seconds s sec",
    }.items()
    for word in words.split()
}
_NUMBER = re.compile(r"\s*(\d+(?:[.,]\d+)?)\s*(\w*)\s*")
_ISO = re.compile(r"P(?:([\d.,]+)Y)?(?:([\d.,]+)M)?(?:([\d.,]+)W)?(?:([\d.,]+)D)?(?:T.*)?")
_DATE = re.compile(r"\s*(\d{4})-(\d{2})-(\d{2})")
_IN_YEARS = ("servicelife", "warrantyduration", "expectedlife")  # COBie counts these in years unless it says otherwise


def duration_text(row: Mapping[str, Any], siblings: Mapping[tuple[str, str], Any]) -> tuple[str, str]:
    """Write a duration with its unit: from the value, a unit beside it, its description, or as COBie counts."""
    value, name = row["value"], row["name"]
    if isinstance(value, str):
        found = _NUMBER.fullmatch(value)
        if found is None or found[2]:
            return _spelled(value), ""
        value = float(found[1].replace(",", "."))
    beside = {
        siblings.get((row["set"], f"{stem}unit".casefold()))
        for stem in (name, re.sub(r"(Parts|Labou?r)$", "", name), "Duration", "WarrantyDuration")
    }
    stated = [row["unit"], *(str(unit) for unit in beside if unit), *re.findall(r"\((\w+)\)", row["description"])]
    for unit in stated:
        known = _UNIT_WORDS.get(unit.casefold())
        if known == "seconds":
            return _counted(float(f"{value * _UNITS['seconds'] / _YEAR:.3g}"), "years"), ""
        if known:
            return _counted(value, known), ""
    if any(word in squeezed(name) for word in _IN_YEARS):
        return _counted(value, "years"), " (no unit stated; COBie counts years)"
    return f"{value:g}", " (no unit stated)"


def _counted(count: float, unit: str) -> str:
    return f"{count:g} {unit.removesuffix('s') if count == 1 else unit}"


def _spelled(text: str) -> str:
    """Write an ISO 8601 duration in words, and anything else as it is."""
    found = _ISO.fullmatch(text.strip())
    if found is None or not any(found.groups()):
        return text.strip()
    counts = zip(found.groups(), ("years", "months", "weeks", "days"), strict=True)
    return " ".join(_counted(float(count.replace(",", ".")), unit) for count, unit in counts if count)


def day_of(text: str) -> date | None:
    """Read the day that a text begins with; None if it does not begin with one."""
    found = _DATE.match(text)
    try:
        return date(*map(int, found.groups())) if found else None
    except ValueError:
        return None


def day_after(start: date, duration: str) -> date | None:
    """Return the day on which a warranty ends: whole years and months go by the calendar; None if none is told."""
    months, days = 0, 0.0
    parts = re.findall(r"(\d+(?:[.,]\d+)?)\s*(\w+)", duration)
    for number, word in parts:
        count, unit = float(number.replace(",", ".")), _UNIT_WORDS.get(word.casefold())
        if unit is None:
            return None
        if unit in ("years", "months") and count.is_integer():
            months += int(count) * (12 if unit == "years" else 1)
        else:
            days += count * _UNITS[unit]
    if not parts or days > date.max.toordinal() or start.year + months // 12 >= date.max.year:
        return None
    turn, month = divmod(start.month - 1 + months, 12)
    first = date(start.year + turn, month + 1, 1)
    following = date(first.year + month // 11, (month + 1) % 12 + 1, 1)
    same_day = first.toordinal() + min(start.day, (following - first).days) - 1
    return date.fromordinal(min(same_day + round(days), date.max.toordinal()))
