"""Write the sample office: two storeys with stairs, a lift and a plant room, as IFC4 in millimetres.

    python data/ifc/make_office.py

rewrites office.ifc beside this script, to the byte. The building is our own design; all numbers in this
script are metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ifcopenshell import entity_instance
from ifcopenshell.api import aggregate, feature, spatial, system
from make_samples import Author, Kind, Prism, Variant, block

VARIANT = Variant("office", "IFC4", "DesignTransferView_V1.0", 0.001)
_DECIMALS = 6  # of a millimetre

HEIGHT, SLAB, CLEAR = 3.3, 0.3, 3.0  # from floor to floor, of a slab, of a room
OUTER, INNER = 0.2, 0.1  # thickness of walls
DOOR, WIDE, WINDOW, SILL = (1.0, 2.1), (1.4, 2.1), (1.6, 1.4), 0.9
RISERS, GOING = 18, 0.26


def leaf(width: float, height: float, wall: float) -> tuple[Prism, ...]:
    """Return a leaf, or a pane, in a frame that fills an opening."""
    edge, middle = 0.05, wall / 2
    return (
        block(0, 0, edge, wall, 0, height),
        block(width - edge, 0, width, wall, 0, height),
        block(edge, 0, width - edge, wall, height - edge, height),
        block(edge, middle - 0.02, width - edge, middle + 0.02, 0, height - edge),
    )


def legs(x: float, y: float, height: float) -> tuple[Prism, ...]:
    """Return four square legs around the origin."""
    return tuple(Prism((0.05, 0.05), 0, height, (x * i, y * j)) for i in (-1, 1) for j in (-1, 1))


MAKER = "Pset_ManufacturerTypeInformation"

KINDS = {
    "outer wall": Kind("IfcWall", "Basic Wall:Masonry 200", predefined="SOLIDWALL"),
    "inner wall": Kind("IfcWall", "Basic Wall:Partition 100", predefined="PARTITIONING"),
    "floor": Kind("IfcSlab", "Floor:Concrete 300", predefined="FLOOR"),
    "roof": Kind("IfcSlab", "Basic Roof:Concrete 300", predefined="ROOF"),
    "entrance": Kind("IfcDoor", "Entrance Door:1400 x 2100", leaf(*WIDE, OUTER), predefined="DOOR"),
    "door": Kind("IfcDoor", "Single Door:1000 x 2100", leaf(*DOOR, INNER), predefined="DOOR"),
    "fire door": Kind("IfcDoor", "Fire Door:1000 x 2100 EI30", leaf(*DOOR, INNER), predefined="DOOR"),
    "lift door": Kind("IfcDoor", "Lift Door:1000 x 2100", leaf(*DOOR, INNER), predefined="DOOR"),
    "window": Kind("IfcWindow", "Fixed Window:1600 x 1400", leaf(*WINDOW, OUTER), predefined="WINDOW"),
    "stair": Kind("IfcStair", "Stair:Half Turn", predefined="HALF_TURN_STAIR"),
    "flight": Kind("IfcStairFlight", "Flight:Concrete 1200", predefined="STRAIGHT"),
    "landing": Kind("IfcSlab", "Landing:Concrete 150", predefined="LANDING"),
    "lift": Kind(
        "IfcTransportElement",
        "Passenger Lift:8 persons",
        predefined="ELEVATOR",
        maker={"Manufacturer": "Norvik Lifts", "ModelLabel": "Glide 630", "ProductionYear": "2023"},
    ),
    "desk": Kind("IfcFurniture", "Desk:1600 x 800", (Prism((1.6, 0.8), 0.70, 0.74), *legs(0.75, 0.35, 0.70))),
    "chair": Kind(
        "IfcFurniture",
        "Office Chair:Swivel",
        (Prism((0.25,), 0.42, 0.48), Prism((0.04,), 0.08, 0.42), Prism((0.3,), 0.04, 0.08)),
    ),
    "meeting table": Kind(
        "IfcFurniture", "Meeting Table:2400 x 1200", (Prism((2.4, 1.2), 0.70, 0.75), *legs(1.1, 0.5, 0.70))
    ),
    "bin": Kind("IfcFurniture", "Waste Bin:30 l", (Prism((0.15,), 0, 0.5),)),
    "shelf": Kind("IfcFurniture", "Shelf:1200 x 400", (Prism((1.2, 0.4), 0, 2.0),)),
    "reception": Kind("IfcFurniture", "Reception Desk:2000 x 700", (Prism((2.0, 0.7), 0, 1.1),)),
    "toilet": Kind("IfcSanitaryTerminal", "Toilet:Wall Hung", (Prism((0.38, 0.55), 0.3, 0.42),), "TOILETPAN"),
    "basin": Kind("IfcSanitaryTerminal", "Washbasin:550", (Prism((0.55, 0.45), 0.7, 0.86),), "WASHHANDBASIN"),
    "extinguisher": Kind(
        "IfcFireSuppressionTerminal",
        "Fire Extinguisher:6 kg Powder",
        (Prism((0.08,), 0, 0.5),),
        maker={"Manufacturer": "Redlund", "ModelLabel": "P6"},
    ),
    "detector": Kind("IfcSensor", "Smoke Detector:Optical", (Prism((0.05,), 0, 0.05),), "SMOKESENSOR"),
    "exit sign": Kind(
        "IfcLightFixture", "Exit Sign:Emergency Light", (Prism((0.3, 0.05), 0, 0.15),), "SECURITYLIGHTING"
    ),
    "board": Kind(
        "IfcElectricDistributionBoard",
        "Distribution Board:36 modules",
        (Prism((0.6, 0.2), 0, 0.9),),
        "DISTRIBUTIONBOARD",
        maker={"Manufacturer": "Ampere & Sons", "ModelLabel": "DB36", "ModelReference": "DB36-IP40"},
    ),
    "boiler": Kind(
        "IfcBoiler",
        "Boiler:Condensing 60 kW",
        (Prism((0.8, 0.7), 0.1, 1.6), Prism((0.9, 0.8), 0, 0.1)),
        "WATER",
        maker={
            "Manufacturer": "Kestrel Heating",
            "ModelLabel": "Condens 60",
            "ModelReference": "KH-C60",
            "ProductionYear": "2024",
        },
    ),
    "pump": Kind(
        "IfcPump",
        "Circulation Pump:DN40",
        (Prism((0.15,), 0, 0.35), Prism((0.4, 0.2), 0.1, 0.25)),
        "CIRCULATOR",
        maker={"Manufacturer": "Volta Pumps", "ModelLabel": "Circo 40", "ModelReference": "VP-C40"},
    ),
    "valve": Kind(
        "IfcValve",
        "Ball Valve:DN40",
        (Prism((0.18, 0.1), 0, 0.1), Prism((0.02,), 0.1, 0.2)),
        "ISOLATING",
        maker={"Manufacturer": "Hydra Valves", "ModelLabel": "BV40"},
    ),
    "pipe": Kind("IfcPipeSegment", "Pipe:Steel DN40", predefined="RIGIDSEGMENT"),
    "radiator": Kind("IfcSpaceHeater", "Radiator:Panel 22", (Prism((1.0, 0.1), 0.1, 0.7),), "RADIATOR"),
    "dock": Kind(
        "IfcElectricAppliance",
        "Charging Dock:Robot Dock",
        (Prism((0.4, 0.3), 0, 0.03),),
        "ROBOTDOCK",
        maker={"Manufacturer": "Marten Robotics", "ModelLabel": "Nest 2", "ModelReference": "MR-N2"},
    ),
    "spill": Kind("IfcBuildingElementProxy", "Water Spill:Puddle", (Prism((0.25,), 0, 0.001),)),
    "paper": Kind("IfcBuildingElementProxy", "Litter:Paper", (Prism((0.2, 0.15), 0, 0.005),)),
}

# rooms of a storey: number, name on the ground floor and above, x0, y0, x1, y1; stairs and lift have no slab above
ROOMS = (
    ("01", "Corridor", "Corridor", 0.0, 4.0, 18.0, 6.0),
    ("02", "Lobby", "Lounge", 0.0, 0.0, 5.0, 3.9),
    ("03", "Meeting Room", "Meeting Room", 5.1, 0.0, 9.0, 3.9),
    ("04", "Office", "Office", 9.1, 0.0, 13.0, 3.9),
    ("05", "Plant Room", "Archive", 13.1, 0.0, 18.0, 3.9),
    ("06", "Stairwell", "Stairwell", 0.0, 6.1, 3.0, 10.0),
    ("07", "Lift", "Lift", 3.1, 6.1, 5.0, 8.0),
    ("08", "WC", "WC", 5.1, 6.1, 8.0, 10.0),
    ("09", "Open Office", "Open Office", 8.1, 6.1, 13.0, 10.0),
    ("10", "Storage", "Server Room", 13.1, 6.1, 18.0, 10.0),
)
WALLS = (  # of each storey: kind, x0, y0, x1, y1
    ("outer wall", -0.2, -0.2, 18.2, 0.0),
    ("outer wall", -0.2, 10.0, 18.2, 10.2),
    ("outer wall", -0.2, 0.0, 0.0, 10.0),
    ("outer wall", 18.0, 0.0, 18.2, 10.0),
    ("inner wall", 0.0, 3.9, 18.0, 4.0),
    ("inner wall", 0.0, 6.0, 18.0, 6.1),
    *(("inner wall", x, 0.0, x + 0.1, 3.9) for x in (5.0, 9.0, 13.0)),
    *(("inner wall", x, 6.1, x + 0.1, 10.0) for x in (3.0, 5.0, 8.0, 13.0)),
    ("inner wall", 3.1, 8.0, 5.0, 8.1),
)
DOORS = (  # of each storey: kind, wall, edge along it
    ("door", 4, 2.0),
    ("door", 4, 6.5),
    ("door", 4, 10.5),
    ("fire door", 4, 15.0),
    ("fire door", 5, 1.0),
    ("lift door", 5, 3.55),
    ("door", 5, 6.0),
    ("door", 5, 10.0),
    ("door", 5, 15.0),
)
WINDOWS = ((0, 6.2), (0, 10.2), (0, 14.7), (1, 9.8), (1, 14.7))  # of each storey: wall, edge along it

PIECES = (  # kind, storey, room, x, y, z above the floor, quarter turns
    ("reception", 0, "02", 3.8, 2.4, 0.0, 1),
    ("dock", 0, "02", 0.4, 0.4, 0.0, 0),
    ("spill", 0, "02", 1.5, 2.0, 0.0, 0),
    ("meeting table", 0, "03", 7.0, 2.0, 0.0, 0),
    *(("chair", 0, "03", x, y, 0.0, 0) for x in (6.3, 7.0, 7.7) for y in (1.0, 3.0)),
    ("desk", 0, "04", 10.2, 0.6, 0.0, 0),
    ("chair", 0, "04", 10.2, 1.4, 0.0, 0),
    ("bin", 0, "04", 11.4, 0.4, 0.0, 0),
    *(("desk", 0, "09", x, 9.4, 0.0, 0) for x in (9.2, 11.6)),
    *(("chair", 0, "09", x, 8.6, 0.0, 0) for x in (9.2, 11.6)),
    ("bin", 0, "09", 10.4, 9.7, 0.0, 0),
    ("paper", 0, "09", 10.6, 7.4, 0.0, 0),
    ("toilet", 0, "08", 5.6, 9.6, 0.0, 0),
    ("basin", 0, "08", 7.6, 9.7, 0.0, 0),
    *(("shelf", 0, "10", x, 9.7, 0.0, 0) for x in (14.0, 15.4)),
    ("board", 0, "10", 17.85, 8.0, 1.1, 1),
    ("extinguisher", 0, "01", 9.0, 4.15, 0.6, 0),
    ("exit sign", 0, "01", 17.9, 5.0, 2.3, 1),
    *(("detector", storey, "01", x, 5.0, 2.95, 0) for storey in (0, 1) for x in (4.5, 13.5)),
    ("detector", 0, "05", 15.5, 2.0, 2.95, 0),
    ("radiator", 0, "04", 11.0, 0.1, 0.0, 0),
    ("meeting table", 1, "03", 7.0, 2.0, 0.0, 0),
    *(("chair", 1, "03", x, y, 0.0, 0) for x in (6.3, 7.7) for y in (1.0, 3.0)),
    ("desk", 1, "04", 10.2, 0.6, 0.0, 0),
    ("chair", 1, "04", 10.2, 1.4, 0.0, 0),
    ("bin", 1, "04", 11.4, 0.4, 0.0, 0),
    *(("desk", 1, "09", x, 9.4, 0.0, 0) for x in (9.2, 11.6)),
    ("bin", 1, "09", 10.4, 9.7, 0.0, 0),
    ("spill", 1, "09", 9.6, 7.4, 0.0, 0),
    ("paper", 1, "02", 2.5, 1.5, 0.0, 0),
    ("toilet", 1, "08", 5.6, 9.6, 0.0, 0),
    ("basin", 1, "08", 7.6, 9.7, 0.0, 0),
    *(("shelf", 1, "05", x, 0.3, 0.0, 0) for x in (14.0, 15.4)),
    ("extinguisher", 1, "01", 9.0, 4.15, 0.6, 0),
    ("exit sign", 1, "01", 3.6, 5.95, 2.3, 0),
)

PLANT = (  # the heating circuit in the direction of flow: key, kind, x, y, z; pipes: from x to x
    ("boiler", "boiler", 13.8, 0.6, 0.0),
    ("pipe 1", "pipe", (14.25, 14.75), 0.3, 1.2),
    ("supply valve", "valve", 14.85, 0.3, 1.15),
    ("pipe 2", "pipe", (14.95, 15.45), 0.3, 1.2),
    ("pump", "pump", 15.65, 0.3, 1.05),
    ("pipe 3", "pipe", (15.85, 17.0), 0.3, 1.2),
    ("branch valve", "valve", 17.1, 0.3, 1.15),
    ("pipe 4", "pipe", (17.2, 17.8), 0.3, 1.2),
)

RECORDS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "boiler": {
        "Pset_ManufacturerOccurrence": {"SerialNumber": "C60-24-00817", "AcquisitionDate": "2024-09-02"},
        "Pset_Warranty": {
            "WarrantyIdentifier": "KH-817",
            "WarrantyStartDate": "2024-09-02",
            "WarrantyPeriod": "P5Y",
            "PointOfContact": "Kestrel Heating service",
            "WarrantyContent": "Heat exchanger and burner.",
        },
        "Pset_ServiceLife": {"ServiceLifeDuration": "P15Y", "MeanTimeBetweenFailure": "P4Y"},
        "Maintenance": {"LastService": "2026-03-11", "NextService": "2027-03-11", "SpareParts": "Burner gasket KH-G12"},
    },
    "pump": {
        "Pset_ManufacturerOccurrence": {"SerialNumber": "VC40-5521", "AcquisitionDate": "2024-09-02"},
        "Pset_Warranty": {"WarrantyStartDate": "2024-09-02", "WarrantyPeriod": "P2Y", "PointOfContact": "Volta Pumps"},
    },
    "supply valve": {"Pset_ManufacturerOccurrence": {"SerialNumber": "BV40-101", "AcquisitionDate": "2024-08-20"}},
    "branch valve": {"Pset_ManufacturerOccurrence": {"SerialNumber": "BV40-102", "AcquisitionDate": "2024-08-20"}},
}


class Office(Author):
    """The office in the making. Lengths come in metres."""

    def __init__(self) -> None:
        super().__init__(VARIANT, "Office", KINDS)
        self.count = 500000

    def lengths(self, metres: Iterable[float]) -> tuple[float, ...]:
        """Convert metres to model units."""
        return tuple(round(value / self.variant.scale, _DECIMALS) for value in metres)

    def piece(self, key: str, container: entity_instance) -> entity_instance:
        """Create the next element of a kind."""
        self.count += 1
        return self.element(key, self.count, container)


def write_office(path: Path) -> None:
    """Write the office."""
    author = Office()
    site = author.spatial("IfcSite", "Office Site", author.project)
    building = author.spatial("IfcBuilding", "Office Building", site)
    storeys, rooms = [], []
    for level, name in enumerate(("Ground Floor", "First Floor")):
        storey = author.spatial("IfcBuildingStorey", name, building, Elevation=author.lengths([level * HEIGHT])[0])
        author.place(storey, building, (0.0, 0.0, level * HEIGHT))
        storeys.append(storey)
        rooms.append({room[0]: _write_room(author, storey, level, *room) for room in ROOMS})
        _write_slab(author, storey, level)
        walls = [_write_wall(author, storey, *wall) for wall in WALLS]
        for kind, wall, edge in DOORS:
            _write_opening(author, storey, walls[wall], WALLS[wall], kind, edge)
        for wall, edge in WINDOWS:
            _write_opening(author, storey, walls[wall], WALLS[wall], "window", edge)
        if level == 0:
            _write_opening(author, storey, walls[0], WALLS[0], "entrance", 2.0)
    roof = author.piece("roof", storeys[1])
    author.place(roof, storeys[1])
    author.shape(roof, [block(-0.2, -0.2, 18.2, 10.2, CLEAR, CLEAR + SLAB)])
    _write_stair(author, storeys[0])
    _write_lift(author, storeys[0])
    for key, level, room, x, y, z, turns in PIECES:
        piece = author.piece(key, rooms[level][room])
        author.place(piece, storeys[level], (x, y, z), turns)
    _write_plant(author, storeys[0], rooms[0]["05"])
    author.write(path)


def _write_room(
    author: Office, storey: entity_instance, level: int, number: str, ground: str, above: str, *box: float
) -> entity_instance:
    name = f"{level}{number}"
    room = author.spatial("IfcSpace", name, storey, LongName=ground if level == 0 else above, PredefinedType="INTERNAL")
    author.shape(room, [block(*box, 0.0, CLEAR)])
    return room


def _write_slab(author: Office, storey: entity_instance, level: int) -> None:
    slab = author.piece("floor", storey)
    author.place(slab, storey)
    author.shape(slab, [block(-0.2, -0.2, 18.2, 10.2, -SLAB, 0.0)])
    if level:  # the stairwell from where the stairs begin, and the shaft of the lift
        for name, box in (("stairs", (0.0, 7.0, 3.0, 10.0)), ("lift", (3.1, 6.1, 5.0, 8.0))):
            void = author.root("IfcOpeningElement", f"Opening for the {name}", "OPENING")
            feature.add_feature(author.model, void, slab)
            author.place(void, slab)
            author.shape(void, [block(*box, -SLAB, 0.0)])


def _write_wall(author: Office, storey: entity_instance, kind: str, *box: float) -> entity_instance:
    wall = author.piece(kind, storey)
    author.place(wall, storey, (box[0], box[1], 0.0))
    author.shape(wall, [block(0.0, 0.0, box[2] - box[0], box[3] - box[1], 0.0, CLEAR)])
    author.describe(wall, "Pset_WallCommon", {"IsExternal": kind == "outer wall"})
    return wall


def _write_opening(
    author: Office, storey: entity_instance, wall: entity_instance, drawn: tuple[Any, ...], kind: str, edge: float
) -> None:
    _, x0, y0, _, y1 = drawn
    width, height = {"entrance": WIDE, "window": WINDOW}.get(kind, DOOR)
    filling = author.piece(kind, storey)
    void = author.root("IfcOpeningElement", f"Opening:{author.count}", "OPENING")
    feature.add_feature(author.model, void, wall)
    author.place(void, wall, (edge - x0, 0.0, SILL if kind == "window" else 0.0))
    author.shape(void, [block(0.0, 0.0, width, y1 - y0, 0.0, height)])
    feature.add_filling(author.model, void, filling)
    author.place(filling, void)
    filling.OverallWidth, filling.OverallHeight = author.lengths((width, height))
    if kind != "window":
        facts: dict[str, Any] = {"IsExternal": kind == "entrance", "FireExit": kind == "entrance"}
        facts |= {"FireRating": "EI30"} if kind == "fire door" else {}
        author.describe(filling, "Pset_DoorCommon", facts)


def _write_stair(author: Office, storey: entity_instance) -> None:
    """Write two flights with a landing between them: up along y, then back."""
    stair = author.piece("stair", storey)
    author.place(stair, storey)
    riser, count = HEIGHT / RISERS, RISERS // 2
    half = HEIGHT / 2
    turn = 7.0 + (count - 1) * GOING  # where the landing begins
    flights = (
        [block(0.1, 7.0 + k * GOING, 1.3, 7.0 + (k + 1) * GOING, 0.0, (k + 1) * riser) for k in range(count - 1)],
        [
            block(1.6, turn - (k + 1) * GOING, 2.8, turn - k * GOING, half + k * riser, half + (k + 1) * riser)
            for k in range(count - 1)
        ],
    )
    parts = []
    for solids in flights:
        flight = author.piece("flight", storey)
        flight.NumberOfRisers, flight.NumberOfTreads = count, count - 1
        flight.RiserHeight, flight.TreadLength = author.lengths((riser, GOING))
        author.shape(flight, solids)
        parts.append(flight)
    landing = author.piece("landing", storey)
    author.shape(landing, [block(0.1, turn, 2.8, 10.0, half - 0.15, half)])
    parts.append(landing)
    spatial.unassign_container(author.model, parts)
    aggregate.assign_object(author.model, parts, stair)
    for part in parts:
        author.place(part, stair)


def _write_lift(author: Office, storey: entity_instance) -> None:
    """Write rails over both storeys, and a cabin at the ground."""
    lift = author.piece("lift", storey)
    author.place(lift, storey)
    rails = [block(x, 7.0, x + 0.05, 7.05, 0.0, 2 * HEIGHT - SLAB) for x in (3.15, 4.9)]
    cabin = [
        block(3.3, 6.3, 4.8, 7.8, 0.0, 0.02),
        block(3.3, 7.75, 4.8, 7.8, 0.02, 2.2),
        block(3.3, 6.3, 3.35, 7.75, 0.02, 2.2),
        block(4.75, 6.3, 4.8, 7.75, 0.02, 2.2),
    ]
    author.shape(lift, [*rails, *cabin])
    author.describe(lift, "Pset_TransportElementElevator", {"FireFightingLift": False})


def _write_plant(author: Office, storey: entity_instance, room: entity_instance) -> None:
    """Write the heating circuit, joined from port to port in the direction of flow."""
    heating = system.add_system(author.model, "IfcDistributionSystem")
    heating.GlobalId, heating.Name, heating.PredefinedType = author.root_id("Heating"), "Heating", "HEATING"
    products = []
    for key, kind, x, y, z in PLANT:
        product = author.piece(kind, room)
        product.Description = key
        if isinstance(x, tuple):
            author.place(product, storey, (x[0], y, z))
            author.shape(product, [block(0.0, -0.025, x[1] - x[0], 0.025, -0.025, 0.025)])
        else:
            author.place(product, storey, (x, y, z))
        for name, values in RECORDS.get(key, {}).items():
            author.describe(product, name, values)
        products.append(product)
    system.assign_system(author.model, products, heating)
    out = None
    for product in products:
        if out is not None:
            system.connect_port(author.model, out, _port(author, product, "SINK"), direction="SOURCE")
        out = _port(author, product, "SOURCE")


def _port(author: Office, product: entity_instance, direction: str) -> entity_instance:
    port = system.add_port(author.model, product)
    port.Name = f"{direction.lower()} of {product.Name}"
    port.GlobalId, port.FlowDirection = author.root_id(port.Name), direction
    return port


if __name__ == "__main__":
    write_office(Path(__file__).parent / f"{VARIANT.name}.ifc")
    print(f"wrote {VARIANT.name}.ifc")
