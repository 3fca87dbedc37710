"""Asset cards: what the models say about operating and maintaining an element."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from datetime import date
from itertools import pairwise

import ifcopenshell
import ifcopenshell.guid
import pytest
from hypothesis import given, strategies as st

from bimnav import read_ifc
from bimnav.assets._names import FIELDS, field_of, tells_nothing
from bimnav.errors import ModelError
from bimnav.testing import box, room
from tests.conftest import real_model

TABLE = "2kvhekJrnDjRw0CDkKW$KL"


class Plant:
    """A file with a few connected elements, written line by line."""

    def __init__(self, schema: str = "IFC4") -> None:
        self.file = ifcopenshell.file(schema=schema)
        self.old = schema == "IFC2X3"
        self.owner = None
        if self.old:
            person = self.file.create_entity("IfcPerson", "p")
            company = self.file.create_entity("IfcOrganization", "o", "us")
            pair = self.file.create_entity("IfcPersonAndOrganization", person, company)
            program = self.file.create_entity("IfcApplication", company, "1", "by hand", "hand")
            self.owner = self.file.create_entity("IfcOwnerHistory", pair, program, None, "ADDED", None, None, None, 0)
        unit = self.file.create_entity("IfcSIUnit", None, "LENGTHUNIT", None, "METRE")
        project = self.make(
            "IfcProject", Name="plant", UnitsInContext=self.file.create_entity("IfcUnitAssignment", [unit])
        )
        self.storey = self.make("IfcBuildingStorey", Name="Cellar", Elevation=0.0, CompositionType="ELEMENT")
        self.relate("IfcRelAggregates", RelatingObject=project, RelatedObjects=[self.storey])
        self.elements = {}

    def make(self, ifc_class, **values):
        return self.file.create_entity(ifc_class, GlobalId=ifcopenshell.guid.new(), OwnerHistory=self.owner, **values)

    relate = make

    def add(self, ifc_class, name):
        element = self.elements[name] = self.make(ifc_class, Name=name)
        self.relate("IfcRelContainedInSpatialStructure", RelatedElements=[element], RelatingStructure=self.storey)
        return element

    def type_of(self, *elements, ifc_class="IfcFurnitureType", **values):
        kind = self.make(ifc_class, **values)
        self.relate("IfcRelDefinesByType", RelatedObjects=list(elements), RelatingType=kind)
        return kind

    def properties(self, owner, pset, unit=None, description=None, **values):
        def nominal(value):
            kind = {float: "IfcReal", int: "IfcInteger", str: "IfcLabel"}[type(value)]
            return self.file.create_entity(kind, value)

        props = [
            self.file.create_entity("IfcPropertySingleValue", name, description, nominal(value), unit)
            for name, value in values.items()
        ]
        made = self.make("IfcPropertySet", Name=pset, HasProperties=props)
        if owner.is_a("IfcTypeObject"):
            owner.HasPropertySets = [*(owner.HasPropertySets or ()), made]
        else:
            self.relate("IfcRelDefinesByProperties", RelatedObjects=[owner], RelatingPropertyDefinition=made)

    def port(self, element, flow):
        port = self.make("IfcDistributionPort", FlowDirection=flow)
        if self.old:
            self.relate("IfcRelConnectsPortToElement", RelatingPort=port, RelatedElement=element)
        else:
            self.relate("IfcRelNests", RelatingObject=element, RelatedObjects=[port])
        return port

    def flow(self, *names, directed=True):
        """Connect elements one after the other, in the direction of the flow."""
        for a, b in pairwise(names):
            ports = [
                self.port(self.elements[name], flow if directed else "NOTDEFINED")
                for name, flow in ((a, "SOURCE"), (b, "SINK"))
            ]
            self.relate("IfcRelConnectsPorts", RelatingPort=ports[0], RelatedPort=ports[1])

    def read(self, folder, name="plant.ifc"):
        self.file.write(str(folder / name))
        return read_ifc(folder / name, cache=False, isolate=False)

    def card(self, folder, name):
        return self.read(folder).asset(self.elements[name].GlobalId)


@pytest.fixture
def plant():
    return Plant()


def test_what_the_element_says_comes_before_what_its_type_says(plant, tmp_path):
    chair = plant.add("IfcFurniture", "chair")
    kind = plant.type_of(chair, Name="C1", PredefinedType="CHAIR")
    plant.properties(chair, "Identity Data", Manufacturer="Eigenbau")
    plant.properties(kind, "Pset_ManufacturerTypeInformation", Manufacturer="Works", ModelLabel="C-100")
    card = plant.card(tmp_path, "chair")
    assert (card.maker, card.model) == ("Eigenbau", "C-100")
    assert card.sources["maker"] == "Identity Data.Manufacturer of the element, plant.ifc"
    assert card.sources["model"] == "Pset_ManufacturerTypeInformation.ModelLabel of the type, plant.ifc"


def test_a_placeholder_on_the_element_gives_way_to_a_value_on_the_type(plant, tmp_path):
    chair = plant.add("IfcFurniture", "chair")
    kind = plant.type_of(chair, Name="C1", PredefinedType="CHAIR")
    plant.properties(chair, "Other", Manufacturer="Manufacturer", SerialNumber="N/A")
    plant.properties(kind, "Other", Manufacturer="Works")
    card = plant.card(tmp_path, "chair")
    assert (card.maker, card.serial_number) == ("Works", "")


def test_type_properties_that_revit_copies_to_elements_count_as_the_types(plant, tmp_path):
    chair = plant.add("IfcFurniture", "chair")
    plant.properties(chair, "PSet_Revit_Type_Identity Data", Manufacturer="Works")
    plant.properties(chair, "PSet_Revit_Identity Data", Fabrikat="Ours")
    assert plant.card(tmp_path, "chair").maker == "Ours"


@pytest.mark.parametrize(
    ("value", "unit", "description", "told"),
    [
        (5.0, None, None, "5 years"),
        (1.0, None, "Duration of parts warranty (years)", "1 year"),
        (24.0, None, "in whole (months)", "24 months"),
        ("P2Y", None, None, "2 years"),
        ("P1Y6M", None, None, "1 year 6 months"),
        ("18 Monate", None, None, "18 Monate"),
        (63115200.0, "SECOND", None, "2 years"),
    ],
)
def test_durations_carry_their_unit(plant, tmp_path, value, unit, description, told):
    pump = plant.add("IfcPump", "pump")
    seconds = unit and plant.file.create_entity("IfcSIUnit", None, "TIMEUNIT", None, unit)
    plant.properties(pump, "Pset_Warranty", seconds, description, WarrantyDurationParts=value)
    plant.properties(pump, "Pset_Component", WarrantyStartDate="2024-02-29")
    card = plant.card(tmp_path, "pump")
    assert card.warranty_duration == told
    ends = {"5 years": "2029-02-28", "1 year": "2025-02-28", "24 months": "2026-02-28", "2 years": "2026-02-28"}
    assert card.warranty_end == ends.get(told, "2025-08-29")


def test_the_warranty_holds_to_its_last_day(plant, tmp_path):
    pump = plant.add("IfcPump", "pump")
    plant.properties(pump, "Pset_Warranty", WarrantyStartDate="2024-01-01", WarrantyEndDate="2026-01-01")
    card = plant.card(tmp_path, "pump")
    days = (date(2023, 12, 31), date(2024, 1, 1), date(2026, 1, 1), date(2026, 1, 2))
    assert [card.is_under_warranty(day) for day in days] == [False, True, True, False]
    assert replace(card, warranty_end="soon").is_under_warranty(date(2025, 1, 1)) is None


def test_documents_systems_tasks_and_codes_are_on_the_card(plant, tmp_path):
    f, pump = plant.file, plant.add("IfcPump", "pump")
    manual = f.create_entity("IfcDocumentReference", "https://example.org/pump.pdf", "M-1", "Manual")
    plant.relate("IfcRelAssociatesDocument", RelatedObjects=[pump], RelatingDocument=manual)
    system = plant.make("IfcDistributionSystem", Name="Heating")
    plant.relate("IfcRelAssignsToGroup", RelatedObjects=[pump], RelatingGroup=system)
    book = f.create_entity("IfcClassification", Name="Uniclass 2015")
    code = f.create_entity("IfcClassificationReference", None, "Pr_65_53_86", "Pumps", book)
    plant.relate("IfcRelAssociatesClassification", RelatedObjects=[pump], RelatingClassification=code)
    for finish, start in (("2025-03-01", None), (None, "2026-03-01")):
        time = f.create_entity("IfcTaskTime", ScheduleStart=start, ActualFinish=finish)
        task = plant.make("IfcTask", Name="Service", IsMilestone=False, TaskTime=time)
        plant.relate("IfcRelAssignsToProcess", RelatedObjects=[pump], RelatingProcess=task)
    plant.properties(pump, "Wartung", Ersatzteile="Seal kit 7")
    card = plant.card(tmp_path, "pump")
    assert [(d.name, d.location, d.identification) for d in card.documents] == [
        ("Manual", "https://example.org/pump.pdf", "M-1")
    ]
    assert card.systems == ("Heating",)
    assert [c[:3] for c in card.classifications] == [("Uniclass 2015", "Pr_65_53_86", "Pumps")]
    assert (card.last_service, card.next_service) == ("2025-03-01", "2026-03-01")
    assert card.spare_parts == ("Seal kit 7",)
    assert card.summary == ("pump; last service 2025-03-01; next service 2026-03-01; system Heating; 1 document")


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4"])
def test_the_way_against_the_flow_ends_at_the_first_valve(schema, tmp_path):
    plant = Plant(schema)
    classes = {"boiler": "Boiler", "far valve": "Valve", "valve": "Valve", "pipe": "PipeSegment", "leak": "PipeSegment"}
    for name, kind in classes.items():
        made = {"Boiler": "IfcEnergyConversionDevice", "Valve": "IfcFlowController", "PipeSegment": "IfcFlowSegment"}
        element = plant.add(made[kind] if schema == "IFC2X3" else f"Ifc{kind}", name)
        if schema == "IFC2X3" and kind == "Valve":
            plant.type_of(element, ifc_class="IfcValveType", PredefinedType="ISOLATING")
    plant.elements["valve"].Name = plant.elements["far valve"].Name = "A 7"  # known by class, not by name
    plant.flow("boiler", "far valve", "valve", "pipe", "leak")
    card = plant.card(tmp_path, "leak")
    ids = {name: element.GlobalId for name, element in plant.elements.items()}
    assert [n.global_id for n in card.upstream] == [ids["pipe"]]
    assert [n.global_id for n in card.find_upstream("valve")] == [ids["pipe"], ids["valve"]]
    assert card.find_downstream("valve") == ()
    assert card.find_upstream("boiler")[-1].name == "boiler"


def test_circles_and_ports_without_direction_end_the_walk(plant, tmp_path):
    for name in ("a", "b", "c"):
        plant.add("IfcPipeSegment", name)
    plant.add("IfcValve", "v")
    plant.flow("a", "b", "c", "a")
    card = plant.card(tmp_path, "a")
    assert card.find_upstream("valve") == ()
    plant.flow("c", "v", directed=False)
    card = plant.card(tmp_path, "a")
    assert [n.name for n in card.find_upstream("valve")] == ["c", "v"]


def test_an_unknown_global_id_is_one_error(plant, tmp_path):
    plant.add("IfcPump", "pump")
    with pytest.raises(ModelError, match="no element or room of 'plant' has the GlobalId 'nonsense'"):
        plant.read(tmp_path).asset("nonsense")


def test_a_building_written_by_hand_has_cards_too():
    pump = box("pump", 1, 1, 0, 2, 2, 1, name="Pump")
    building = replace(room(elements=[pump]), property_reader=lambda g: {"Mine": {"Hersteller": "Works <&>"}})
    card = building.asset("pump")
    assert (card.maker, card.space, card.storey) == ("Works <&>", "space", "Ground floor")
    assert "Works &lt;&amp;&gt;" in card._repr_html_()
    assert "maker" in repr(card)
    assert not card.is_empty
    assert room().asset("space").is_empty


def test_names_in_many_languages_fill_the_fields():
    names = {
        "COBie.Component.SerialNumber": "serial_number",
        "COBie_Component_SerialNumber": "serial_number",
        "COBieComponentInstallationDate": "installed",
        "COBie.Type.Manufacturer": "maker",
        "Modellnummer": "model",
        "Numéro de série": "serial_number",
        "Nächste Wartung": "next_service",
        "Número de serie": "serial_number",
        "Fabbricante": "maker",
        "Серийный номер": "serial_number",
        "製造番号": "serial_number",
        "Location of Manufacture": None,
        "FireRating": None,
        "Modeling Code": None,
    }
    assert {name: field_of(name) for name in names} == names


def test_no_name_stands_for_two_fields():
    words = [word for listed in FIELDS.values() for word in set(listed.split())]
    assert sorted(words) == sorted(set(words))


@pytest.mark.parametrize(
    "value",
    """n/a|N.A.|None|TBD|default|Sample|-|?|SerialNumber|_SERIALNUMBER_|0|0.0|1900-12-31T23:59:59|DD/MM/YYYY|<varies>
    keine Angabe|Pump: Serial Number|""".replace("\n", "|").split("|"),
)
def test_placeholders_say_nothing(value):
    assert tells_nothing("SerialNumber", value)


def test_zero_and_yes_are_no_serial_numbers():
    assert all(tells_nothing("SerialNumber", value) for value in (0, 0.0, None, True, float("nan")))
    assert not tells_nothing("SerialNumber", 7)


@given(st.text(max_size=20), st.text(max_size=20))
def test_any_text_is_judged_without_an_error(name, value):
    assert tells_nothing(name, value) in (True, False)
    assert field_of(name) in (None, *FIELDS)


def test_the_duplex_is_joined_from_three_files():
    files = [
        real_model(f"duplex/{name}")
        for name in ("Duplex_A_20110907.ifc", "Ifc2s3_Duplex_Electrical.ifc", "2012-03-23-Duplex-Handover.ifc")
    ]
    building = read_ifc(files)
    card = building.asset(TABLE)
    assert (card.serial_number, card.model, card.maker) == ("GH468642", "Hemnes", "sales@ikea.com (IKEA)")
    assert (card.service_life, card.warranty_duration, card.warranty_end) == ("5 years", "1 year", "2011-06-28")
    assert "2012-03-23-Duplex-Handover.ifc" in card.sources["serial_number"]
    assert card.space == "B202 Bedroom 1"
    assert card.classifications[0].code == "23-40 20 14 17 24: Coffee Tables"
    serials = sum(bool(building.asset(e.global_id).serial_number) for e in building.elements)
    assert serials == 232  # all components of the COBie file; not one of 211 placeholders of the architecture
    alone = read_ifc(files[0])
    assert all(alone.asset(e.global_id).is_empty for e in alone.elements)


def test_the_heating_model_leads_from_its_pipes_to_valves():
    building = read_ifc(real_model("mep/b03_heating_with_building_blenderBIM.ifc"))
    pipes = [e for e in building.elements if e.ifc_class == "IfcPipeSegment"]
    ways = {pipe.global_id: building.asset(pipe.global_id).find_upstream("valve") for pipe in pipes}
    assert sum(bool(way) for way in ways.values()) >= 98
    assert {building[way[-1].global_id].ifc_class for way in ways.values() if way} == {"IfcValve"}


def test_the_command_prints_a_card_and_its_json(plant, tmp_path):
    pump = plant.add("IfcPump", "pump")
    plant.properties(pump, "Pset_Component", SerialNumber="A-1")
    plant.file.write(str(tmp_path / "plant.ifc"))
    command = [sys.executable, "-m", "bimnav.cli", "inspect", str(tmp_path / "plant.ifc"), "--asset", pump.GlobalId]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "serial number  A-1  [Pset_Component.SerialNumber of the element, plant.ifc]" in shown
    told = json.loads(subprocess.run([*command, "--json"], capture_output=True, text=True, check=True).stdout)
    assert (told["serial_number"], told["storey"], told["documents"]) == ("A-1", "Cellar", [])
    wrong = subprocess.run([*command[:-1], "nope"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert wrong.stderr.count("\n") == 1
