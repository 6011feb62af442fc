"""Contact parameters, critical angle and best push direction from robotic pushes."""

import lazy_loader

__version__ = "0.1.0"

# The names are listed in __init__.pyi; each is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
