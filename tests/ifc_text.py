"""IFC text written by hand, small enough to break on purpose."""

from __future__ import annotations

from collections.abc import Iterable

HEADER = (
    "ISO-10303-21;",
    "HEADER;",
    "FILE_DESCRIPTION((''),'2;1');",
    "FILE_NAME('','',(''),(''),'','','');",
    "FILE_SCHEMA(('IFC4'));",
    "ENDSEC;",
    "DATA;",
)
FRAME = (
    "#1=IFCPROJECT('0000000000000000000001',$,'house',$,$,$,$,(#4),#2);",
    "#2=IFCUNITASSIGNMENT((#3));",
    "#3=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);",
    "#4=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#5,$);",
    "#5=IFCAXIS2PLACEMENT3D(#6,$,$);",
    "#6=IFCCARTESIANPOINT((0.,0.,0.));",
    "#7=IFCBUILDINGSTOREY('0000000000000000000002',$,'ground',$,$,#8,$,$,.ELEMENT.,0.);",
    "#8=IFCLOCALPLACEMENT($,#5);",
    "#9=IFCRELAGGREGATES('0000000000000000000003',$,$,$,#1,(#7));",
    "#10=IFCDIRECTION((0.,0.,1.));",
    "#11=IFCRECTANGLEPROFILEDEF(.AREA.,$,$,1.,1.);",
)
FOOTER = ("ENDSEC;", "END-ISO-10303-21;")


def product(number: int, *item: str, name: str = "thing", ifc_class: str = "IFCBUILDINGELEMENTPROXY") -> list[str]:
    """A product #n whose body is the item #n+4."""
    return [
        f"#{number}={ifc_class}('{number:022d}',$,'{name}',$,$,#{number + 1},#{number + 2},$,$);",
        f"#{number + 1}=IFCLOCALPLACEMENT(#8,#5);",
        f"#{number + 2}=IFCPRODUCTDEFINITIONSHAPE($,$,(#{number + 3}));",
        f"#{number + 3}=IFCSHAPEREPRESENTATION(#4,'Body','SweptSolid',(#{number + 4}));",
        *item,
    ]


def box(number: int, name: str = "box", ifc_class: str = "IFCBUILDINGELEMENTPROXY") -> list[str]:
    """A cube of one metre."""
    return product(number, f"#{number + 4}=IFCEXTRUDEDAREASOLID(#11,$,#10,1.);", name=name, ifc_class=ifc_class)


def crasher(number: int) -> list[str]:
    """A product whose profile has no point; the kernel dies of it, and no first look can tell."""
    return product(
        number,
        f"#{number + 4}=IFCEXTRUDEDAREASOLID(#{number + 5},$,#10,1.);",
        f"#{number + 5}=IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,#{number + 6});",
        f"#{number + 6}=IFCPOLYLINE(());",
        name="crasher",
    )


def staller(number: int) -> list[str]:
    """A product that is the union of itself with itself, twenty times over; the kernel does not come back."""
    unions = [
        f"#{number + 5 + k}=IFCBOOLEANRESULT(.UNION.,#{first},#{first});"
        for k, first in enumerate([104, *range(number + 5, number + 24)])
    ]
    return product(
        number, f"#{number + 4}=IFCBOOLEANRESULT(.UNION.,#{number + 24},#{number + 24});", *unions, name="staller"
    )


def model(*lines: str | Iterable[str], frame: Iterable[str] = FRAME, schema: str = "IFC4", end: bool = True) -> str:
    """The text of a model: one box #100, and what else is given."""
    body = [line for part in (box(100), *lines) for line in ([part] if isinstance(part, str) else part)]
    header = [line.replace("IFC4", schema) for line in HEADER]
    return "\n".join([*header, *frame, *body, *(FOOTER if end else ())]) + "\n"
