"""What the text of a model holds and its parser did not give: the products that miss it count as lost."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from bimnav.ifc._extent import extent_of
from bimnav.ifc._findings import Findings
from bimnav.ifc._kernel import attribute
from bimnav.ifc._model import Model
from bimnav.ifc._products import derived_id, identify, is_body, is_global_id, sorted_of

__all__ = ["broken_products", "note_lost"]

_DANGLING = re.compile(r"Instance reference #(\d+) used by instance #(\d+) at attribute index (\d+)")
_STATEMENT = re.compile(rb"#\s*+(\d++)\s*+=[^;]*+;")
_TOKEN = re.compile(rb"'[^']*+'|/\*.*?\*/|[()]|[^(),'\s]++", re.DOTALL)
_HOLE = re.compile(rb"(?<=[(,])\s*+(?:\([^()'$*]*+[$*]|[$*]\s*+,\s*+\()")  # perhaps: $ in a list within a list
_SOUND = re.compile(rb"\s*+\#\d++=\w++\((?:[^()'/;]++|\((?:\#\d++,?+)++\))*+\);")  # its lists hold references alone
_PLACEMENT, _BODY = "5", "6"  # attributes of every product
_GEOMETRY = (
    "IfcObjectPlacement",
    "IfcProductRepresentation",
    "IfcProfileDef",
    "IfcRepresentation",
    "IfcRepresentationItem",
    "IfcRepresentationMap",
)


def broken_products(file: Any, text: bytes, log: Any) -> dict[int, str]:
    """Find the products whose body or placement lacks what the parser could not give.

    Parameters
    ----------
    text
        What was parsed.
    log
        What the parser had to say.

    Returns
    -------
    reasons
        Step id to what is missing.
    """
    reasons: dict[int, str] = {}
    waiting: deque[tuple[Any, str]] = deque()
    messages = [str(message.message) for message in log.log_messages()]
    for number in _torn(text, has_complained=any("ggregate" in message for message in messages)):
        with suppress(RuntimeError):  # not even its class is known
            waiting.append((file.by_id(number), f"a list in #{number} has members that cannot be read"))
    for message in messages:
        if found := _DANGLING.match(message):
            missing, user, attribute = found.groups()
            entity, reason = file.by_id(int(user)), f"it refers to #{missing}, which is not there or cannot be read"
            if not entity.is_a("IfcProduct"):
                waiting.append((entity, reason))
            elif attribute == _BODY or (attribute == _PLACEMENT and entity.Representation):
                reasons.setdefault(entity.id(), reason)
    seen: set[int] = set()
    while waiting:
        entity, reason = waiting.popleft()
        if entity.is_a("IfcProduct") and entity.Representation:
            reasons.setdefault(entity.id(), reason)
        elif entity.id() not in seen and _is_of_a_body(entity):
            seen.add(entity.id())
            users = sorted(file.get_inverse(entity), key=lambda user: int(user.id()))
            waiting.extend((user, reason) for user in users)
    return reasons


def _torn(text: bytes, *, has_complained: bool) -> Iterator[int]:
    """Yield the numbers of entities with a list whose members are missing or of several kinds.

    The parser drops such members: without a word if they are missing, else it complains, but not of what.
    """
    if has_complained:
        statements = _STATEMENT.finditer(text)
    else:
        starts = (text.rfind(b";", 0, match.start()) + 1 for match in _HOLE.finditer(text))
        doubtful = (start for start in starts if not _SOUND.match(text, start))
        statements = (match for start in doubtful if (match := _STATEMENT.search(text, start)))
    yield from dict.fromkeys(int(match[1]) for match in statements if _is_torn(match[0]))


def _is_torn(statement: bytes) -> bool:
    lists: list[set[bytes]] = [set()]
    for token in _TOKEN.findall(statement):
        if token == b"(":
            lists.append(set())
        elif token != b")":
            lists[-1].add(b"0" if token[:1] in b"+-0123456789" else token[:1])
        elif len(lists) > 1:
            kinds = lists.pop() - {b"/"}
            has_types = any(kind.isalpha() for kind in kinds)  # as in (#1,IFCPARAMETERVALUE(0.))
            if len(lists) > 1 and (kinds & {b"$", b"*"} or (len(kinds) > 1 and not has_types)):
                return True
            lists[-1].add(token)
    return False


def _is_of_a_body(entity: Any) -> bool:
    if not any(entity.is_a(name) for name in _GEOMETRY):
        return False
    return not entity.is_a("IfcRepresentation") or is_body(entity.RepresentationIdentifier)


def note_lost(model: Model, file: Any, broken: Mapping[int, str], shaped: Mapping[int, tuple[str, str]]) -> None:
    """Count as lost what the parser dropped, wholly or in part; without that the ledger would not close.

    Parameters
    ----------
    model
        What was read of the file; changed in place.
    broken
        Step id to reason, as of `broken_products`.
    shaped
        Step id to class and GlobalId of all products that have a representation by the text.
    """
    tables, ledger = model.tables, model.tables["ledger"]
    asked = {p.id(): p for p in sorted_of(file, "IfcProduct") if attribute(p, "Representation")}
    unseen = sorted((shaped.keys() | broken.keys()) - asked.keys())
    if not broken and not unseen:
        return
    ids, _ = identify(sorted_of(file, "IfcProduct"))
    by_class = {g for g, rule in ledger["left_out"].items() if rule != "no-body"}
    reasons = {step_id: reason for step_id, reason in broken.items() if ids[step_id] not in by_class}
    for step_id in unseen:
        if step_id not in ids:  # its class is unknown
            kind, written = shaped[step_id]
            is_free = is_global_id(written) and written not in ids.values()
            ids[step_id] = written if is_free else derived_id(f"{kind} #{step_id}")
            reasons[step_id] = f"{tables['schema']} has no class {kind}"
        reasons.setdefault(step_id, "its representation is not there or cannot be read")
        ledger["asked"].append(ids[step_id])
    findings = Findings(ids)
    findings.add(
        "damaged-text",
        "{n} [product refers|products refer] to what is not in the file or has no place in its schema.",
        reasons,
        severity="error",
        hint="The file is damaged or its exporter at fault; export it again.",
    )
    tables["issues"] += findings.rows
    for step_id, reason in reasons.items():
        ledger["left_out"].pop(ids[step_id], None)
        ledger["lost"][ids[step_id]] = reason
        box = extent_of(asked[step_id], tables["unit_scale"]) if step_id in asked else None
        if box is not None:
            ledger["lost_bounds"].setdefault(ids[step_id], box)
