"""Draw the pictures of README and docs: `make figures`. That of the replay page needs Chromium."""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import bimnav as bn
from bimnav.plot import save_tour

FIGURES = Path(__file__).parent / "figures"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
AT = 165.0  # seconds of the replay that is shown: at work upstairs


def draw_tour() -> None:
    mission = bn.run(bn.sample("apartment"), task="cleaning", cell_size=0.1524)
    (FIGURES / "apartment.png").write_bytes(save_tour(mission.tour))


def draw_replay() -> None:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("playwright is not installed; figures/replay.png stays as it is")  # noqa: T201
        return
    robot = bn.Robot(name="Scrub", radius=0.2, height=0.6, battery_wh=50, drive_power=120, work_power=150)
    mission = bn.run(bn.sample("office"), task="cleaning", robot=robot, cell_size=0.1, connectivity=8)
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        page = Path(folder) / "replay.html"
        mission.result.to_html(page)
        chromium = playwright.chromium.launch(executable_path=browser, args=FLAGS)
        tab = chromium.new_page(viewport={"width": 1280, "height": 720})
        tab.goto(page.as_uri())
        tab.wait_for_function("() => window.bimnav !== undefined", timeout=60_000)
        tab.locator("#explode").evaluate("e => { e.value = 1.5; e.dispatchEvent(new Event('input')); }")
        tab.evaluate(f"window.bimnav.seek({AT})")
        tab.wait_for_timeout(1500)
        tab.screenshot(path=FIGURES / "replay.png")
        chromium.close()


if __name__ == "__main__":
    FIGURES.mkdir(exist_ok=True)
    draw_tour()
    draw_replay()
