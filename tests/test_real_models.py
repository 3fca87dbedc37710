"""Jobs at chance places in every real model: whatever is planned, the judge agrees to it."""

from __future__ import annotations

import numpy as np
import pytest

import bimnav as bn
from bimnav.errors import InputError, NothingWalkableError
from tests.conftest import REAL_IFC

MODELS = sorted(str(path.relative_to(REAL_IFC)) for path in REAL_IFC.glob("*/*.ifc*"))
WITHOUT_FLOOR = {
    "duplex/2012-03-23-Duplex-Handover.ifc",
    "fm/Ifc4WithNestedLists.ifczip",
    "library/IFC4 Furniture Library.ifc",
    "nasty/large_offset.ifc",  # one wall and survey markers
}


@pytest.mark.skipif(not MODELS, reason="real models are not at hand: set BIMNAV_REAL_IFC")
@pytest.mark.parametrize("name", MODELS)
def test_chance_jobs_are_served_and_safe(name, full):
    if name == "nasty/errorfile.ifc":
        with pytest.raises(InputError, match=r"errorfile\.ifc"):
            bn.read_ifc(REAL_IFC / name)
        return
    building = bn.read_ifc(REAL_IFC / name)
    if name in WITHOUT_FLOOR:
        with pytest.raises(NothingWalkableError):
            bn.run(building, targets=[("spill", 0, 0)], robot=bn.Robot(radius=0.2))
        return
    rng = np.random.default_rng(len(name))
    for radius, cell_size, connectivity in [(0.2, 0.1, 8), (0.0, 0.15, 4), (0.3, 0.07, 8)][: 3 if full else 1]:
        robot = bn.Robot(radius=radius)
        graph = bn.build_graph(
            bn.make_environment(building, bn.Task("look"), robot), cell_size=cell_size, connectivity=connectivity
        )
        start = bn.find_start(graph)
        cells = np.argwhere(np.isfinite(bn.distance_field(graph, start.cell)))
        chosen = cells[rng.choice(len(cells), size=min(6, len(cells)), replace=False)].tolist()
        centers = [graph.frame.center_of(bn.Cell(*cell)) for cell in chosen]
        targets = [bn.Detection(f"t{k}", x, y, z=z) for k, (x, y, z) in enumerate(centers)]
        mission = bn.run(
            building, targets=targets, cell_size=cell_size, connectivity=connectivity, robot=robot, lost="ignore"
        )
        assert len(mission.tour.stops) == len(targets)
        assert mission.check.ok
        assert mission.check.clearance > -1e-9
