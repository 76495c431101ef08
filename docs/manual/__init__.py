"""Builds the manual, a web site of all documents with a search: ``python -m docs.manual`` (or ``make docs``)."""
