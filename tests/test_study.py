"""Studies: a grid of scenarios, each with one row, whoever plays them."""

from __future__ import annotations

import json
import math
import pickle

import pytest
from matplotlib.collections import PathCollection

from bimnav._study import Study, _jobs, study
from bimnav.environment import make_environment
from bimnav.errors import InputError, ValueRangeError
from bimnav.plot import plot_study
from bimnav.robot import Robot
from bimnav.sim import Chance
from bimnav.tasks import Task
from bimnav.testing import two_rooms

SPILLS = [(1.0, 3.0), (3.0, 1.0), (7.0, 3.0)]


def environment():
    building = two_rooms().with_targets([("spill", *SPILLS[0]), ("leak", *SPILLS[1]), ("peel", *SPILLS[2])])
    return make_environment(building, Task("test", service_time=10.0), Robot("R", radius=0.2, speed=0.5))


GRID = {"starts": [(1, 1), (7, 1)], "cell_sizes": [0.2, 0.1]}


def test_every_combination_has_a_row_with_its_settings():
    found = study(environment(), **GRID, speeds=[0.5, 1.0], seeds=[0, 1])
    assert len(found) == 2 * 2 * 2 * 2
    assert list(found.rows[0]) == list(Study.columns)
    first = found.rows[0]
    assert (first["start"], first["cell_size"], first["speed"], first["seed"]) == ("1 1", 0.2, 0.5, 0)
    assert first["makespan"] == pytest.approx(first["distance"] / 0.5 + 30.0)
    assert {row["served"] for row in found.rows} == {3}
    assert json.loads(json.dumps(list(found.rows))) == list(found.rows)


def test_a_closed_door_leaves_what_is_behind_it():
    found = study(environment(), starts=[(1, 1)], cell_sizes=[0.2], closed_doors=[(), ("door",)])
    assert [row["unreached"] for row in found.rows] == [0, 1]
    assert [row["closed_doors"] for row in found.rows] == ["", "door"]
    assert [row["coverage"] for row in found.rows] == [1.0, pytest.approx(2 / 3)]


def test_several_robots_share_the_work():
    found = study(environment(), starts=[(1, 1)], cell_sizes=[0.2], robots=[1, 2])
    one, two = found.rows
    assert two["makespan"] < one["makespan"]
    assert one["served"] == two["served"] == 3
    assert one["encounters"] == 0


def test_a_start_that_is_blocked_has_a_row_that_says_so():
    found = study(environment(), starts=[(-0.1, 1), (1, 1)], cell_sizes=[0.2])
    assert "lies outside the map" in found.rows[0]["error"]
    assert found.rows[0]["length"] is None
    assert found.rows[1]["error"] == ""
    assert repr(found) == "Study(2 scenarios, 1 not played)"
    assert found.to_csv().splitlines()[0] == ",".join(Study.columns)


def test_workers_get_the_graph_and_not_the_building():
    env = environment()
    rows = [{"start": "1 1", "cell_size": 0.2, "robots": 1, "speed": 0.5, "closed_doors": "", "seed": 0}]
    (job,) = _jobs(env, rows, {"1 1": (1, 1)}, {"": ()}, 4, {})
    assert job.graph.environment is None
    assert b"bimnav.building" not in pickle.dumps(job)


@pytest.mark.parametrize("backend", ["threads", "processes"])
def test_every_backend_gives_the_same_rows(backend):
    more = {"options": {"service_time": Chance("uniform", (5, 20), "s")}, "seeds": [0, 1]}
    alone = study(environment(), **GRID, **more)
    assert study(environment(), **GRID, **more, backend=backend, workers=2).rows == alone.rows


def test_a_cluster_gives_the_same_rows():
    distributed = pytest.importorskip("distributed", reason="dask is not installed: pip install 'bimnav[cluster]'")
    alone = study(environment(), **GRID)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster),
    ):
        assert study(environment(), **GRID, backend="dask").rows == alone.rows


def test_a_study_that_was_cut_short_goes_on(tmp_path, monkeypatch):
    file = tmp_path / "rows.jsonl"
    half = study(environment(), starts=GRID["starts"][:1], cell_sizes=GRID["cell_sizes"], file=file)
    played = []
    import bimnav._study as module

    original = module._played
    monkeypatch.setattr(module, "_played", lambda job, row: played.append(row) or original(job, row))
    whole = study(environment(), **GRID, file=file)
    assert len(played) == 2
    assert [row for row in whole.rows if row["start"] == "1 1"] == list(half.rows)
    assert len(file.read_text().splitlines()) == 4
    assert study(environment(), **GRID, file=file).rows == whole.rows
    assert len(played) == 2


def test_a_file_that_holds_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("milk, bread\n")
    with pytest.raises(InputError, match="holds no rows of a study"):
        study(environment(), **GRID, file=tmp_path / "notes.txt")


def test_a_summary_has_an_interval_around_the_mean_of_the_seeds():
    chance = {"service_time": Chance("normal", (20, 4), "s")}
    found = study(environment(), starts=[(1, 1)], cell_sizes=[0.2], seeds=range(30), options=chance)
    (group,) = found.summary("makespan", by=["start"])
    expected = found.rows[0]["distance"] / 0.5 + 60
    assert group["n"] == 30
    assert group["low"] < expected < group["high"]
    assert group["high"] - group["low"] == pytest.approx(2 * 2.045 * 4 * math.sqrt(3) / math.sqrt(30), rel=0.4)
    (single,) = Study(found.rows[:1]).summary("makespan")
    assert (single["low"], single["high"]) == (None, None)
    with pytest.raises(ValueRangeError, match="no summary of 'joy'"):
        found.summary("joy")


@pytest.mark.parametrize("bad", [{"starts": []}, {"cell_sizes": []}, {"seeds": []}])
def test_a_grid_with_nothing_in_it_is_refused(bad):
    with pytest.raises(InputError, match="to try"):
        study(environment(), **(GRID | bad))


def test_a_backend_that_is_none_is_refused():
    with pytest.raises(ValueRangeError, match="'carrier pigeon'"):
        study(environment(), **GRID, backend="carrier pigeon")


def test_the_figure_of_a_study_has_a_dot_for_every_scenario_and_a_color_for_every_group():
    from matplotlib.figure import Figure

    found = study(environment(), **GRID, speeds=[0.5, 1.0])
    ax = plot_study(found, "makespan", "speed", "start", ax=Figure().subplots())
    assert sum(len(dots.get_offsets()) for dots in ax.collections if isinstance(dots, PathCollection)) == len(found)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["1 1", "7 1"]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0.5", "1"]
    assert ax.get_xlabel() == "speed (m/s)"
    with pytest.raises(ValueRangeError, match="no summary"):
        plot_study(found, "colour", ax=ax)
