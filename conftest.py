"""Has the shapes checked by `tests.forms`, before anything imports pushfit."""

import jaxtyping

from tests.forms import jaxtyped

jaxtyping.jaxtyped = jaxtyped
