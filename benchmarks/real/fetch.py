"""Download the recordings from the public repositories that hold them, at fixed commits; only where the user asks."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

RAW = "https://raw.githubusercontent.com"
TIMEOUT = 60.0  # s
COLOURS, PLACES = ("blue", "orange", "green"), ("leading", "middle", "trailing")  # of the sensors of yeo2011

# place in the data folder: repository, commit, path in the repository
FILES = {
    "balls/balls.txt": ("briandesilva/discovery-of-physics-from-data", "b79c343", "Data/balls.txt"),
    "balls/Ball_drops_data.xls": ("briandesilva/discovery-of-physics-from-data", "b79c343", "Data/Ball_drops_data.xls"),
    "pendulum/Single.mat": (
        "dynamicslab/MultiArm-Pendulum",
        "e99a7e1",
        "ParameterEstimation/SinglePendulum/SinglePendulumDataForParameterEstimation.mat",
    ),
    "flutter-still-air/Measured_data.mat": (
        "dawbarton/AeroelasticCBC.jl",
        "c4812e2",
        "src/lee/Linear_system_Identification/Measured_data.mat",
    ),
    "flutter-still-air/Measured_data2.mat": (
        "dawbarton/AeroelasticCBC.jl",
        "c4812e2",
        "src/lee/Linear_system_Identification/Measured_data2.mat",
    ),
    **{
        f"yeo2011/{name}.csv": ("camUrban/PteraSoftware", "f4020cd", f"validation/{name}.csv")
        for name in (
            "extracted_planform_coordinates",
            "measured_wing_positions",
            *(f"{colour}_{place}_point_experimental_pressures" for colour in COLOURS for place in PLACES),
        )
    },
}
BY_HAND = (
    "balls/Ball_drops_data.xls is a spreadsheet: save it as balls/drops.csv with the columns ball, drop (1 or 2), "
    "time_s (from 0 at the first frame) and height_m, one row for each frame"
)


def fetch(folder: Path, say: Callable[[str], None]) -> bool:
    """Download to ``folder`` what is not there; return whether all succeeded. ``say`` takes lines for the reader."""
    complete = True
    for place, (repository, commit, path) in FILES.items():
        target, source = folder / place, f"{RAW}/{repository}/{commit}/{quote(path)}"
        if target.exists():
            say(f"{target} is there")
            continue
        try:
            with urllib.request.urlopen(source, timeout=TIMEOUT) as answer:  # noqa: S310  # the scheme is https
                content = answer.read()
        except (urllib.error.URLError, TimeoutError) as error:
            say(f"{source} cannot be read: {error}; download it by hand to {target}")
            complete = False
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        say(f"{target} from {source}")
    say(BY_HAND)
    return complete
