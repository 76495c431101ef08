"""The texts of an FMU: modelDescription.xml, the tables of its C code, and its page of documentation."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.kernels.board import EXTRAPOLATE
from wingfit.export.fmu.memory import WORD
from wingfit.export.fmu.product import Product
from wingfit.export.fmu.variables import Variable

FIRST = 1  # value reference of the first variable; 0 is time
_UNITS = {
    "Hz": 's="-1"', "rad": 'rad="1"', "m/s": 'm="1" s="-1"', "m": 'm="1"', "N": 'kg="1" m="1" s="-2"',
    "N.m": 'kg="1" m="2" s="-2"', "W": 'kg="1" m="2" s="-3"', "s": 's="1"', "1": "",
}  # fmt: skip


def identifier(model: CalibratedModel) -> str:
    """Return the model identifier of the FMU: a name in C."""
    return "wingfit_" + re.sub(r"\W", "_", model.rig.name, flags=re.ASCII)


def model_description(model: CalibratedModel, product: Product, token: str) -> str:
    """Return modelDescription.xml (FMI 3.0)."""
    source = model.provenance
    about = f"{model.rig.name}, calibrated by wingfit ({source.origin} {source.id}, {source.source})"
    date = f"generationDateAndTime={quoteattr(source.created_at)} " if source.created_at else ""
    outputs = [FIRST + k for k, one in enumerate(product.variables) if one.causality == "output"]
    units = "\n".join(
        f"    <Unit name={quoteattr(name)}><BaseUnit {base}/></Unit>"
        for name, base in _UNITS.items()
        if any(one.unit == name for one in product.variables) or name == "s"
    )
    variables = "\n".join(f"    {_element(one, FIRST + k)}" for k, one in enumerate(product.variables))
    structure = "\n".join(
        f'    <{kind} valueReference="{k}"/>' for kind in ("Output", "InitialUnknown") for k in outputs
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(identifier(model))} instantiationToken="{token}"
    description={quoteattr(about)} generationTool={quoteattr("wingfit " + source.wingfit_version)}
    {date}variableNamingConvention="structured">
  <CoSimulation modelIdentifier={quoteattr(identifier(model))} canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <UnitDefinitions>
{units}
  </UnitDefinitions>
  <LogCategories>
    <Category name="logStatusDiscard" description="inputs outside the range in which the model was fitted"/>
    <Category name="logStatusError" description="why a call failed"/>
  </LogCategories>
  <DefaultExperiment startTime="0" stopTime="{product.stop:g}" stepSize="{product.step:g}"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>
{variables}
  </ModelVariables>
  <ModelStructure>
{structure}
  </ModelStructure>
</fmiModelDescription>
"""


def _element(one: Variable, reference: int) -> str:
    """Return the element of a variable; ``reference`` is its value reference."""
    causality = "parameter" if one.causality == "tunable" else one.causality
    discrete = {"parameter": "fixed", "tunable": "tunable"}
    variability = discrete.get(one.causality, "continuous")
    text = f'<{one.kind} name={quoteattr(one.name)} valueReference="{reference}" causality="{causality}"'
    text += f' variability="{variability}" description={quoteattr(one.description)}'
    if one.unit and one.kind == "Float64":
        text += f" unit={quoteattr(one.unit)}"
    if one.kind != "Boolean":
        text += "".join(
            f' {name}="{_number(value, one)}"'
            for name, value in (("min", one.least), ("max", one.most)) if math.isfinite(value)
        )  # fmt: skip
    if one.start is not None:
        text += f' start="{_number(one.start, one)}"'
    return text + "/>"


def _number(value: float, one: Variable) -> str:
    if one.kind == "Boolean":
        return "true" if value else "false"
    return str(int(value)) if one.kind == "Int32" else repr(float(value))


def header(product: Product, token: str) -> str:
    """Return model.h: the tables of the C code."""
    kinds = {"Float64": "FLOAT", "Boolean": "BOOLEAN", "Int32": "COUNT"}
    memory, laws = product.memory, max((number for _, number in product.laws), default=-1) + 1
    variables = [
        f"{{{one.word}, {kinds[one.kind]}, {one.causality.upper()}, {_text(one.name)}, "
        f"{_double(one.least)}, {_double(one.most)}}}"
        for one in product.variables
    ]
    limits = [
        f"{{{one.word}, {one.low!r}, {one.high!r}, {_text(one.name)}, {_text(one.unit)}}}" for one in product.limits
    ]
    functions = "\n".join(
        f"int32_t wingfit_law_{k}(void *result, void **error, int64_t *frame, int64_t moment);\n"
        f"static void law_{k}(int64_t *frame, int64_t moment) {{\n"
        f"    void *result = NULL, *error = NULL;\n    wingfit_law_{k}(&result, &error, frame, moment);\n}}"
        for k in range(laws)
    )
    return "\n".join(
        [
            f"#define WORDS {memory.size}", f"#define FIRST_CHANGING {memory.first_changing}",
            f'#define TOKEN "{token}"', f"#define TOKEN_NUMBER 0x{token[:16]}ull",
            "#define TIME_REFERENCE 0", f"#define FIRST_REFERENCE {FIRST}",
            f"#define EXTRAPOLATE {memory.word(product.board.ctypes.data) + EXTRAPOLATE}",
            _table("Variable", "VARIABLE", variables), _table("Limit", "LIMIT", limits),
            _pairs("ADDRESS", product.addresses), _pairs("LAW", product.laws), functions,
            f"static const Law LAW_FUNCTIONS[] = {{{', '.join([f'law_{k}' for k in range(laws)] or ['NULL'])}}};", "",
        ]
    )  # fmt: skip


def _table(kind: str, name: str, rows: Sequence[str]) -> str:
    several = name + "S"
    lines = ",\n".join(f"    {row}" for row in rows) or "    {0}"
    return f"#define {name}_COUNT ((size_t){len(rows)})\nstatic const {kind} {several}[] = {{\n{lines}\n}};"


def _pairs(name: str, pairs: Sequence[tuple[int, int]]) -> str:
    several = "ADDRESSES" if name == "ADDRESS" else name + "S"
    rows = ", ".join(f"{{{a}, {b}}}" for a, b in pairs) or "{0, 0}"
    return f"#define {name}_COUNT ((size_t){len(pairs)})\nstatic const int64_t {several}[][2] = {{{rows}}};"


def _double(value: float) -> str:
    return repr(value) if math.isfinite(value) else "INFINITY" if value > 0 else "-INFINITY"


def _text(value: str) -> str:
    """Return a string of C; other characters than those of ASCII as octal numbers."""
    return '"' + "".join(chr(b) if 32 <= b < 127 and b not in b'"\\?' else f"\\{b:03o}" for b in value.encode()) + '"'


def size_of(product: Product) -> int:
    """Bytes of the memory of one instance."""
    return WORD * product.memory.size


def documentation(model: CalibratedModel, product: Product) -> str:
    """Return documentation/index.html."""
    source = model.provenance
    rows = [(one.name, f"{one.value:.6g}", one.unit, one.description) for one in model.parameters]
    limits = [(one.name, f"{one.low:.6g} to {one.high:.6g}", one.unit, "") for one in product.limits]
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{html.escape(model.rig.name)}</title></head><body>
<h1>{html.escape(model.rig.name)}</h1>
<p>A model that wingfit {html.escape(source.wingfit_version)} calibrated ({source.origin} {html.escape(source.id)},
{html.escape(source.source)}) on the dataset {html.escape(source.dataset)}
(SHA-256 {source.dataset_sha256 or "unknown"}). resources/model.json has all of it: values, their covariance,
effects, conditions and provenance.</p>
<p>{html.escape(product.remark)}</p>
<h2>Fitted range of the inputs</h2>
<p>Other inputs are refused unless the parameter extrapolate is true.</p>
{_html_table(limits)}
<h2>Calibrated values</h2>
{_html_table(rows)}
<h2>Remarks</h2>
<ul>{"".join(f"<li>{html.escape(one)}</li>" for one in model.remarks)}</ul>
</body></html>
"""


def _html_table(rows: Sequence[tuple[str, ...]]) -> str:
    lines = ("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return "<table>\n" + "\n".join(lines) + "\n</table>"
