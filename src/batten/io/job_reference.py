"""The reference of job files, docs/job-file.md, made from the fields themselves.

Renew it with `python -m batten.io.job_reference > docs/job-file.md`; a test holds it to what this module prints.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from batten.io.job import describe_type, section_of
from batten.io.job_fields import JobFile

_HEAD = """# The job file

`batten cut JOB.toml -o OUT` reads one TOML file. Units are in the names: `_mm`, `_deg` (degrees), `_mpa` (MPa = N/mm²),
`_mm_s` (mm/s), `_n` (N), `_nmm` (N·mm). Paths are relative to the job file. A field that is not listed is an error,
and so is a value outside its bounds: one line on stderr names the file, the line, the field, what came and what to try.

The smallest job, with everything that has no default:

```toml
[surface]
file = "freeform-surface.3dm"
scale_mm_per_unit = 300.0
[blocks]
size_mm = [600.0, 600.0]
[leaves]
spacing_mm = 20.0
tolerance_mm = 0.5
[rod]
length_mm = 1000.0
diameter_mm = 3.0
youngs_modulus_mpa = 200000.0
max_strain = 0.008
[blade]
kerf_mm = 1.0
speed_mm_s = 20.0
[cell]
preset = "two-irb6620"
```

This page is made by `python -m batten.io.job_reference`.
"""


def job_reference() -> str:
    """The whole page: a head, then one table of fields for every section of a job file, as Markdown."""
    return _HEAD + "".join(_sections(JobFile, ""))


def _sections(model: type[BaseModel], name: str) -> Iterator[str]:
    """One table for the model's own values, then its sections, depth first."""
    inner = {key: section for key in model.model_fields if (section := section_of(model, key)) is not None}
    properties = model.model_json_schema()["properties"]
    values = [key for key in model.model_fields if key not in inner]
    title = f"`[{name}]`" if name else "At the top of the file"
    title = f"{title} and `[{name.replace('left', 'right')}]`" if "left" in name else title
    about = " ".join((model.__doc__ or "").split())
    yield f"\n## {title}\n\n{about}\n\n| field | takes | default | example | meaning |\n|---|---|---|---|---|\n"
    for key in values:
        field = model.model_fields[key]
        default = "**required**" if field.is_required() else "none" if field.default is None else _code(field.default)
        cells = (
            f"`{key}`",
            describe_type(properties[key]),
            default,
            _code((field.examples or [""])[0]),
            field.description,
        )
        yield "| " + " | ".join(str(c) for c in cells) + " |\n"
    for key, section in inner.items():
        if key != "right":  # the same fields as the left arm's
            yield from _sections(section, f"{name}.{key}" if name else key)


def _code(value: Any) -> str:
    return f"`{json.dumps(value, ensure_ascii=False)}`"


if __name__ == "__main__":
    print(job_reference(), end="")
