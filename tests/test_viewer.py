"""The replay page: what it holds, and what a browser shows of it."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
import subprocess

import numpy as np
import pytest

import bimnav as bn
from bimnav import Cell, NavGraph, Stop
from bimnav.errors import InputError
from bimnav.viewer import replay_page
from tests.conftest import REPOSITORY, real_model

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
HOSTILE = "</script><img src=x onerror=document.title='owned'>{script}"


def played(model, targets=(), *, radius=0.0, cell_size=0.1524, **options):
    building = bn.read_ifc(model).with_targets(targets)
    robot = bn.Robot(radius=radius, battery_wh=50, drive_power=400, work_power=100)
    environment = bn.make_environment(building, bn.load_task("cleaning"), robot)
    graph = bn.build_graph(environment, cell_size=cell_size)
    start = bn.find_start(graph)
    tour = bn.plan_tour(graph, start.cell, start_point=start.point)
    return bn.simulate(tour, service_time=10.0, **options)


@pytest.fixture(scope="module")
def cleaned():
    return played(bn.sample("apartment"))


def test_the_page_asks_nothing_of_a_network_and_runs_no_script_but_its_own(cleaned):
    page = replay_page(cleaned)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    assert "unsafe" not in policy
    script = re.search(r"<script>(.*?)</script>", page, re.DOTALL)[1]
    digest = hashlib.sha256(script.encode()).digest()
    import base64

    assert f"'sha256-{base64.b64encode(digest).decode()}'" in policy
    assert "<link" not in page
    assert not re.search(r'\b(src|href)="', page)


def test_equal_results_give_equal_pages(cleaned):
    assert replay_page(cleaned) == replay_page(played(bn.sample("apartment")))
    assert cleaned.to_html() == replay_page(cleaned)


def test_a_page_is_written_whole(cleaned, tmp_path):
    path = tmp_path / "replay.html"
    assert cleaned.to_html(path) == path.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [path]


def test_names_cannot_end_the_title_or_fill_in_the_page(cleaned):
    page = replay_page(cleaned, title=HOSTILE)
    assert page.count("</script>") == 2
    assert "<img" not in page


def test_a_simulation_without_history_has_no_replay():
    result = played(bn.sample("apartment"), history=False)
    with pytest.raises(InputError, match="history"):
        replay_page(result)


def test_the_script_is_what_its_sources_make():
    """As `build.mjs` records it; where node is at hand, it is built again."""
    viewer, built = REPOSITORY / "viewer", REPOSITORY / "src" / "bimnav" / "viewer"
    names = [f"src/{path.name}" for path in (viewer / "src").iterdir()] + [
        "build.mjs",
        "package-lock.json",
        "package.json",
    ]
    lines = [f"{name} {hashlib.sha256((viewer / name).read_bytes()).hexdigest()}\n" for name in sorted(names)]
    record = json.loads((built / "bundle.json").read_text())
    hint = "the viewer's sources changed: run `npm ci && npm run build` in viewer/"
    assert record["sources"] == hashlib.sha256("".join(lines).encode()).hexdigest(), hint
    for key, name in (("script", "replay.js"), ("style", "replay.css")):
        assert record[key] == hashlib.sha256((built / name).read_bytes()).hexdigest(), hint


def test_a_rebuild_gives_the_committed_script(tmp_path):
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("node is not at hand")
    shutil.copytree(REPOSITORY / "viewer", tmp_path / "viewer", ignore=shutil.ignore_patterns("node_modules"))
    shutil.copytree(REPOSITORY / "src" / "bimnav" / "viewer", tmp_path / "src" / "bimnav" / "viewer")
    fetched = subprocess.run([npm, "ci", "--no-audit", "--no-fund"], cwd=tmp_path / "viewer", capture_output=True)
    if fetched.returncode:
        pytest.skip("the packages of the viewer cannot be had")
    done = subprocess.run([npm, "run", "check"], cwd=tmp_path / "viewer", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        if os.environ.get("CI", "").lower() in ("1", "true"):
            pytest.fail("no Chromium is installed, and this is CI")
        pytest.skip("no Chromium is installed")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def opened(browser, tmp_path):
    """Open a result in the browser; what the page requests and complains of is checked in the end."""
    pages, requests, errors = [], [], []

    def open_page(result, **options):
        path = tmp_path / f"{len(pages)}.html"
        result.to_html(path, **options)
        page = browser.new_page(viewport={"width": 1200, "height": 800})
        page.on("request", lambda request: requests.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        page.goto(path.as_uri())
        page.wait_for_function("() => window.bimnav !== undefined", timeout=60_000)
        pages.append(page)
        return page

    yield open_page
    assert all(url.startswith(("file:", "blob:", "data:")) for url in requests)
    assert errors == []
    for page in pages:
        page.close()


def assert_robots_are_where_the_log_says(page, result):
    lost = {target for tour in result.tours for target in (u.global_id for u in tour.unreached)}
    for event in result.log:
        if event.robot and event.event in ("start", "arrive", "end_service", "finish"):
            page.evaluate(f"window.bimnav.seek({event.time})")
            shown = page.evaluate("window.bimnav.state()")
            robot = next(robot for robot in shown["robots"] if robot["name"] == event.robot)
            assert math.dist((robot["x"], robot["y"], robot["z"]), (event.x, event.y, event.z)) < 2e-3
            assert robot["level"] == event.storey
    page.evaluate("window.bimnav.seek(1e12)")
    shown = page.evaluate("window.bimnav.state()")
    assert {g for g, state in shown["targets"].items() if state == "served"} == set(result.served)
    assert {g for g, state in shown["targets"].items() if state == "unreached"} >= lost


def test_a_browser_shows_the_robot_where_the_log_says(opened, cleaned):
    page = opened(cleaned)
    assert_robots_are_where_the_log_says(page, cleaned)
    page.evaluate("window.bimnav.seek(0)")
    assert set(page.evaluate("window.bimnav.state().targets").values()) == {"waiting"}


def test_the_clock_runs_when_it_is_told_to(opened, cleaned):
    page = opened(cleaned)
    page.keyboard.press("Space")
    page.wait_for_function("() => window.bimnav.state().time > 1", timeout=30_000)
    page.keyboard.press("Space")
    assert page.evaluate("window.bimnav.state().playing") is False


def test_a_click_on_an_element_shows_what_it_is(opened, cleaned):
    page = opened(cleaned)
    environment = cleaned.tours[0].graph.environment
    table = next(e for e in environment.building.elements if "Round Table" in e.name)
    x, y = table.bounds[:, :2].mean(axis=0).tolist()
    page.keyboard.press("p")  # from above nothing hides it
    page.wait_for_timeout(300)
    px, py, _ = page.evaluate(f"window.bimnav.project({x}, {y}, {table.bounds[1, 2]})")
    box = page.locator("#canvas").bounding_box()
    page.mouse.click(box["x"] + px, box["y"] + py)
    state = page.evaluate("window.bimnav.state()")
    assert state["selected"]["id"] == table.global_id
    assert table.global_id in state["card"]
    assert "obstacle" in state["card"]


def test_a_click_on_a_cell_says_what_blocks_it(opened, cleaned):
    page = opened(cleaned)
    graph = cleaned.tours[0].graph
    obstacle = next(o for o in graph.environment.obstacles if "Sofa" in o.name)
    point = obstacle.footprint.representative_point()
    cell = graph.frame.cell_at(point.x, point.y, storey=obstacle.storey)
    page.evaluate(f"window.bimnav.look({{cell: {list(cell)}}})")
    card = page.evaluate("window.bimnav.state().card")
    assert "obstacle" in card
    assert obstacle.global_id in card


@pytest.mark.parametrize(
    ("name", "targets"),
    [
        ("houses/231110AC11-FZK-Haus-IFC.ifc", [("one", 3.0, 3.0), (HOSTILE, 8.0, 7.0)]),
        ("duplex/Duplex_A_20110907.ifc", [("one", 2.0, -4.0), (HOSTILE, 2.0, -12.0)]),
    ],
)
def test_real_models_open_with_hostile_names_as_text(opened, name, targets):
    result = played(real_model(name), targets, cell_size=0.2)
    page = opened(result)
    assert_robots_are_where_the_log_says(page, result)
    assert "owned" not in page.title()
    assert HOSTILE in page.locator("#targets").evaluate(
        "e => [...e.querySelectorAll('button')].map(b => b.title).join()"
    )
    count = len(page.evaluate("window.bimnav.state().levels"))
    page.evaluate("window.bimnav.only(0)")
    assert [level["visible"] for level in page.evaluate("window.bimnav.state().levels")] == [True] + [False] * (
        count - 1
    )


def test_a_roof_that_no_robot_reaches_does_not_hide_the_rooms(opened):
    duplex = real_model("duplex/Duplex_A_20110907.ifc")
    result = played(duplex, [("one", 2.0, -4.0, "Level 1"), ("skylight", 4.0, -9.0, "Roof")], cell_size=0.2)
    page = opened(result)
    visible = {level["name"]: level["visible"] for level in page.evaluate("window.bimnav.state().levels")}
    assert visible == {"T/FDN": True, "Level 1": True, "Level 2": False, "Roof": False}


def test_a_world_without_a_building_has_a_replay_too(opened):
    graph = NavGraph.from_mask(np.ones((10, 20), dtype=bool), cell_size=0.5)
    cell = Cell(0, 8, 17)
    point = graph.frame.center_of(cell)
    result = bn.simulate(bn.plan_tour(graph, Cell(0, 1, 1), [Stop("id", "there", cell, point, point)]))
    page = opened(result)
    assert_robots_are_where_the_log_says(page, result)


def test_what_is_simplified_in_a_large_building_is_said(cleaned, monkeypatch):
    from bimnav.viewer import _scene

    whole = _scene.scene_of(cleaned, None)
    assert "boxes" not in whole["subtitle"]
    monkeypatch.setattr(_scene, "_MOST_TRIANGLES", 500)
    monkeypatch.setattr(_scene, "_MOST_FACTS", 10)
    scene = _scene.scene_of(cleaned, None)
    assert f"{scene['mesh']['boxed']} elements with the most triangles are drawn as boxes" in scene["subtitle"]
    assert (
        f"{len(scene['elements']) - 10} of {len(scene['elements'])} elements carry no properties" in scene["subtitle"]
    )
    assert scene["elements"][0]["id"] == whole["elements"][0]["id"]
    assert sum(e["count"] for e in scene["elements"]) < sum(e["count"] for e in whole["elements"])
