from .config import GraspConfig as GraspConfig
from .config import read_config as read_config
from .errors import ConfigError as ConfigError
from .errors import ConvergenceError as ConvergenceError
from .errors import DataError as DataError
from .errors import FitError as FitError
from .errors import PushfitError as PushfitError
from .model import Grasp as Grasp
from .model import Parameters as Parameters
from .model import Pushes as Pushes
from .model import forward as forward

__version__: str
