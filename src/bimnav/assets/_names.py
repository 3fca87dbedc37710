"""How exporters and people call what is known about an asset, and how they write that nothing is known."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

from bimnav._placeholders import is_placeholder
from bimnav.tasks._words import folded

__all__ = ["FIELDS", "field_of", "rank_of", "squeezed", "tells_nothing"]

FIELDS: dict[str, str] = {
    "maker": """manufacturer manufacturername manufacturedby maker make brand hersteller herstellername fabrikat
        fabrikant fabricante fabricant fabbricante produttore costruttore tillverkare produsent valmistaja producent
        vyrobce gyarto uretici marke merk marca marque производитель изготовитель メーカー 製造者 製造元 制造商 厂家""",
    "model": """modelnumber modelno modelnr modellabel modelname model modelreference modelldesignation modellnummer
        modellnr modell modellbezeichnung typenbezeichnung typennummer typenschild modelnaam modele numerodemodele
        modello numeromodello modelo numerodemodelo модель 型番 型号""",
    "article": """articlenumber articleno articlenr partnumber ordernumber sku gtin artikelnummer artikelnr
        bestellnummer bestelnummer numerodarticle referencefabricant codicearticolo numerodearticulo артикул 品番""",
    "serial_number": """serialnumber serialno serialnr serial seriennummer seriennr serienummer serienr fabriknummer
        fabriknr fabrikationsnummer numerodeserie numeroserie numerodiserie matricola sarjanumero serienummer
        серийныйномер заводскойномер シリアル番号 製造番号 序列号""",
    "barcode": "barcode barcodenumber qrcode strichcode streepjescode codebarre codicebarre codigodebarras",
    "asset_id": """assetidentifier assetid assetnumber assettag inventorynumber equipmentnumber equipmenttag
        anlagennummer anlagenkennzeichen inventarnummer aks inventarisnummer numeroinventaire numeroinventario
        инвентарныйномер tagnumber tag""",
    "installed": """installationdate dateofinstallation installdate dateinstalled installedon commissioningdate
        incorporationdate einbaudatum installationsdatum montagedatum inbetriebnahme inbetriebnahmedatum
        installatiedatum plaatsingsdatum datedinstallation datedepose datadiinstallazione datainstallazione
        fechadeinstalacion datadeinstalacao датаустановки датамонтажа 設置日 安装日期""",
    "made": """manufacturedate manufacturingdate dateofmanufacture productiondate productionyear yearofmanufacture
        acquisitiondate herstellungsjahr herstellungsdatum baujahr produktionsdatum bouwjaar productiejaar
        anneedefabrication annodifabbricazione annodicostruzione anodefabricacion годвыпуска 製造日 生产日期""",
    "warranty_start": """warrantystartdate warrantystart warrantybegin startofwarranty garantiebeginn garantiestart
        gewahrleistungsbeginn beginngewahrleistung startgarantie startdatumgarantie debutdegarantie debutgarantie
        iniziogaranzia iniciodegarantia iniciogarantia началогарантии 保証開始日 保修开始日期""",
    "warranty_end": """warrantyenddate warrantyend warrantyexpirationdate warrantyexpirydate warrantyexpiration
        warrantyexpires warrantyuntil endofwarranty garantieende garantiebis garantieablauf gewahrleistungsende
        gewahrleistungbis eindegarantie einddatumgarantie findegarantie finegaranzia scadenzagaranzia findegarantia
        конецгарантии 保証終了日 保修截止日期""",
    "warranty_duration": """warrantydurationparts warrantyduration warrantyperiod warrantydurationlabor
        warrantydurationlabour garantiedauer garantiezeit gewahrleistungsdauer gewahrleistungsfrist garantieduur
        garantietermijn garantieperiode dureedegarantie dureegarantie duratadellagaranzia duratagaranzia
        duraciondelagarantia duraciongarantia гарантийныйсрок 保証期間 保修期""",
    "warranty_guarantor": """warrantyguarantorparts warrantyguarantor guarantor warrantyguarantorlabor
        warrantyguarantorlabour pointofcontact garantiegeber gewahrleistungsgeber garantieverstrekker garant garante""",
    "warranty_terms": """warrantydescription warrantyinformation warrantyinfo warrantycontent warrantyterms warrantyname
        warranty garantie garantiebedingungen gewahrleistung garantievoorwaarden garanzia garantia
        гарантия 保証 保修""",
    "service_life": """servicelifeduration servicelife expectedservicelife expectedlife expectedlifetime lifeexpectancy
        designlife lifespan lifespanrequirements usefullife lebensdauer nutzungsdauer technischenutzungsdauer
        levensduur technischelevensduur dureedevie vitautile durataditvita vidautil срокслужбы 耐用年数 使用寿命""",
    "last_service": """lastservicedate lastservice lastmaintenancedate lastmaintenance lastinspectiondate
        lastinspection dateoflastservice letztewartung letzterservice letzteprufung letzteinspektion laatsteonderhoud
        laatsteinspectie dernierentretien dernieremaintenance ultimamanutenzione ultimomantenimiento ultimarevision
        последнееобслуживание датапоследнегото 前回点検日 上次维护""",
    "next_service": """nextservicedate nextservice nextmaintenancedate nextmaintenance nextinspectiondate
        nextinspection servicedue servicedate maintenancedue nachstewartung naechstewartung nachsterservice
        nachsteprufung nachsteinspektion volgendonderhoud volgendeinspectie prochainentretien prochainemaintenance
        prossimamanutenzione proximomantenimiento proximarevision следующееобслуживание 次回点検日 下次维护""",
    "service_interval": """serviceinterval maintenanceinterval maintenancefrequency inspectioninterval
        maintenancecycle wartungsintervall prufintervall inspektionsintervall onderhoudsinterval
        periodicitedentretien intervallodimanutenzione intervalodemantenimiento""",
    "replacement_cost": """replacementcost wiederbeschaffungswert ersatzkosten vervangingskosten vervangingswaarde
        coutderemplacement costodisostituzione costedereposicion""",
    "spare_parts": """spareparts sparepart spares sparepartsset ersatzteile ersatzteil reserveonderdelen
        piecesderechange piecesdetachees ricambi pezzidiricambio repuestos piezasderepuesto запчасти запасныечасти""",
    "document": """url producturl websiteurl website link hyperlink datasheet technicaldatasheet manual operationmanual
        documentation documentreference datenblatt handbuch betriebsanleitung bedienungsanleitung handleiding
        fichetechnique manuel schedatecnica manuale fichatecnica""",
    "system": "systemname systemtype mepsystem systemclassification anlage gewerk systeem systeme sistema",
}
"""What an asset card tells, and under which names files write it: folded, without spaces, in this order."""

_WORDS = {field: tuple(dict.fromkeys(folded(word) for word in words.split())) for field, words in FIELDS.items()}
_FIELD = {word: (field, rank) for field, words in _WORDS.items() for rank, word in enumerate(words)}
_COBIE = re.compile(r"^cobie(?:component|type|space|system|spare|facility)?")
_SAID_OF_NOTHING = """
    sample example test multiple generic empty blank x kein keine keiner standard variiert verschieden geen aucun
    ninguno nessuno нет なし 无 00000000 19700101 19700101t000000 http https www
"""  # where an asset is described; elsewhere they may say something
_NOTHING = frozenset(folded(word) for word in _SAID_OF_NOTHING.split())
_NO_MAKER = frozenset(
    ["revit", "autodesk", "autodeskrevit", "archicad", "graphisoft", "allplan", "sketchup", "generisch"]
)
_TEMPLATE = re.compile(r"[_<\[{*].*[_>\]}*]", re.DOTALL)
_SAMPLES = ("sample", "example", "default", "enter", "your", "insert", "muster", "beispiel", "my")


@lru_cache(maxsize=1 << 14)
def squeezed(text: str) -> str:
    """Return letters and digits only, folded."""
    return "".join(char for char in folded(text) if char.isalnum())


@lru_cache(maxsize=1 << 14)
def _known(name: str) -> tuple[str, int] | None:
    return _FIELD.get(_COBIE.sub("", squeezed(name)))


def field_of(name: str) -> str | None:
    """Return the field that a property of this name fills, or None.

    >>> field_of("COBie.Component.SerialNumber"), field_of("Nächste Wartung"), field_of("FireRating")
    ('serial_number', 'next_service', None)
    """
    known = _known(name)
    return known and known[0]


def rank_of(name: str) -> int:
    """Return how good a name is for its field; 0 is best."""
    known = _known(name)
    return known[1] if known else len(_FIELD)


def tells_nothing(name: str, value: Any) -> bool:
    """Tell whether a value says nothing about an asset: a placeholder, a template, a zero, a mere yes.

    >>> tells_nothing("SerialNumber", "SerialNumber"), tells_nothing("SerialNumber", "GH468642")
    (True, False)
    """
    if value is None or isinstance(value, bool):
        return True
    if isinstance(value, (int, float)):
        return not value or value != value
    bare, own = squeezed(value), _COBIE.sub("", squeezed(name))
    if not bare.strip("0") or bare in _NOTHING or bare in (own, squeezed(name)) or is_placeholder(name, value):
        return True
    if _TEMPLATE.fullmatch(value.strip()) or any(bare == f"{word}{own}" for word in _SAMPLES):
        return True
    if ":" in value and bare.endswith(own) and squeezed(value.rsplit(":", 1)[1]) == own:
        return True  # `Window: Manufacturer`
    return field_of(name) == "maker" and bare in _NO_MAKER
