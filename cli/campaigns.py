"""``wingfit campaign`` and ``wingfit balance``: write simulated experiments (marker tracks, forces) as datasets."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.files import refused
from wingfit.cli.base.output import next_step, progress, say
from wingfit.client.client import WingfitError


def campaign(
    out: Annotated[Path, typer.Argument(help="Folder to write the dataset to (or a name ending in .zip).")],
    division: Annotated[str, typer.Option(help="4, 11, 24, or bodies per strip, e.g. 3,3,3,2.")] = "24",
    small: Annotated[bool, typer.Option("--small", help="A few recordings instead of the full campaign.")] = False,
    seed: Annotated[int, typer.Option(help="Random seed of the true genome, the noise and the gaps.")] = 1,
) -> None:
    """Write the experiment of van der Grinten's thesis as a dataset, simulated with a known genome.

    The true genome is written to a separate file next to the dataset, which a calibration never reads.

    Example: wingfit campaign my-campaign --division 11 --small --seed 7
    """
    from wingfit.sim.virtual_rigs.campaign import write_campaign  # imported late: other commands start faster

    with _writing(out), progress("simulating the campaign") as report:
        write_campaign(out, division=division, small=small, seed=seed, progress=report)


def balance(
    out: Annotated[Path, typer.Argument(help="Folder to write the dataset to (or a name ending in .zip or .nc).")],
    seed: Annotated[int, typer.Option(help="Random seed of the noise.")] = 1,
) -> None:
    """Write the DelFly's wind-tunnel tests as a dataset of forces, simulated with known coefficients.

    The true coefficients are written to a separate file next to the dataset, which a calibration never reads.

    Example: wingfit balance my-balance --seed 7
    """
    from wingfit.sim.virtual_rigs.balance import write_campaign  # as above

    with _writing(out):
        write_campaign(out, seed)


@contextmanager
def _writing(out: Path) -> Iterator[None]:
    """Run the with-block, which writes a dataset to ``out``, and print the next command.

    WingfitError is raised if ``out`` exists already (other than as an empty folder), or for a ValueError in the block.
    """
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise WingfitError("no campaign written", f"{out} exists already; name a new folder or file")
    with refused("no campaign written"):
        yield
    say(f"campaign written to {out}")
    next_step(f"wingfit datasets upload {shlex.quote(str(out))}")
