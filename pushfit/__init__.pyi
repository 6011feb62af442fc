from .config import GraspConfig as GraspConfig
from .config import read_config as read_config
from .data.merge import merge_tables as merge_tables
from .data.peaks import extract_peaks as extract_peaks
from .data.recording import Recording as Recording
from .data.recording import read_recording as read_recording
from .data.schedule import PushSchedule as PushSchedule
from .data.schedule import read_schedule as read_schedule
from .data.simulate import simulate_recording as simulate_recording
from .data.simulate import simulate_table as simulate_table
from .data.table import PeakTable as PeakTable
from .data.table import read_table as read_table
from .data.table import write_table as write_table
from .directions import best_direction as best_direction
from .directions import critical_angle as critical_angle
from .errors import ConfigError as ConfigError
from .errors import ConvergenceError as ConvergenceError
from .errors import DataError as DataError
from .errors import FitError as FitError
from .errors import PushfitError as PushfitError
from .fit.comparison import compare_models as compare_models
from .fit.identify import identify_table as identify_table
from .model import Grasp as Grasp
from .model import Parameters as Parameters
from .model import Pushes as Pushes
from .model import forward as forward

__version__: str
