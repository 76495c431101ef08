"""Take a calibrated model away: a Python file or package, tables, or another format that needs no wingfit.

:class:`wingfit.export.calibrated_model.CalibratedModel` is what every format is written from.
"""
