"""A notebook in a kernel of its own: pictures are shown, progress needs nothing, an interrupted run goes on."""

import base64
import io

import pytest
from alsph.plotting.animation import MOST_SHOWN, Film
from PIL import Image

nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")

CELLS = {
    "case": "import alsph\nfrom alsph.cases import Cylinder, TaylorGreen\ncase = TaylorGreen(resolution=16)\ncase",
    "run": "run = case.run('run', until=0.3, output_interval=0.1)",
    "summary": "run",
    "picture": "run.plot_field('vorticity')",
    "film": "run.animate('vorticity')",
    "interrupted": """
import _thread, threading
threading.Timer(4, _thread.interrupt_main).start()
try:
    Cylinder(resolution=10).run('long', until=50)
except KeyboardInterrupt as stop:
    print(type(stop).__name__, stop)
""",
    "resumed": """
time = alsph.open_run('long').history['time'][-1]
run = alsph.resume('long', until=time + 0.05)
print(run.status)
""",
}


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in CELLS.values()])
    folder = tmp_path_factory.mktemp("notebook")
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return dict(zip(CELLS, (cell.outputs for cell in notebook.cells), strict=True))


def text(outputs):
    return "".join(output.get("text", "") or output.get("data", {}).get("text/plain", "") for output in outputs)


def test_a_case_and_a_run_are_tables(outputs):
    assert "Reynolds number UD/ν" in outputs["case"][0].data["text/html"]
    assert "decay rate of the kinetic energy" in outputs["summary"][0].data["text/html"]


def test_a_figure_is_shown(outputs):
    (output,) = outputs["picture"]
    assert len(output.data["image/png"]) > 10_000


def test_a_film_is_shown(outputs):
    (output,) = [output for output in outputs["film"] if "data" in output]
    start = '<img src="data:image/gif;base64,'
    assert output.data["text/html"].startswith(start)
    film = base64.b64decode(output.data["text/html"].removeprefix(start).partition('"')[0])
    assert film.startswith(b"GIF89a") and Image.open(io.BytesIO(film)).n_frames == 4


def test_the_path_of_a_film_is_a_path(tmp_path):
    film = Film(tmp_path / "film.gif")
    assert film == tmp_path / "film.gif" and film._repr_html_() is None  # not made yet
    film.write_bytes(b"GIF89a")
    assert "data:image/gif" in film._repr_html_()
    assert film.with_suffix(".txt")._repr_html_() is None and film.parent._repr_html_() is None
    with film.open("wb") as file:
        file.truncate(MOST_SHOWN + 1)
    assert film._repr_html_() is None
    video = Film(tmp_path / "film.mp4")
    video.write_bytes(b"video")
    assert video._repr_html_().startswith("<video controls")


def test_progress_is_a_line_that_changes(outputs):
    assert "ipywidgets" not in str(outputs)
    (line,) = [output.data["text/plain"] for output in outputs["run"] if "steps/s" in str(output)]
    assert line.startswith("100.0 %") and "t* 0.3" in line


def test_an_interrupted_run_goes_on(outputs):
    assert "Interrupted stopped at step" in text(outputs["interrupted"])
    assert "alsph resume long" in text(outputs["interrupted"]) and "finished" in text(outputs["resumed"])
