"""The page in a browser: it loads without complaint, draws, moves, steers, and stays on its own origin."""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.service import toy
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.processes import ServerProcess
from wingfit.sim.effects.registry import EFFECTS

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("page") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.02")) as process:
        yield process


@pytest.fixture
def seen(browser: Browser, server: ServerProcess) -> Iterator[Seen]:
    base = f"http://127.0.0.1:{server.port}"
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    context.grant_permissions(["clipboard-read", "clipboard-write"], origin=base)
    yield Seen.watched(context.new_page(), base)
    context.close()


@pytest.fixture
def dataset(server: ServerProcess) -> dict[str, Any]:
    return server.api.upload(name="toy wing")


def _finished(server: ServerProcess, dataset_id: str) -> str:
    run_id = str(server.api.submit(dataset_id, name="finished")["id"])
    assert server.api.finish(run_id)["state"] == "SUCCEEDED"
    return run_id


def test_an_empty_page_says_what_to_do(seen: Seen) -> None:
    seen.open()
    seen.wait("document.querySelector('#health').textContent.includes('version')")
    seen.wait("document.querySelector('#empty-title')?.textContent === 'Start in three steps'")
    assert seen.page.locator("#home-steps li").count() == 3
    assert seen.page.is_hidden("#home-lists")
    assert seen.page.is_hidden("aside"), "nothing is active"
    assert seen.errors == []
    assert seen.foreign == []


def test_a_finished_run_is_shown_in_full(seen: Seen, server: ServerProcess, dataset: dict[str, Any]) -> None:
    run_id = _finished(server, dataset["id"])
    seen.open(run_id)
    for figure, traces in (("history", 1), ("wing", 2), ("beat", 1)):
        seen.wait(DRAWN.format(figure, traces))
    history = server.api.history(run_id)
    stages = [item["stage"] for item in history]
    gap = stages.index("aerodynamic")  # no line may join stages, which sum over different recordings
    sequences, best = seen.data("history", 1, "x"), seen.data("history", 1, "y")
    assert (sequences.pop(gap), best.pop(gap)) == (None, None)
    assert sequences == [item["sequence"] for item in history]
    assert best == pytest.approx([item["best"] for item in history])
    assert seen.data("history", 0, "y")[0] is None  # every individual of the toy's first generation fails
    annotations = seen.page.evaluate("document.getElementById('history').layout.annotations.map((a) => a.text)")
    assert {"structural stage", "aerodynamic stage"} <= set(annotations)
    seen.wait("document.querySelectorAll('#misfit tbody tr').length === 5")
    assert seen.page.locator("#misfit .badge.held").count() == 1
    assert seen.page.locator("#genes tbody tr").count() == len(toy.TARGET)
    assert "yes" in seen.page.inner_text("#genes tbody tr:first-child")
    described = [gene["description"] for gene in server.api.get(f"/v1/runs/{run_id}/genome")["genes"]]
    assert [row[-1] for row in seen.rows("genes")] == described, "also for those who cannot point at a name"
    assert seen.page.inner_text("#gene-correlations summary") == (
        "Correlations: 1 pair beyond 0.9: stiffness and damping"
    )
    seen.page.click("#gene-correlations summary")
    cells = seen.page.locator("#gene-correlations td").all_inner_texts()
    assert cells == ["", "1.0000", "-0.9500", "-0.9500", "–"]
    assert "solved to 0.1 mm" in seen.page.inner_text("#run-about")
    assert "144 steps per beat, estimated error 0.02 mm" in seen.page.inner_text("#wing-note")
    assert seen.errors == []
    assert seen.foreign == []


def test_loads_are_drawn_when_somebody_looks_and_follow_the_choice(
    seen: Seen, server: ServerProcess, dataset: dict[str, Any]
) -> None:
    asked: list[str] = []
    seen.page.on("request", lambda request: asked.append(request.url) if "/loads?" in request.url else None)
    seen.open(_finished(server, dataset["id"]))
    seen.wait(DRAWN.format("wing", 2))
    assert asked == [], "a simulation is paid for only when somebody looks"
    seen.page.locator("#loads-section").scroll_into_view_if_needed()
    for figure, traces in (("torque", 2), ("power", 4), ("air", 2), ("strips", 2), ("bending", 2), ("energy", 3)):
        seen.wait(DRAWN.format(f"load-{figure}", traces - 1))
    assert len(asked) == 1
    best = seen.data("load-torque", 0, "y")
    assert best[0] == pytest.approx(0, abs=1e-6)
    assert "mean lift" in seen.page.inner_text("#loads-numbers")
    seen.page.check("input[name=genome][value=nominal]", force=True)
    seen.page.locator("#loads-section").scroll_into_view_if_needed()
    seen.wait("document.getElementById('loads-note').textContent.includes('nominal')")
    seen.wait(f"document.getElementById('load-torque').data[0].y[4] !== {json.dumps(best[4])}")
    assert seen.data("load-torque", 0, "y")[4] == pytest.approx(-toy.NOMINAL["stiffness"])
    assert seen.errors == []
    assert seen.foreign == []


def test_the_slider_moves_the_markers_and_the_toggle_the_simulation(
    seen: Seen, server: ServerProcess, dataset: dict[str, Any]
) -> None:
    seen.open(_finished(server, dataset["id"]))
    seen.wait(DRAWN.format("wing", 2))
    recorded, best = seen.data("wing", 1, "z"), seen.data("wing", 2, "z")
    seen.page.focus("#phase")
    seen.page.keyboard.press("End")
    seen.wait("document.getElementById('phase-value').textContent === '0.75'")
    seen.wait(f"document.getElementById('wing').data[1].z[0] !== {json.dumps(recorded[0])}")
    moved = seen.data("wing", 2, "z")
    assert moved != best
    seen.page.check("input[name=genome][value=nominal]", force=True)
    seen.wait("document.getElementById('wing-note').textContent.includes('nominal')")
    seen.wait(f"document.getElementById('wing').data[2].z[0] !== {json.dumps(moved[0])}")
    seen.page.select_option("#recording", "unseen")
    seen.wait("document.getElementById('wing-note').textContent.includes('unseen')")
    seen.page.click("#play")
    seen.wait("document.getElementById('phase').value !== '3'")
    seen.page.click("#play")
    assert seen.errors == []


def test_a_live_run_grows_pauses_and_is_cancelled(seen: Seen, server: ServerProcess, dataset: dict[str, Any]) -> None:
    run_id = server.api.submit(dataset["id"], max_generations=2000, name="live")["id"]
    seen.open(run_id)
    seen.wait(DRAWN.format("history", 1))
    count = len(seen.data("history", 1, "x"))
    seen.wait(f"document.getElementById('history').data[1].x.length > {count + 5}")
    seen.page.click("[data-action=pause]")
    seen.wait("document.querySelector('#run-name .badge').textContent === 'paused'")
    seen.page.click("[data-action=resume]")
    seen.wait("document.querySelector('#run-name .badge').textContent === 'running'")
    seen.wait(f"document.querySelector('#active-jobs .card[aria-current]')?.hash === '#run={run_id}'")
    seen.page.click("[data-action=cancel]")
    seen.page.click("#confirm-no")
    assert server.api.run(run_id)["state"] == "RUNNING"
    seen.page.click("[data-action=cancel]")
    seen.page.click("#confirm-yes")
    seen.wait("document.querySelector('#run-name .badge').textContent === 'cancelled'")
    seen.wait("getComputedStyle(document.querySelector('aside')).display === 'none'")
    assert server.api.run(run_id)["state"] == "CANCELLED"
    assert seen.errors == []


def test_the_form_shows_what_the_server_says_and_then_starts(
    seen: Seen, server: ServerProcess, dataset: dict[str, Any]
) -> None:
    seen.open()
    seen.page.click(f"[data-key='run-{dataset['id']}']")
    seen.page.fill("[name=seed]", "-3")
    seen.page.click("#submit-form [type=submit]")
    seen.wait("document.getElementById('submit-errors').textContent.includes('seed')")
    seen.wait("document.querySelector('[name=seed]').getAttribute('aria-invalid') === 'true'")
    seen.page.fill("[name=seed]", "4")
    seen.page.fill("[name=accuracy_mm]", "0.01")
    seen.page.click("#submit-form [type=submit]")
    seen.wait("document.getElementById('submit-errors').textContent.includes('at least 0.02 mm')")
    seen.wait("document.querySelector('[name=accuracy_mm]').getAttribute('aria-invalid') === 'true'")
    seen.page.fill("[name=accuracy_mm]", "0.05")
    seen.page.click("#effects-summary")
    offered = seen.page.evaluate("[...document.querySelectorAll('#effect-choices input')].map((i) => i.value)")
    assert sorted(offered) == sorted(name for name, effect in EFFECTS.items() if effect.applies_to(toy._wing()))
    seen.page.check("#effect-choices input[value=camera_shift]")
    assert seen.page.inner_text("#effects-summary") == "Effects: camera shift"
    seen.page.click("#submit-form [type=submit]")
    seen.wait("location.hash.startsWith('#run=')")
    run_id = seen.page.evaluate("location.hash").removeprefix("#run=")
    spec = server.api.run(run_id)["spec"]
    assert (spec["seed"], spec["accuracy_mm"], spec["effects"]) == (4, 0.05, ["camera_shift"])
    assert spec["mode"] == "staged", "the default of a wing with rods, which the form leaves to the server"
    seen.wait("document.getElementById('run-about').textContent.includes('with camera shift')")
    seen.page.wait_for_selector("#copy-curl")
    seen.page.click("#copy-curl")
    seen.wait("document.getElementById('toast').textContent === 'Copied'")
    words = shlex.split(seen.page.evaluate("navigator.clipboard.readText()"))
    assert words[:4] == ["curl", "-X", "POST", f"{seen.base}/v1/runs"]
    again = server.client.post("/v1/runs", json=json.loads(words[-1]))
    assert again.json()["spec"] == server.api.run(run_id)["spec"]
    for run in (run_id, again.json()["id"]):
        server.client.post(f"/v1/runs/{run}/cancel")


def test_upload_accepts_and_refuses(seen: Seen, tmp_path: Path) -> None:
    good, bad = tmp_path / "good.zip", tmp_path / "bad.zip"
    good.write_bytes(toy.archive(name="from the page"))
    bad.write_bytes(b"not an archive")
    seen.open()
    seen.page.set_input_files("#file", bad)
    seen.wait("document.getElementById('upload-state').textContent.includes('not a toy archive')")
    seen.page.set_input_files("#file", good)
    seen.wait("document.getElementById('newest-datasets').textContent.includes('from the page')")


def test_names_are_text_never_markup(seen: Seen, server: ServerProcess) -> None:
    dataset = server.api.upload(name="<img src=x onerror=alert(1)>")
    run_id = server.api.submit(dataset["id"], name="<b id=planted>bold</b>")["id"]
    server.api.finish(run_id)
    seen.open(run_id)
    seen.wait("document.querySelector('#run-name').textContent.includes('<b id=planted>')")
    assert seen.page.locator("#planted").count() == 0
    assert seen.page.locator("#newest-datasets img").count() == 0
    assert seen.errors == []


def test_an_unknown_run_is_told(seen: Seen) -> None:
    seen.open("run_none")
    seen.wait("document.getElementById('toast').textContent.includes('run_none')")
    assert seen.page.is_visible("#empty")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_needs_no_sideways_scrolling(
    browser: Browser, server: ServerProcess, dataset: dict[str, Any], scheme: Any
) -> None:
    context = browser.new_context(viewport={"width": 360, "height": 740}, color_scheme=scheme)
    seen = Seen.watched(context.new_page(), f"http://127.0.0.1:{server.port}")
    seen.open(_finished(server, dataset["id"]))
    seen.wait(DRAWN.format("wing", 2))
    seen.wait("!document.getElementById('genes-section').hidden")
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 360
    ground = seen.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(int(c) for c in ground[4:-1].split(",")) < 200) == (scheme == "dark")
    context.close()


def test_the_page_outlives_the_server(browser: Browser, tmp_path: Path) -> None:
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.05")) as server:
        context = browser.new_context()
        seen = Seen.watched(context.new_page(), f"http://127.0.0.1:{server.port}")
        run_id = server.api.submit(server.api.upload()["id"], max_generations=40)["id"]
        seen.open(run_id)
        seen.wait(DRAWN.format("history", 1))
        server.kill()
        seen.wait("!document.getElementById('away').hidden")
        server.__enter__()
        seen.wait("document.getElementById('away').hidden", 20)
        seen.wait("document.querySelector('#run-name .badge').textContent === 'done'", 30)
        assert [x for x in seen.data("history", 1, "x") if x is not None] == list(range(1, 81))
        context.close()


def test_every_file_of_the_page_is_small_and_has_no_inline_code() -> None:
    web = Path(__file__).parents[3] / "service" / "web"
    html = (web / "index.html").read_text(encoding="utf-8")
    assert "<style" not in html
    assert "style=" not in html
    assert not re.search(r"<[^>]*\son\w+\s*=", html), "no handler of events in the page"
    assert html.count("<script") == 1
    for path in web.rglob("*.*"):
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) < 400, path.name
        addresses = [word for word in text.split() if "http" in word and os.sep * 2 in word]
        assert all("www.w3.org/2000/svg" in word for word in addresses), (path.name, addresses)
