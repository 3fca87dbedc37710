"""Draw the pictures of README and docs: `make figures`."""

from pathlib import Path

import bimnav as bn
from bimnav.plot import save_tour

FIGURES = Path(__file__).parent / "figures"

if __name__ == "__main__":
    FIGURES.mkdir(exist_ok=True)
    mission = bn.run(bn.sample("apartment"), task="cleaning", cell_size=0.1524)
    (FIGURES / "apartment.png").write_bytes(save_tour(mission.tour))
