"""Names of picture files: known before anything that could draw is loaded.

Excluded: drawing and writing them (`pushfit.report.figures.style`).
"""

from pathlib import Path

from pushfit.atomic import is_stream
from pushfit.errors import ConfigError

# Formats for photographs would smear the lines.
FORMATS = ("png", "svg", "pdf")


def picture_format(path: Path) -> str:
    """Format of a picture by the name of its file, for example "svg".

    Args:
        path: File; a stream may have no suffix and gets a PNG.

    Raises:
        ConfigError: The suffix is none of those that can be written.
    """
    suffix = path.suffix.removeprefix(".").lower()
    if suffix in FORMATS:
        return suffix
    if not suffix and is_stream(path):
        return FORMATS[0]
    fault = f"the suffix .{suffix} is no format for pictures" if suffix else "no suffix"
    raise ConfigError(
        f"{path}: {fault}; end the name in {', '.join(f'.{name}' for name in FORMATS)}",
        code="picture_format",
    )
