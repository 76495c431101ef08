"""Methods of the client that import tracks on a server."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

from wingfit.client.importing.answers import FirstDescription, TrackImport
from wingfit.client.transport import CountedFile, OnBytes, Transport, WingfitError, given

Options = dict[str, str | float | bool | None]


class ImportCalls(Transport):
    """Base class of the client: sends files of tracking systems; the server stores nothing of them.

    ``options`` are those of :func:`wingfit.import_tracks`: unit, rate_hz, axes, format, time_unit, decimal, columns,
    rows, keep_zeros, keep_unlabelled, incomplete, markers, repeated.
    """

    def import_tracks(
        self, path: str | Path, *, on_bytes: OnBytes | None = None, **options: str | float | bool | None
    ) -> TrackImport:
        """Return what the server understood of the file ``path``, the options that are missing, and a preview.

        WingfitError lists what is wrong with the file. ``on_bytes(sent, total)`` is called during the transfer.
        """
        return cast(TrackImport, self._post_tracks("/v1/imports", Path(path), on_bytes, options).json())

    def import_table(
        self, path: str | Path, *, on_bytes: OnBytes | None = None, **options: str | float | bool | None
    ) -> str:
        """Return the tracks in the file ``path`` as the table of a recording (CSV; seconds and metres).

        WingfitError lists what is wrong with the file, and which options are missing.
        """
        return str(self._post_tracks("/v1/imports/table", Path(path), on_bytes, options).text)

    def import_description(
        self, path: str | Path, *, on_bytes: OnBytes | None = None, **options: str | float | bool | None
    ) -> FirstDescription:
        """Return a first description of the rig by the tracks in the file ``path`` alone.

        ``options`` may have ``flap_frequency_hz``, too. WingfitError lists what the tracks do not show.
        """
        return cast(
            FirstDescription, self._post_tracks("/v1/imports/description", Path(path), on_bytes, options).json()
        )

    def _post_tracks(self, url: str, path: Path, on_bytes: OnBytes | None, options: Options) -> Any:
        if not path.is_file():
            raise WingfitError("no such file", f"{path} is no file; give a file of a tracking system")
        fields = {name: str(value).lower() if isinstance(value, bool) else value for name, value in options.items()}

        def send() -> Any:
            with CountedFile(path, on_bytes) as stream:
                return self._http.post(
                    url,
                    files={"file": (path.name, cast(io.BufferedReader, stream))},
                    data=given(**fields),
                    timeout=self.simulating,
                )

        return self._repeat(send)
