"""Rod files: the rod alone, in the fields of a job file's [rod], for `batten bend --rod`."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from batten.errors import InvalidInputError
from batten.fabrication.job import RodJob
from batten.fabrication.rod import Rod
from batten.io.job import read_toml, validated
from batten.io.job_fields import JobFile, RodSection
from batten.io.job_section import Section


class RodFields(RodSection):
    """The fields of [rod] in a job file, of which a rod file may leave `length_mm` out."""

    length_mm: float | None = Field(  # type: ignore[assignment]  # what may be absent here is required there
        default=None, gt=0.0, le=20000.0, description="Length between the two grippers.", examples=[1000.0]
    )


class RodFile(Section):
    """A rod file whose fields stand under [rod]."""

    rod: RodFields = Field(description="The rod.")


def load_rod(path: str | Path, length_mm: float | None = None) -> Rod:
    """Read a rod file.

    It holds the fields of a job file's [rod] (docs/job-file.md), either at its top or under [rod], and there is no need for
    `length_mm`. A whole job file is a rod file, too: only its [rod] is read, and `min_bow_mm` plays no part.

    Parameters:
        path: the TOML file.
        length_mm: length between the grippers, above 0; it goes before the file's own. None to take the file's.

    Returns:
        The rod.

    Raises:
        FormatError: no TOML, an unknown field, a missing field. The message is one line: file, line, field, what came,
            what is allowed, what to try.
        InvalidInputError: a value outside its bounds, sizes that make no section, a file that is not there, no length
            either in the file or given.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "rod.toml"
        ...     _ = path.write_text("width_mm = 20\\nthickness_mm = 0.5\\nyoungs_modulus_mpa = 210000\\nmax_strain = 0.004")
        ...     rod = load_rod(path, length_mm=600.0)
        >>> rod.section.description, rod.bending_stiffness_nmm2
        ('flat, 20 × 0.5 mm', 43750.0)
    """
    path = Path(path)
    text, data = read_toml(path, "a rod file", "examples/bend/rod.toml")
    if "rod" in data:
        own = {key: value for key, value in data.items() if key == "rod" or key not in JobFile.model_fields}
        fields: RodFields = validated(RodFile, own, path, text).rod
    else:
        fields = validated(RodFields, data, path, text)
    length = length_mm if length_mm is not None else fields.length_mm
    if length is None:
        raise InvalidInputError(
            f"{path}: length_mm is missing; give the length between the grippers, as length_mm = 1000.0"
        )
    return Rod.of(RodJob(**(dict(fields) | {"length_mm": length})))
