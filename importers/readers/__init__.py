"""Readers, one file per format, and the list of them: a new format is one file and one entry here."""

from wingfit.importers.raw import Reader
from wingfit.importers.readers import (
    anipose,
    c3d,
    deeplabcut,
    dltdv,
    dltdv_sparse,
    motive,
    plain,
    qualisys,
    sleap,
    trc,
    vicon,
)

# A plain table is read if no other format fits, so it does not recognise anything itself.
SPECIFIC: tuple[Reader, ...] = (
    c3d.READER,
    trc.READER,
    motive.READER,
    qualisys.READER,
    vicon.READER,
    dltdv.READER,
    dltdv_sparse.READER,
    deeplabcut.READER,
    anipose.READER,
    sleap.READER,
)
READERS: dict[str, Reader] = {reader.name: reader for reader in (*SPECIFIC, plain.READER)}
